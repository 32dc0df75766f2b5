// The ground as a plane in disparity space, and its exact relation to camera pitch, roll and height.
#pragma once

#include <array>
#include <cstdint>

#include "core/rectified_rig.hpp"

namespace groundline {

// Ground disparity at pixel (u, v) of the rectified left image, measured: du u + dv v + d0, in px.
struct DisparityPlane {
    double du = 0.0;
    double dv = 0.0;
    double d0 = 0.0;
    double at(double u, double v) const { return du * u + dv * v + d0; }
};

// Pitch positive nose down; roll positive when the ground normal leans to the right of the image
// (n = (sin roll cos pitch, cos roll cos pitch, sin pitch) in camera axes x right, y down, z forward).
struct GroundPose {
    double pitch_rad = 0.0;
    double roll_rad = 0.0;
    double height_m = 0.0;
};

// What one frame says about the ground.
struct Ground {
    bool found = false;
    DisparityPlane plane;
    // Covariance of (du, dv, d0), row-major; zero where not found.
    std::array<double, 9> covariance{};
    bool metric = false;  // pose and sigmas hold: the rig is calibrated
    GroundPose pose;
    GroundPose sigma;
};

// algorithm: d_g(u,v) = (b/h) (n_x (u-cx) + n_y (v-cy) + n_z f) + offset. The rig must be calibrated, h > 0.
DisparityPlane plane_of(const GroundPose& pose, const RectifiedRig& rig);
// Its inverse: with (alpha, beta, gamma) the plane about the principal point and without the offset,
// N = sqrt(alpha^2 + beta^2 + (gamma/f)^2); h = b/N, pitch = asin(gamma/(f N)), roll = atan2(alpha, beta).
// The plane must not be all zero.
GroundPose pose_of(const DisparityPlane& plane, const RectifiedRig& rig);

// One sigma of pitch, roll and height from the covariance of (du, dv, d0), by the Jacobian of pose_of.
GroundPose pose_sigma(const DisparityPlane& plane, const std::array<double, 9>& covariance,
                      const RectifiedRig& rig);

// Height above the ground of a point with disparity d where the ground has d_g, both without the offset
// (true disparities, d > 0): H = h (1 - d_g/d), exact at any pitch and roll. Same unit as h.
constexpr double height_above_ground(double height, double d_ground_px, double d_px) {
    return height * (1.0 - d_ground_px / d_px);
}

}  // namespace groundline
