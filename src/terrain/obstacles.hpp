// From things in the picture to obstacles in metres.
#pragma once

#include "core/fixed_vector.hpp"
#include "core/ground.hpp"
#include "core/rectified_rig.hpp"
#include "core/result.hpp"
#include "terrain/components.hpp"

namespace groundline::terrain {

// One obstacle for each thing, in their order. Metres, ranges and bearings where the rig is calibrated and
// the ground metric, else 0. sigma_disparity_px: deviation of a pixel's disparity.
void obstacles_of(const FixedVector<Thing, kMaxObstacles>& things, const RectifiedRig& rig,
                  const Ground& ground, double sigma_disparity_px,
                  FixedVector<Obstacle, kMaxObstacles>& obstacles);

}  // namespace groundline::terrain
