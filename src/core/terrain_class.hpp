// The class of a pixel of the mask. The numbers are in files and messages: they never change.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/image.hpp"

namespace groundline {

enum class TerrainClass : std::uint8_t {
    kUnknown = 0,
    kTraversable = 1,
    kObstacle = 2,  // stands above the tolerance
    kDrop = 3,      // below the ground: ditch, step down, hole
};
inline constexpr int kTerrainClasses = 4;
inline constexpr std::array<std::string_view, kTerrainClasses> kTerrainClassNames = {"unknown", "traversable",
                                                                                     "obstacle", "drop"};

using Mask = ImageView<TerrainClass>;
using ConstMask = ConstImageView<TerrainClass>;

}  // namespace groundline
