// A ray and where it is: the point at each depth.
#pragma once

#include "synth/vec3.hpp"

namespace groundline::synth {

// Camera rays have a direction whose part along the optical axis is 1, so that `depth` is the depth of stereo
// geometry.
struct Ray {
    Vec3 origin;
    Vec3 direction;
    Vec3 at(double depth) const { return origin + depth * direction; }
};

}  // namespace groundline::synth
