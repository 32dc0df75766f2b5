// The two tests of the left view's 11x11 window, over- or under-exposed and flat, row by row by running sums.
#pragma once

#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/image.hpp"
#include "stereo/checks.hpp"

namespace groundline::stereo {

// Sums down the columns of the window, carried from row to row: one for each running task.
struct WindowColumns {
    WindowColumns() = default;
    WindowColumns(int width, Arena& arena);

    std::span<std::uint8_t> saturated;
    std::span<std::uint16_t> texture;
};

// out[x] = kSaturation where more than limits.saturated_percent of the window of `given` around (x, y) is 0
// or 255; else kTexture where the sum of |I(x) - I(x-1)| over the window of `matched` is below
// limits.texture; else kNone. The window repeats the border; so does I(x-1). `given` is the left view as
// given, `matched` the one that is matched, of the same size, or the same. Pass `fresh` for the first row and
// then every row in order. All rows, `out` too, keep the padding contract.
void judge_windows(ConstLuma given, ConstLuma matched, int y, bool fresh, const CheckLimits& limits,
                   const WindowColumns& columns, Invalid* out);

}  // namespace groundline::stereo
