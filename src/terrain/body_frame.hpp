// The body frame (x forward, y left, along the ground) of what a pixel sees.
#pragma once

#include "core/deterministic_math.hpp"
#include "core/ground.hpp"
#include "core/rectified_rig.hpp"
#include "terrain/config.hpp"

namespace groundline::terrain {

// A pixel (u, v) at depth Z along the optical axis is at x = x_m + Z along_x(u, v), y = y_m + Z along_y(u,
// v): its foot point on the ground plane, in metres from the body's origin.
struct BodyFrame {
    double x_m = 0.0, y_m = 0.0;  // the camera
    double x_u = 0.0, x_v = 0.0, x_0 = 0.0;
    double y_u = 0.0, y_v = 0.0, y_0 = 0.0;
    double cos_yaw = 1.0, sin_yaw = 0.0;
    double cos_pitch = 1.0, sin_pitch = 0.0;
    double height_m = 0.0;

    double along_x(double u, double v) const { return x_u * u + x_v * v + x_0; }
    double along_y(double u, double v) const { return y_u * u + y_v * v + y_0; }
    // Depth of the ground's point at (x, y).
    double depth_m(double x, double y) const {
        const double forward = cos_yaw * (x - x_m) + sin_yaw * (y - y_m);
        return forward * cos_pitch + height_m * sin_pitch;
    }
};

// With n the ground's normal in camera axes (downwards): forward = z - (z n) n made unit, left = forward x n,
// both turned by the mount's yaw. The rig must be calibrated, |pitch| below 90 deg.
inline BodyFrame body_frame(const GroundPose& pose, const RectifiedRig& rig, const TerrainConfig& config) {
    BodyFrame body;
    body.x_m = config.mount_x_m;
    body.y_m = config.mount_y_m;
    body.height_m = pose.height_m;
    body.cos_yaw = det::cos(det::radians(config.mount_yaw_deg));
    body.sin_yaw = det::sin(det::radians(config.mount_yaw_deg));
    body.cos_pitch = det::cos(pose.pitch_rad);
    body.sin_pitch = det::sin(pose.pitch_rad);
    const double nx = det::sin(pose.roll_rad) * body.cos_pitch;
    const double ny = det::cos(pose.roll_rad) * body.cos_pitch;
    const double nz = body.sin_pitch;
    const double forward[3] = {-nz * nx / body.cos_pitch, -nz * ny / body.cos_pitch,
                               (1.0 - nz * nz) / body.cos_pitch};
    const double left[3] = {forward[1] * nz - forward[2] * ny, forward[2] * nx - forward[0] * nz,
                            forward[0] * ny - forward[1] * nx};
    double x[3];
    double y[3];
    for (int i = 0; i < 3; ++i) {
        x[i] = body.cos_yaw * forward[i] - body.sin_yaw * left[i];
        y[i] = body.sin_yaw * forward[i] + body.cos_yaw * left[i];
    }
    const double per_px = 1.0 / rig.focal_px;
    body.x_u = x[0] * per_px;
    body.x_v = x[1] * per_px;
    body.x_0 = x[2] - (x[0] * rig.cx_px + x[1] * rig.cy_px) * per_px;
    body.y_u = y[0] * per_px;
    body.y_v = y[1] * per_px;
    body.y_0 = y[2] - (y[0] * rig.cx_px + y[1] * rig.cy_px) * per_px;
    return body;
}

}  // namespace groundline::terrain
