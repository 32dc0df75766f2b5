// Sums of a pixel value over the 11x11 window, row by row, by running sums.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/image.hpp"
#include "stereo/paper_reading.hpp"

namespace groundline::stereo {

// Column sums needed for an image of this width, elements.
constexpr int window_sums_scratch(int width) {
    return width + 2 * kWindowReach;
}

// out[x] = sum of value(row, u) over the window around (x, y), coordinates clamped to the border; value is
// 0 .. 255. `columns` (window_sums_scratch(width) elements) carries the column sums to the next row: pass
// `fresh` for the first row and then every row in order.
template <typename Value>
void window_sums_row(ConstLuma image, int y, bool fresh, Value value, std::uint16_t* columns,
                     std::uint16_t* out) {
    constexpr int kReach = kWindowReach;
    const int width = image.width;
    const auto row = [&](int v) { return image.row(std::clamp(v, 0, image.height - 1)); };
    std::uint16_t* const middle = columns + kReach;
    if (fresh) {
        for (int x = 0; x < width; ++x) {
            middle[x] = 0;
            for (int j = -kReach; j <= kReach; ++j)
                middle[x] = static_cast<std::uint16_t>(middle[x] + value(row(y + j), x));
        }
    } else {
        const std::uint8_t* enters = row(y + kReach);
        const std::uint8_t* leaves = row(y - kReach - 1);
        for (int x = 0; x < width; ++x)
            middle[x] = static_cast<std::uint16_t>(middle[x] + value(enters, x) - value(leaves, x));
    }
    for (int i = 1; i <= kReach; ++i) {
        middle[-i] = middle[0];
        middle[width - 1 + i] = middle[width - 1];
    }
    unsigned sum = 0;
    for (int x = 0; x < 2 * kReach; ++x)
        sum += columns[x];
    for (int x = 0; x < width; ++x) {
        sum += middle[x + kReach];
        out[x] = static_cast<std::uint16_t>(sum);
        sum -= middle[x - kReach];
    }
}

}  // namespace groundline::stereo
