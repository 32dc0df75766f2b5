// The common frame of a pair: exact epipolar geometry, full coverage, and OpenCV as a second opinion.
#include "rig/rectification.hpp"

#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.hpp"
#include "rig/rectifier.hpp"
#include "unit/rig_support.hpp"

namespace groundline::rig {
namespace {

using test::Random;

cv::Matx33d matrix_of(const CameraModel& camera) {
    return {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
}

cv::Mat distortion_of(const CameraModel& camera) {
    const auto& d = camera.distortion;
    return cv::Mat(1, 8, CV_64F, const_cast<double*>(d.data())).clone();
}

cv::Matx33d matrix_of(const Matrix3& m) {
    return cv::Matx33d(m.data());
}

struct OpenCvRectification {
    cv::Matx33d r1, r2;
    cv::Matx34d p1, p2;

    GivenRectification given() const {
        GivenRectification out;
        std::copy_n(r1.val, 9, out.rotation_left.begin());
        std::copy_n(r2.val, 9, out.rotation_right.begin());
        std::copy_n(p1.val, 12, out.projection_left.begin());
        std::copy_n(p2.val, 12, out.projection_right.begin());
        return out;
    }
};

OpenCvRectification rectified_by_opencv(const StereoCalibration& rig, double alpha) {
    OpenCvRectification out;
    cv::Mat q;
    cv::stereoRectify(matrix_of(rig.left), distortion_of(rig.left), matrix_of(rig.right),
                      distortion_of(rig.right), cv::Size(rig.left.width, rig.left.height),
                      matrix_of(rig.rotation), cv::Vec3d(rig.translation_m.data()), out.r1, out.r2, out.p1,
                      out.p2, q, cv::CALIB_ZERO_DISPARITY, alpha);
    return out;
}

class RectificationOf : public testing::TestWithParam<Lens> {};

// The oracle: a point goes through both full camera models, each pixel back through an iterative inverse and
// into the common frame; there the rows agree and the columns differ by f b / Z.
TEST_P(RectificationOf, RowsOfTheTwoViewsAgree) {
    Random random(21);
    for (int sample = 0; sample < 40; ++sample) {
        const StereoCalibration rig = test::sample_rig(random, GetParam(), 640, 480);
        const Rectification frame = rectification_of(rig, 640, 480);
        for (int i = 0; i < 100; ++i) {
            const double depth = random.between(0.8, 30.0);
            const Vector3 in_left = {depth * random.between(-0.35, 0.35), depth * random.between(-0.25, 0.25),
                                     depth};
            Vector3 in_right = rig.rotation * in_left;
            for (std::size_t axis = 0; axis < 3; ++axis)
                in_right[axis] += rig.translation_m[axis];
            const Vector3 left =
                frame.rotation_left * test::ray_of(rig.left, test::pixel_of(rig.left, in_left));
            const Vector3 right =
                frame.rotation_right * test::ray_of(rig.right, test::pixel_of(rig.right, in_right));
            const double v_left = frame.fy * left[1] / left[2] + frame.cy;
            const double v_right = frame.fy * right[1] / right[2] + frame.cy;
            EXPECT_NEAR(v_left, v_right, 1e-6);
            const double u_left = frame.fx * left[0] / left[2] + frame.cx_left;
            const double u_right = frame.fx * right[0] / right[2] + frame.cx_right;
            const double common_depth = (frame.rotation_left * in_left)[2];
            EXPECT_NEAR(u_left - u_right, frame.fx * frame.baseline_m / common_depth, 1e-6);
        }
    }
}

TEST_P(RectificationOf, TurnsWithoutDistorting) {
    Random random(22);
    for (int sample = 0; sample < 100; ++sample) {
        const StereoCalibration rig = test::sample_rig(random, GetParam(), 640, 480);
        const Rectification frame = rectification_of(rig, 640, 480);
        EXPECT_LT(distance(frame.rotation_left * transposed(frame.rotation_left), kIdentity3), 1e-14);
        EXPECT_GT(determinant(frame.rotation_left), 0.0);
        EXPECT_LT(distance(frame.rotation_right * rig.rotation, frame.rotation_left), 1e-14);
        EXPECT_NEAR(frame.baseline_m, norm(rig.translation_m), 1e-14);
        EXPECT_EQ(frame.fx, frame.fy);
        EXPECT_EQ(frame.cx_left, frame.cx_right);
    }
}

// No rectified pixel lies outside, and the view is as wide as that allows.
TEST_P(RectificationOf, TheViewIsFullAndNoNarrowerThanNeeded) {
    Random random(23);
    for (int sample = 0; sample < 12; ++sample) {
        const int width = 333, height = 251;
        const StereoCalibration rig = test::sample_rig(random, GetParam(), width, height);
        Arena arena;
        const Rectifier rectifier(rig, width, height, arena);
        EXPECT_TRUE(rectifier.outside_left().empty());
        EXPECT_TRUE(rectifier.outside_right().empty());
        int nearest = 32 * width;  // distance of a source position from the rim, in 1/32 px
        for (const auto& map : {rectifier.map_left(), rectifier.map_right()})
            for (int y = 0; y < height; ++y)
                for (int x = 0; x < width; ++x) {
                    const SourcePixel& p = map.at(x, y);
                    const int u = 32 * p.x + p.right32, v = 32 * p.y + p.below32;
                    nearest = std::min({nearest, u, v, 32 * (width - 1) - u, 32 * (height - 1) - v});
                }
        EXPECT_LE(nearest, 16) << "half a pixel from the rim";
    }
}

TEST_P(RectificationOf, TheMiddleStaysInTheMiddle) {
    Random random(24);
    for (int sample = 0; sample < 12; ++sample) {
        const StereoCalibration rig = test::sample_rig(random, GetParam(), 641, 481);
        Arena arena;
        const Rectifier rectifier(rig, 641, 481, arena);
        const SourcePixel left = rectifier.map_left().at(320, 240);
        const SourcePixel right = rectifier.map_right().at(320, 240);
        // Both views share one principal point: the cameras' different turns are split between them.
        EXPECT_NEAR(0.5 * (left.x + right.x), 320, 6);
        EXPECT_NEAR(0.5 * (left.y + right.y), 240, 6);
    }
}

// G5: baseline and depth in other units change the baseline and nothing else.
TEST_P(RectificationOf, BaselineScales) {
    Random random(25);
    for (int sample = 0; sample < 20; ++sample) {
        const StereoCalibration rig = test::sample_rig(random, GetParam(), 320, 240);
        StereoCalibration longer = rig;
        const double k = random.between(0.5, 3.0);
        for (double& t : longer.translation_m)
            t *= k;
        const Rectification a = rectification_of(rig, 320, 240);
        const Rectification b = rectification_of(longer, 320, 240);
        EXPECT_NEAR(b.baseline_m, k * a.baseline_m, 1e-12);
        EXPECT_NEAR(a.fx, b.fx, 1e-9 * a.fx);
        EXPECT_NEAR(a.cx_left, b.cx_left, 1e-9 * a.fx);
        EXPECT_LT(distance(a.rotation_left, b.rotation_left), 1e-12);
    }
}

// G6: pictures of half the size have half the focal length. Not exactly: the rims of the two pixel grids
// differ by half a pixel.
TEST_P(RectificationOf, HalfResolutionHalvesTheFocalLength) {
    Random random(26);
    for (int sample = 0; sample < 20; ++sample) {
        const StereoCalibration rig = test::sample_rig(random, GetParam(), 640, 480);
        StereoCalibration half = rig;
        for (CameraModel* camera : {&half.left, &half.right}) {
            camera->width /= 2;
            camera->height /= 2;
            camera->fx /= 2;
            camera->fy /= 2;
            camera->cx = 0.5 * (camera->cx + 0.5) - 0.5;
            camera->cy = 0.5 * (camera->cy + 0.5) - 0.5;
        }
        const Rectification a = rectification_of(rig, 640, 480);
        const Rectification b = rectification_of(half, 320, 240);
        EXPECT_NEAR(b.fx, 0.5 * a.fx, 0.005 * a.fx);
        EXPECT_EQ(a.baseline_m, b.baseline_m);
        EXPECT_EQ(a.rotation_left, b.rotation_left);
    }
}

INSTANTIATE_TEST_SUITE_P(, RectificationOf, testing::Values(Lens::kPinhole, Lens::kEquidistant),
                         [](const auto& lens) {
                             return lens.param == Lens::kPinhole ? "Pinhole" : "Equidistant";
                         });

TEST(Rectification, SharesItsXAxisAndAboutItsFocalLengthWithOpenCv) {
    Random random(27);
    for (int sample = 0; sample < 20; ++sample) {
        const StereoCalibration rig = test::sample_rig(random, Lens::kPinhole, 640, 480);
        const OpenCvRectification theirs = rectified_by_opencv(rig, 0.0);
        const Rectification ours = rectification_of(rig, 640, 480);
        for (int column = 0; column < 3; ++column) {
            const auto i = static_cast<std::size_t>(column);
            EXPECT_NEAR(ours.rotation_left[i], theirs.r1(0, column), 1e-9);
            EXPECT_NEAR(ours.rotation_right[i], theirs.r2(0, column), 1e-9);
        }
        // The free turn about the baseline is shared out a little differently, and OpenCV zooms by a 9 x 9
        // grid.
        EXPECT_NEAR(ours.rotation_left[8], theirs.r1(2, 2), 0.002);
        EXPECT_NEAR(ours.fx, theirs.p1(0, 0), 0.05 * ours.fx);
    }
}

// A given rectification makes the very map that OpenCV makes of it.
TEST(Rectification, AGivenOneMakesOpenCvsMaps) {
    Random random(28);
    for (const double alpha : {0.0, 0.5}) {
        const int width = 321, height = 243;
        StereoCalibration rig = test::sample_rig(random, Lens::kPinhole, width, height);
        const OpenCvRectification theirs = rectified_by_opencv(rig, alpha);
        rig.rectification = theirs.given();
        Arena arena;
        const Rectifier rectifier(rig, width, height, arena);
        EXPECT_EQ(rectifier.rig().focal_px, theirs.p1(0, 0));
        EXPECT_NEAR(rectifier.rig().baseline_m, norm(rig.translation_m), 1e-9);
        cv::Mat u, v;
        cv::initUndistortRectifyMap(matrix_of(rig.left), distortion_of(rig.left), theirs.r1, theirs.p1,
                                    cv::Size(width, height), CV_32FC1, u, v);
        int compared = 0;
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const SourcePixel p = rectifier.map_left().at(x, y);
                const double their_u = u.at<float>(y, x), their_v = v.at<float>(y, x);
                constexpr double kHalfStep = 1.0 / 64 + 1e-3;
                if (p.x == SourcePixel::kNoSource) {
                    EXPECT_TRUE(their_u < kHalfStep || their_u > width - 1 - kHalfStep ||
                                their_v < kHalfStep || their_v > height - 1 - kHalfStep)
                        << x << ", " << y;
                    continue;
                }
                ++compared;
                EXPECT_NEAR(p.x + p.right32 / 32.0, their_u, kHalfStep);
                EXPECT_NEAR(p.y + p.below32 / 32.0, their_v, kHalfStep);
            }
        EXPECT_GT(compared, width * height / 2);
    }
}

TEST(Rectification, AVeryWideLensLosesItsRimInsteadOfItsMiddle) {
    StereoCalibration rig;
    for (CameraModel* camera : {&rig.left, &rig.right}) {
        camera->width = camera->height = 800;
        camera->fx = camera->fy = 255;  // 90 degrees off the axis at the rim
        camera->cx = camera->cy = 399.5;
        camera->lens = Lens::kEquidistant;
    }
    rig.translation_m = {-0.1, 0, 0};
    const Rectification frame = rectification_of(rig, 800, 800);
    EXPECT_NEAR(frame.fx, 0.4 * 255, 0.025 * 255);
    EXPECT_GE(frame.fx, 0.4 * 255);
}

TEST(Rectification, RefusesCamerasThatShareNoView) {
    Random random(29);
    StereoCalibration rig = test::sample_rig(random, Lens::kPinhole, 640, 480);
    rig.left.fx = rig.left.fy = rig.right.fx = rig.right.fy = 2000;  // 18 degrees of view
    rig.rotation = test::turned(0, 0.9, 0);
    rig.translation_m = rig.rotation * Vector3{-0.1, 0, 0};
    EXPECT_THROW(rectification_of(rig, 640, 480), Refusal);
}

}  // namespace
}  // namespace groundline::rig
