#include "terrain/obstacles.hpp"

#include <algorithm>
#include <cmath>

#include "core/deterministic_math.hpp"

namespace groundline::terrain {

void obstacles_of(const FixedVector<Thing, kMaxObstacles>& things, const RectifiedRig& rig,
                  const Ground& ground, double sigma_disparity_px,
                  FixedVector<Obstacle, kMaxObstacles>& obstacles) {
    const bool metric = rig.calibrated && ground.metric;
    obstacles.clear();
    for (const Thing& thing : things) {
        Obstacle obstacle;
        obstacle.kind = thing.kind;
        obstacle.overhang = thing.overhang;
        obstacle.left = thing.left;
        obstacle.top = thing.top;
        obstacle.right = thing.right;
        obstacle.bottom = thing.bottom;
        obstacle.pixels = thing.pixels;
        obstacle.disparity_px = thing.median_px;
        if (metric) {
            const double scale = rig.focal_px * rig.baseline_m;
            obstacle.range_m = scale / std::max(thing.near_px, 1.0 / kDisparityOne);
            obstacle.range_sigma_m = obstacle.range_m * obstacle.range_m * sigma_disparity_px / scale;
            const double f = rig.focal_px;
            const double middle_px = rig.cx_px - 0.5 * (thing.left + thing.right);
            obstacle.bearing_rad = det::atan2(middle_px, f);
            obstacle.left_rad = det::atan2(rig.cx_px - (thing.left - 0.5), f);
            obstacle.right_rad = det::atan2(rig.cx_px - (thing.right + 0.5), f);
            // A pixel at depth Z is Z / f wide along the picture, and less by the bearing's cosine across it.
            const double cosine = f / std::sqrt(f * f + middle_px * middle_px);
            obstacle.width_m = (thing.right - thing.left + 1) * obstacle.range_m / f * cosine;
            obstacle.height_m = thing.ratio_high * ground.pose.height_m;
            obstacle.lowest_m = thing.ratio_low * ground.pose.height_m;
        }
        obstacles.push_back(obstacle);
    }
}

}  // namespace groundline::terrain
