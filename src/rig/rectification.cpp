#include "rig/rectification.hpp"

#include <cmath>
#include <optional>

#include "core/error.hpp"
#include "rig/lens.hpp"

namespace groundline::rig {
namespace {

Rectification from_given(const GivenRectification& given) {
    const auto& left = given.projection_left;
    const auto& right = given.projection_right;
    Rectification out;
    out.rotation_left = given.rotation_left;
    out.rotation_right = given.rotation_right;
    out.fx = left[0];
    out.fy = left[5];
    out.cx_left = left[2];
    out.cx_right = right[2];
    out.cy = left[6];
    out.baseline_m = (left[3] - right[3]) / left[0];
    return out;
}

// Where the middle of a picture goes in the common frame. Distortion is left out: it is smallest here, and
// any principal point is a valid one.
Vector3 middle_ray(const CameraModel& camera, const Matrix3& rotation, int width, int height) {
    const Vector3 ray = rotation * Vector3{(0.5 * (width - 1) - camera.cx) / camera.fx,
                                           (0.5 * (height - 1) - camera.cy) / camera.fy, 1.0};
    return {ray[0] / ray[2], ray[1] / ray[2], 1.0};
}

class Zoom {
  public:
    Zoom(const StereoCalibration& calibration, const Rectification& frame, int width, int height)
        : left_(calibration.left), right_(calibration.right), frame_(frame), width_(width), height_(height) {
        const Vector3 a = middle_ray(calibration.left, frame.rotation_left, width, height);
        const Vector3 b = middle_ray(calibration.right, frame.rotation_right, width, height);
        middle_x_ = 0.5 * (a[0] + b[0]);
        middle_y_ = 0.5 * (a[1] + b[1]);
    }

    Rectification at(double focal) const {
        Rectification out = frame_;
        out.fx = out.fy = focal;
        out.cx_left = out.cx_right = 0.5 * (width_ - 1) - focal * middle_x_;
        out.cy = 0.5 * (height_ - 1) - focal * middle_y_;
        return out;
    }

    // Does every pixel of the border, or every `step`-th, have a source in both views? Then so has the
    // inside: within the lens model's limits the map is continuous and one to one.
    bool covered(double focal, int step) const {
        const Rectification view = at(focal);
        for (int x = 0; x < width_; x += step)
            if (!has_source(view, x, 0) || !has_source(view, x, height_ - 1)) return false;
        for (int y = 0; y < height_; y += step)
            if (!has_source(view, 0, y) || !has_source(view, width_ - 1, y)) return false;
        return has_source(view, width_ - 1, 0) && has_source(view, width_ - 1, height_ - 1);
    }

  private:
    bool has_source(const Rectification& view, int x, int y) const {
        const Vector3 ray = {(x - view.cx_left) / view.fx, (y - view.cy) / view.fy, 1.0};
        return inside(left_.project(transposed(view.rotation_left) * ray)) &&
               inside(right_.project(transposed(view.rotation_right) * ray));
    }
    bool inside(const std::optional<Pixel>& pixel) const {
        return pixel && pixel->u >= 0.0 && pixel->u <= width_ - 1.0 && pixel->v >= 0.0 &&
               pixel->v <= height_ - 1.0;
    }

    LensProjection left_;
    LensProjection right_;
    Rectification frame_;
    int width_;
    int height_;
    double middle_x_ = 0.0;
    double middle_y_ = 0.0;
};

}  // namespace

Rectification rectification_of(const StereoCalibration& calibration, int width, int height) {
    if (calibration.rectification) return from_given(*calibration.rectification);

    const Matrix3 back = transposed(calibration.rotation);
    const Vector3& t = calibration.translation_m;
    const Vector3 centre = back * Vector3{-t[0], -t[1], -t[2]};  // of the right camera in the left frame
    const Vector3 x_axis = normalised(centre);
    const Vector3 axes = {back[2], back[5], back[8] + 1.0};  // sum of the two optical axes
    const double along = dot(axes, x_axis);
    const Vector3 z_axis =
        normalised({axes[0] - along * x_axis[0], axes[1] - along * x_axis[1], axes[2] - along * x_axis[2]});
    const Vector3 y_axis = cross(z_axis, x_axis);

    Rectification frame;
    frame.rotation_left = {x_axis[0], x_axis[1], x_axis[2], y_axis[0], y_axis[1],
                           y_axis[2], z_axis[0], z_axis[1], z_axis[2]};
    frame.rotation_right = frame.rotation_left * back;
    frame.baseline_m = norm(centre);

    const Zoom zoom(calibration, frame, width, height);
    const double mean =
        0.25 * (calibration.left.fx + calibration.left.fy + calibration.right.fx + calibration.right.fy);
    constexpr int kCoarse = 8;  // every 8th pixel of the border is enough until the last loop
    double covered = 6.0 * mean;
    if (!zoom.covered(covered, kCoarse))
        throw Refusal(ExitStatus::kConfig,
                      calibration.source +
                          ": no rectified view lies within both pictures; check the rotation "
                          "between the cameras and the distortion of their lenses");
    // Outwards in steps of 2 %: a bisection from the start could land where a lens model has turned back.
    const double least = 0.4 * mean;
    double open = covered;
    while (open > least && zoom.covered(open, kCoarse)) {
        covered = open;
        open *= 0.98;
    }
    for (int halving = 0; halving < 20 && open > least; ++halving) {
        const double middle = 0.5 * (covered + open);
        (zoom.covered(middle, kCoarse) ? covered : open) = middle;
    }
    while (!zoom.covered(covered, 1))
        covered *= 1.0005;
    return zoom.at(covered);
}

}  // namespace groundline::rig
