// A real uncalibrated pair of cameras: calibrated here by OpenCV, rectified by us, rows compared at the
// corners.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/arena.hpp"
#include "rig/rectifier.hpp"

namespace groundline::rig {
namespace {

const cv::Size kCorners(9, 6);
using Corners = std::vector<cv::Point2f>;

bool find_corners(const cv::Mat& image, Corners& corners) {
    if (!cv::findChessboardCorners(image, kCorners, corners)) return false;
    cv::cornerSubPix(image, corners, {5, 5}, {-1, -1},
                     {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 30, 0.01});
    return true;
}

void copy_into(const cv::Mat& image, Luma luma) {
    for (int y = 0; y < luma.height; ++y)
        std::copy_n(image.ptr(y), luma.width, luma.row(y));
}

TEST(Chessboards, RowsAgreeAfterRectification) {
    const std::filesystem::path folder = GROUNDLINE_SOURCE_DIR "/../shared/data/calib_opencv";
    if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no real pairs at " << folder;
    std::vector<std::filesystem::path> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder / "left"))
        names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());

    std::vector<cv::Point3f> board;
    constexpr float kSquareM = 0.025F;
    for (int y = 0; y < kCorners.height; ++y)
        for (int x = 0; x < kCorners.width; ++x)
            board.emplace_back(kSquareM * static_cast<float>(x), kSquareM * static_cast<float>(y), 0.0F);
    std::vector<cv::Mat> left_images, right_images;
    std::vector<Corners> left_corners, right_corners;
    for (const auto& name : names) {
        const cv::Mat left = cv::imread((folder / "left" / name).string(), cv::IMREAD_GRAYSCALE);
        const cv::Mat right = cv::imread((folder / "right" / name).string(), cv::IMREAD_GRAYSCALE);
        Corners a, b;
        if (!find_corners(left, a) || !find_corners(right, b)) continue;
        left_images.push_back(left);
        right_images.push_back(right);
        left_corners.push_back(a);
        right_corners.push_back(b);
    }
    ASSERT_GE(left_images.size(), 10U);

    const std::vector<std::vector<cv::Point3f>> boards(left_images.size(), board);
    const cv::Size size = left_images.front().size();
    cv::Mat k1, d1, k2, d2, r, t, essential, fundamental, rotations, translations;
    cv::calibrateCamera(boards, left_corners, size, k1, d1, rotations, translations);
    cv::calibrateCamera(boards, right_corners, size, k2, d2, rotations, translations);
    const double rms = cv::stereoCalibrate(boards, left_corners, right_corners, k1, d1, k2, d2, size, r, t,
                                           essential, fundamental, cv::CALIB_FIX_INTRINSIC);
    ASSERT_LT(rms, 0.5);

    StereoCalibration rig;
    const auto set_camera = [&](const cv::Mat& k, const cv::Mat& d, CameraModel& camera) {
        camera = {size.width,         size.height,        k.at<double>(0, 0), k.at<double>(1, 1),
                  k.at<double>(0, 2), k.at<double>(1, 2), Lens::kPinhole,     {}};
        std::copy_n(d.ptr<double>(), std::min<std::size_t>(d.total(), 8), camera.distortion.begin());
    };
    set_camera(k1, d1, rig.left);
    set_camera(k2, d2, rig.right);
    std::copy_n(r.ptr<double>(), 9, rig.rotation.begin());
    std::copy_n(t.ptr<double>(), 3, rig.translation_m.begin());
    Arena arena;
    const Rectifier rectifier(rig, size.width, size.height, arena);
    EXPECT_TRUE(rectifier.outside_left().empty());

    StereoFrame frame = StereoFrame::make(arena, size.width, size.height, false);
    StereoFrame out = StereoFrame::make(arena, size.width, size.height, false);
    Serial serial;
    double rows = 0.0, rows_before = 0.0, square_error = 0.0;
    int corners = 0, squares = 0;
    for (std::size_t i = 0; i < left_images.size(); ++i) {
        copy_into(left_images[i], frame.left);
        copy_into(right_images[i], frame.right);
        rectifier.rectify(frame, out.left, out.right, {}, serial);
        const auto wrapped = [](Luma luma) {
            return cv::Mat(luma.height, luma.width, CV_8U, luma.data, static_cast<std::size_t>(luma.stride));
        };
        Corners a, b;
        // The rectified view is cut to what both have: a board at the rim may be lost.
        if (!find_corners(wrapped(out.left), a) || !find_corners(wrapped(out.right), b)) continue;
        std::vector<cv::Point3d> points;
        for (std::size_t j = 0; j < a.size(); ++j) {
            rows += std::abs(a[j].y - b[j].y);
            rows_before += std::abs(left_corners[i][j].y - right_corners[i][j].y);
            ++corners;
            const RectifiedRig& view = rectifier.rig();
            const double depth = view.focal_px * view.baseline_m / (a[j].x - b[j].x - view.offset_px());
            points.emplace_back((a[j].x - view.cx_px) * depth / view.focal_px,
                                (a[j].y - view.cy_px) * depth / view.focal_px, depth);
        }
        for (std::size_t j = 0; j + 1 < points.size(); ++j)
            if ((j + 1) % static_cast<std::size_t>(kCorners.width) != 0) {
                square_error += std::abs(cv::norm(points[j + 1] - points[j]) - kSquareM) / kSquareM;
                ++squares;
            }
    }
    ASSERT_GT(corners, 5 * kCorners.area());
    RecordProperty("row_error_px", std::to_string(rows / corners));
    RecordProperty("square_error", std::to_string(square_error / squares));
    EXPECT_LT(rows / corners, 0.3) << "rows differed by " << rows_before / corners << " px before";
    EXPECT_GT(rows_before / corners, 3.0);
    // Triangulated with focal length, baseline and principal points of the rectified rig, a square measures
    // 25 mm.
    EXPECT_LT(square_error / squares, 0.03);
}

}  // namespace
}  // namespace groundline::rig
