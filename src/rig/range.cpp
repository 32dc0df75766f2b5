#include "rig/range.hpp"

#include <algorithm>
#include <limits>

#include "core/disparity.hpp"

namespace groundline::rig {

double depth_m(const RectifiedRig& rig, double disparity_px) {
    const double true_px = disparity_px - rig.offset_px();
    if (!(true_px > 0.0)) return std::numeric_limits<double>::infinity();
    return rig.focal_px * rig.baseline_m / true_px;
}

double disparity_px(const RectifiedRig& rig, double depth_m) {
    return rig.focal_px * rig.baseline_m / depth_m + rig.offset_px();
}

double depth_sigma_m(const RectifiedRig& rig, double depth_m, double disparity_sigma_px) {
    return depth_m * depth_m * disparity_sigma_px / (rig.focal_px * rig.baseline_m);
}

RangeLimits range_limits(const RectifiedRig& rig, int min_disparity, int disparities) {
    constexpr double kStep = 1.0 / kDisparityOne;
    RangeLimits limits;
    limits.near_m = depth_m(rig, min_disparity + disparities - 1);
    limits.far_m = depth_m(rig, min_disparity);
    limits.tenth_m = 0.1 * rig.focal_px * rig.baseline_m / 0.25;
    limits.step_at_tenth_m = depth_sigma_m(rig, limits.tenth_m, kStep);
    limits.step_at_5_m = depth_sigma_m(rig, 5.0, kStep);
    return limits;
}

int auto_disparities(int width, int hint) {
    const int wanted = hint > 0 ? hint : (width + 5) / 6;
    return std::clamp((std::min(wanted, 256) + 15) / 16 * 16, 32, 256);
}

}  // namespace groundline::rig
