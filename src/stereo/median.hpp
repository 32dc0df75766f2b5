// Smooths disparities over 3x3 without inventing any.
#pragma once

#include <cstdint>
#include <span>

#include "core/disparity.hpp"

namespace groundline::stereo {

// Replaces each valid disparity by the median of the valid ones of its 3x3 neighbourhood, itself included; of
// an even number, the lower of the two in the middle. What is valid does not change. All read the map as it
// came. `scratch` holds 2 x width elements.
void median_3x3(const DisparityMap& map, std::span<std::int16_t> scratch);

}  // namespace groundline::stereo
