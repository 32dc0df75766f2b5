// Takes out patches of disparity too small to believe.
#pragma once

#include <cstdint>
#include <span>

#include "core/disparity.hpp"

namespace groundline::stereo {

// Marks as kSpeckle each valid pixel whose patch has fewer than `smallest` pixels. A patch is connected over
// left, right, upper and lower neighbours whose disparities differ by at most one pixel. `scratch` holds
// width x height elements. Time is bounded by n log n whatever the picture.
void remove_speckles(const DisparityMap& map, int smallest, std::span<std::int32_t> scratch);

}  // namespace groundline::stereo
