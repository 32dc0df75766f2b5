// How much of a mask each class covers.
#pragma once

#include <array>

#include "core/terrain_class.hpp"

namespace groundline::terrain {

// Share of the mask's pixels in each class; all 0 for a mask without pixels.
void shares_of(ConstMask mask, std::array<double, kTerrainClasses>& share);

}  // namespace groundline::terrain
