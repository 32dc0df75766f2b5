// Forward lens models against OpenCV's, against their own inverse, and where they end.
#include "rig/lens.hpp"

#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <vector>

#include "unit/rig_support.hpp"

namespace groundline::rig {
namespace {

using test::Random;

// OpenCV's pixel of a point in the camera frame.
cv::Point2d opencv_pixel(const CameraModel& camera, const Vector3& point) {
    const std::vector<cv::Point3d> points = {{point[0], point[1], point[2]}};
    const cv::Matx33d k(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
    const auto& d = camera.distortion;
    std::vector<cv::Point2d> pixels;
    const cv::Vec3d none(0, 0, 0);
    if (camera.lens == Lens::kEquidistant)
        cv::fisheye::projectPoints(points, pixels, none, none, k, cv::Vec4d(d[0], d[1], d[2], d[3]));
    else
        cv::projectPoints(points, none, none, k, std::vector<double>(d.begin(), d.end()), pixels);
    return pixels.front();
}

class LensOf : public testing::TestWithParam<Lens> {};

TEST_P(LensOf, ProjectsLikeOpenCv) {
    Random random(1);
    for (int i = 0; i < 500; ++i) {
        const CameraModel camera = test::sample_camera(random, GetParam(), 640, 480);
        const LensProjection lens(camera);
        const Vector3 ray = {random.between(-0.6, 0.6), random.between(-0.45, 0.45), 1.0};
        const double depth = random.between(0.3, 50.0);
        const Vector3 point = {ray[0] * depth, ray[1] * depth, depth};
        const std::optional<Pixel> pixel = lens.project(point);
        ASSERT_TRUE(pixel);
        const cv::Point2d expected = opencv_pixel(camera, point);
        EXPECT_NEAR(pixel->u, expected.x, 1e-9);
        EXPECT_NEAR(pixel->v, expected.y, 1e-9);
    }
}

TEST_P(LensOf, RoundTripsThroughAnIterativeInverse) {
    Random random(2);
    for (int i = 0; i < 500; ++i) {
        const CameraModel camera = test::sample_camera(random, GetParam(), 640, 480);
        const LensProjection lens(camera);
        const test::Point2 pixel = {random.between(60, 580), random.between(60, 420)};
        const std::optional<Pixel> back = lens.project(test::ray_of(camera, pixel));
        ASSERT_TRUE(back);
        EXPECT_NEAR(back->u, pixel.x, 1e-7);
        EXPECT_NEAR(back->v, pixel.y, 1e-7);
    }
}

TEST_P(LensOf, TheAxisMeetsThePrincipalPoint) {
    Random random(3);
    const CameraModel camera = test::sample_camera(random, GetParam(), 640, 480);
    const std::optional<Pixel> pixel = LensProjection(camera).project({0, 0, 3});
    ASSERT_TRUE(pixel);
    EXPECT_EQ(pixel->u, camera.cx);
    EXPECT_EQ(pixel->v, camera.cy);
    EXPECT_FALSE(LensProjection(camera).project({0, 0, -1}));
    EXPECT_FALSE(LensProjection(camera).project({1, 0, 0}));
}

INSTANTIATE_TEST_SUITE_P(, LensOf, testing::Values(Lens::kPinhole, Lens::kEquidistant), [](const auto& lens) {
    return lens.param == Lens::kPinhole ? "Pinhole" : "Equidistant";
});

TEST(Lens, HasNoPixelWhereThePolynomialTurnsBack) {
    CameraModel camera;
    camera.fx = camera.fy = 500;
    camera.distortion = {-0.4};
    // r (1 - 0.4 r^2) grows up to r = 1/sqrt(1.2) = 0.9129.
    const LensProjection lens(camera);
    EXPECT_TRUE(lens.project({0.905, 0, 1}));
    EXPECT_TRUE(lens.project({-0.64, 0.64, 1}));  // radius 0.905
    EXPECT_FALSE(lens.project({0.92, 0, 1}));
    EXPECT_FALSE(lens.project({0.0, -1.5, 1}));  // would come back at radius 0.15
    EXPECT_FALSE(lens.project({0.66, 0.66, 1}));
}

TEST(Lens, HasNoPixelBeyondAPoleOfTheRationalModel) {
    CameraModel camera;
    camera.fx = camera.fy = 500;
    camera.distortion = {0, 0, 0, 0, 0, -1.0};  // r / (1 - r^2) has its pole at 1
    const LensProjection lens(camera);
    EXPECT_TRUE(lens.project({0.9, 0, 1}));
    EXPECT_FALSE(lens.project({1.1, 0, 1}));
}

}  // namespace
}  // namespace groundline::rig
