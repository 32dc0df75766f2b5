// What goes wrong with pictures, on purpose: pure functions over views, the same bytes on every processor.
#pragma once

#include <cstdint>

#include "core/image.hpp"

namespace groundline::cli {

// In all of them `from` and `to` have the same size and do not overlap, and results are clamped to 0 .. 255.

// gain_percent / 100 * pixel + offset, halves rounded up; gain_percent >= 0.
void change_exposure(ConstLuma from, int gain_percent, int offset, Luma to);

// Adds independent noise of this standard deviation, 0 .. 255 grey levels, to every pixel: in integers, a sum
// of twelve uniform numbers, so nearly Gaussian and never beyond six deviations. The deviations of a picture
// are a function of its size and the seed, whatever its pixels.
void add_noise(ConstLuma from, int sigma, std::uint64_t seed, Luma to);
// A seed for each view of each pair that is far from every other.
std::uint64_t noise_seed(std::uint64_t repetition, std::uint64_t pair, std::uint64_t view);

// Everything lies `rows` >= 0 lower; the rows that come into view repeat the first.
void shift_down(ConstLuma from, int rows, Luma to);

// [1 4 6 4 1] / 16 across and down, halves rounded up, coordinates clamped at the border: sigma 1 px.
void blur_binomial_5x5(ConstLuma from, Luma to);

}  // namespace groundline::cli
