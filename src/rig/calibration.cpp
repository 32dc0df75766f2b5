#include "rig/calibration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/error.hpp"

namespace groundline::rig {
namespace {

constexpr double kLeastBaseline = 0.001;
constexpr double kMostBaseline = 5.0;
constexpr double kRotationTolerance = 2e-3;  // files round to as few as three digits
// Between a given rectification and the pose it was made from: 0.3 degrees, 2 % of the baseline.
constexpr double kGivenRotationTolerance = 5e-3;
constexpr double kGivenBaselineTolerance = 0.02;

template <typename Range>
bool all_finite(const Range& values) {
    return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
}

class Check {
  public:
    explicit Check(const StereoCalibration& calibration) : calibration_(calibration) {}

    void camera(const CameraModel& camera, const char* side, int width, int height) const {
        if (!all_finite(std::array{camera.fx, camera.fy, camera.cx, camera.cy}) ||
            !all_finite(camera.distortion))
            refuse(fmt::format("the {} camera has a value that is not a finite number", side));
        if (camera.fx <= 0.0 || camera.fy <= 0.0)
            refuse(fmt::format("the {} camera's focal length is {} x {} px, expected positive numbers", side,
                               camera.fx, camera.fy));
        if (camera.width != 0 || camera.height != 0) {
            if (camera.width != width || camera.height != height)
                refuse(
                    fmt::format("the {} camera was calibrated for pictures of {} x {}, but they are {} x {}; "
                                "use the calibration made for this size",
                                side, camera.width, camera.height, width, height));
        }
        const double off_u = std::abs(camera.cx - 0.5 * (width - 1));
        const double off_v = std::abs(camera.cy - 0.5 * (height - 1));
        const bool size_unknown = camera.width == 0 && camera.height == 0;
        if (size_unknown && (off_u > 0.25 * width || off_v > 0.25 * width))
            refuse(fmt::format(
                "the {} camera's principal point ({:.1f}, {:.1f}) is more than a quarter of "
                "the width off the middle of pictures of {} x {}; was it calibrated for another size?",
                side, camera.cx, camera.cy, width, height));
    }

    void baseline(double baseline_m) const {
        if (!std::isfinite(baseline_m)) refuse("the baseline is not a finite number");
        if (std::abs(baseline_m) < kLeastBaseline)
            refuse(fmt::format("the baseline is {} m, expected at least {} m between the cameras",
                               std::abs(baseline_m), kLeastBaseline));
        if (std::abs(baseline_m) > kMostBaseline)
            refuse(
                fmt::format("the baseline is {:.4g} m, expected at most {} m; lengths must be in metres, so "
                            "divide them by 1000 if they are in millimetres or multiply by the size of a "
                            "board square if they are counted in squares",
                            baseline_m, kMostBaseline));
        if (baseline_m < 0.0)
            refuse("the right camera stands to the left of the left one; exchange the cameras");
    }

    void rectified_pair() const {
        const CameraModel& left = calibration_.left;
        const CameraModel& right = calibration_.right;
        if (std::abs(left.fx - right.fx) > 0.005 * left.fx || std::abs(left.fy - right.fy) > 0.005 * left.fy)
            refuse(fmt::format(
                "the focal lengths {} and {} px of the two views differ, expected a rectified pair", left.fx,
                right.fx));
        if (std::abs(left.cy - right.cy) > 1.0)
            refuse(fmt::format("the middle rows {} and {} of the two views differ, expected a rectified pair",
                               left.cy, right.cy));
    }

    void pose() const {
        if (!is_rotation(calibration_.rotation))
            refuse("the rotation between the cameras is not a rotation matrix");
        // Where the right camera stands and looks, seen from the left one.
        const Matrix3 back = transposed(calibration_.rotation);
        const Vector3 centre = back * Vector3{-calibration_.translation_m[0], -calibration_.translation_m[1],
                                              -calibration_.translation_m[2]};
        if (std::abs(centre[1]) > std::abs(centre[0]))
            refuse("the cameras stand one above the other, expected side by side");
        if (std::abs(centre[2]) > std::abs(centre[0]))
            refuse("the cameras stand one behind the other, expected side by side");
        if (calibration_.rotation[8] < 0.5)
            refuse("the cameras look more than 60 degrees apart, expected the same way");
        baseline(centre[0] < 0.0 ? -norm(centre) : norm(centre));
    }

    void given(const GivenRectification& given) const {
        if (!is_rotation(given.rotation_left) || !is_rotation(given.rotation_right))
            refuse("a rectifying rotation (R1, R2) is not a rotation matrix");
        const auto& left = given.projection_left;
        const auto& right = given.projection_right;
        if (!all_finite(left) || !all_finite(right))
            refuse("a projection (P1, P2) has a value that is not a finite number");
        for (const auto& p : {left, right}) {
            if (p[0] <= 0.0 || p[5] <= 0.0 || p[1] != 0.0 || p[4] != 0.0 || p[8] != 0.0 || p[9] != 0.0 ||
                p[10] != 1.0)
                refuse("a projection (P1, P2) is not of the form f 0 cx a / 0 f cy b / 0 0 1 c with f > 0");
        }
        if (std::abs(left[0] - right[0]) > 1e-3 * left[0] || std::abs(left[5] - right[5]) > 1e-3 * left[5] ||
            std::abs(left[6] - right[6]) > 0.1)
            refuse(
                "the projections P1 and P2 differ in focal length or middle row, expected a horizontal pair");
        if (std::abs(right[7] - left[7]) > std::abs(right[3] - left[3]))
            refuse("P2 belongs to cameras one above the other, expected side by side");
        const double baseline_m = (left[3] - right[3]) / left[0];
        baseline(baseline_m);
        const double distance_m = norm(calibration_.translation_m);
        if (std::abs(baseline_m - distance_m) > kGivenBaselineTolerance * distance_m)
            refuse(
                fmt::format("the baseline is {:.4g} m in P2 but {:.4g} m in T; rectify again or remove R1 R2 "
                            "P1 P2, then they are computed here",
                            baseline_m, distance_m));
        const Matrix3 turned = given.rotation_right * calibration_.rotation * transposed(given.rotation_left);
        const Vector3 axis = given.rotation_right * normalised(calibration_.translation_m);
        if (distance(turned, kIdentity3) > kGivenRotationTolerance ||
            std::abs(axis[1]) > kGivenRotationTolerance || std::abs(axis[2]) > kGivenRotationTolerance)
            refuse(
                "R1 and R2 do not make the rows of the two cameras parallel; rectify again or remove R1 R2 "
                "P1 P2, then they are computed here");
    }

    [[noreturn]] void refuse(const std::string& what) const {
        const std::string& source = calibration_.source;
        throw Refusal(ExitStatus::kConfig,
                      fmt::format("{}: {}", source.empty() ? "calibration" : source, what));
    }

  private:
    const StereoCalibration& calibration_;
};

}  // namespace

bool is_rotation(const Matrix3& matrix) {
    return all_finite(matrix) && distance(matrix * transposed(matrix), kIdentity3) <= kRotationTolerance &&
           determinant(matrix) > 0.0;
}

void require_usable(const StereoCalibration& calibration, int width, int height) {
    const Check check(calibration);
    if (width < 2 || height < 2 || width > 32767 || height > 32767)
        check.refuse(fmt::format("pictures of {} x {} cannot be rectified", width, height));
    check.camera(calibration.left, "left", width, height);
    check.camera(calibration.right, "right", width, height);
    if (!all_finite(calibration.translation_m))
        check.refuse("the translation between the cameras has a value that is not a finite number");
    if (calibration.rectified) {
        check.rectified_pair();
        check.baseline(-calibration.translation_m[0]);
        return;
    }
    check.pose();
    if (calibration.rectification) check.given(*calibration.rectification);
}

}  // namespace groundline::rig
