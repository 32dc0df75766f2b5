#include "core/ground.hpp"

#include <cmath>

#include "core/deterministic_math.hpp"

namespace groundline {

DisparityPlane plane_of(const GroundPose& pose, const RectifiedRig& rig) {
    const double cos_pitch = det::cos(pose.pitch_rad);
    const double normal_x = det::sin(pose.roll_rad) * cos_pitch;
    const double normal_y = det::cos(pose.roll_rad) * cos_pitch;
    const double normal_z = det::sin(pose.pitch_rad);
    const double scale = rig.baseline_m / pose.height_m;
    DisparityPlane plane;
    plane.du = scale * normal_x;
    plane.dv = scale * normal_y;
    plane.d0 =
        scale * (normal_z * rig.focal_px - normal_x * rig.cx_px - normal_y * rig.cy_px) + rig.offset_px();
    return plane;
}

GroundPose pose_of(const DisparityPlane& plane, const RectifiedRig& rig) {
    const double at_centre = plane.at(rig.cx_px, rig.cy_px) - rig.offset_px();
    const double along_axis = at_centre / rig.focal_px;
    const double norm = std::sqrt(plane.du * plane.du + plane.dv * plane.dv + along_axis * along_axis);
    return {det::asin(along_axis / norm), det::atan2(plane.du, plane.dv), rig.baseline_m / norm};
}

GroundPose pose_sigma(const DisparityPlane& plane, const std::array<double, 9>& covariance,
                      const RectifiedRig& rig) {
    const double at_centre = plane.at(rig.cx_px, rig.cy_px) - rig.offset_px();
    const double g = at_centre / rig.focal_px;
    const double across2 = plane.du * plane.du + plane.dv * plane.dv;
    const double norm2 = across2 + g * g;
    const double norm = std::sqrt(norm2);
    const double across = std::sqrt(across2);
    // Derivatives by (du, dv, g) first; g = (du cx + dv cy + d0 - offset) / f carries them to (du, dv, d0).
    const double pitch_by[3] = {-g * plane.du / (norm2 * across), -g * plane.dv / (norm2 * across),
                                across / norm2};
    const double roll_by[3] = {plane.dv / across2, -plane.du / across2, 0.0};
    const double height_scale = -rig.baseline_m / (norm2 * norm);
    const double height_by[3] = {height_scale * plane.du, height_scale * plane.dv, height_scale * g};
    const auto deviation = [&](const double(&by)[3]) {
        const double row[3] = {by[0] + by[2] * rig.cx_px / rig.focal_px,
                               by[1] + by[2] * rig.cy_px / rig.focal_px, by[2] / rig.focal_px};
        double variance = 0.0;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                variance += row[i] * covariance[static_cast<std::size_t>(3 * i + j)] * row[j];
        return std::sqrt(variance > 0.0 ? variance : 0.0);
    };
    return {deviation(pitch_by), deviation(roll_by), deviation(height_by)};
}

}  // namespace groundline
