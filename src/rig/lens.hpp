// Where a ray meets the picture: the forward lens models, in deterministic arithmetic.
#pragma once

#include <optional>

#include "rig/calibration.hpp"

namespace groundline::rig {

struct Pixel {
    double u = 0.0;
    double v = 0.0;
};

// Formulas: OpenCV's calib3d (polynomial and rational model) and fisheye (equidistant) documentation.
class LensProjection {
  public:
    explicit LensProjection(const CameraModel& camera);

    // Pixel of a ray in the camera frame (x right, y down, z forward; any length). None for rays from behind
    // and for rays so far off the axis that the fitted polynomial turns back: there a distorted picture would
    // repeat itself.
    std::optional<Pixel> project(const Vector3& ray) const;

  private:
    double distorted(double radius) const;

    CameraModel camera_;
    double radius_limit_;  // tangent of the largest angle off the axis at which the model still grows
};

}  // namespace groundline::rig
