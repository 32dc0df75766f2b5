// Boxes, poles and rocks where they stand, and exact intersection of rays with them.
#pragma once

#include "synth/ray.hpp"
#include "synth/scene.hpp"

namespace groundline::synth {

// A thing where it stands, with what the rays need.
struct PlacedThing {
    Thing thing;
    double top_y = 0.0;
    double base_y = 0.0;  // ground where it stands
    double foot_y = 0.0;  // its lower end, under the ground
    double cos_yaw = 1.0;
    double sin_yaw = 0.0;
};

// Depth at which the ray, from outside, enters the thing, and the unit normal there. False: it misses.
bool intersect(const Ray& ray, const PlacedThing& placed, double& depth, Vec3& normal);

}  // namespace groundline::synth
