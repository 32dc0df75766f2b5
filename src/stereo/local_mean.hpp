// Takes the local mean out of an image, so that cameras of different brightness can be compared.
#pragma once

#include <cstdint>
#include <span>

#include "core/image.hpp"

namespace groundline::stereo {

inline constexpr int kLocalMeanReach = 7;  // to each side: a window of 15x15

// Column sums needed for an image of this width, elements.
constexpr int local_mean_scratch(int width) {
    return width + 2 * kLocalMeanReach;
}

// Rows first .. last - 1 of  to = clamp(from - mean + 128, 0, 255),  mean = floor((sum + 112) / 225) over the
// 15x15 window, coordinates clamped at the border. Exact; the same for any split into rows. `from` and `to`
// have the same size and must not overlap; `scratch` holds local_mean_scratch(width) elements.
void subtract_local_mean(ConstLuma from, Luma to, int first, int last, std::span<std::uint16_t> scratch);

}  // namespace groundline::stereo
