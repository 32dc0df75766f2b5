#include "stereo/local_mean.hpp"

#include <algorithm>

namespace groundline::stereo {

void subtract_local_mean(ConstLuma from, Luma to, int first, int last, std::span<std::uint16_t> scratch) {
    constexpr int kReach = kLocalMeanReach;
    constexpr unsigned kPixels = (2 * kReach + 1) * (2 * kReach + 1);
    const int width = from.width;
    const auto row = [&](int y) { return from.row(std::clamp(y, 0, from.height - 1)); };
    // columns[x]: sum of the 15 rows around y, at most 15 * 255, with the border columns repeated on each
    // side.
    std::uint16_t* const padded = scratch.data();
    std::uint16_t* const columns = padded + kReach;
    for (int x = 0; x < width; ++x) {
        columns[x] = 0;
        for (int j = -kReach; j <= kReach; ++j)
            columns[x] = static_cast<std::uint16_t>(columns[x] + row(first + j)[x]);
    }
    for (int y = first; y < last; ++y) {
        if (y > first) {
            const std::uint8_t* enters = row(y + kReach);
            const std::uint8_t* leaves = row(y - kReach - 1);
            for (int x = 0; x < width; ++x)
                columns[x] = static_cast<std::uint16_t>(columns[x] + enters[x] - leaves[x]);
        }
        for (int i = 1; i <= kReach; ++i) {
            columns[-i] = columns[0];
            columns[width - 1 + i] = columns[width - 1];
        }
        unsigned sum = 0;
        for (int x = 0; x < 2 * kReach; ++x)
            sum += padded[x];
        const std::uint8_t* in = from.row(y);
        std::uint8_t* out = to.row(y);
        for (int x = 0; x < width; ++x) {
            sum += columns[x + kReach];
            const int mean = static_cast<int>((sum + kPixels / 2) / kPixels);
            out[x] = static_cast<std::uint8_t>(std::clamp(in[x] - mean + 128, 0, 255));
            sum -= columns[x - kReach];
        }
    }
}

}  // namespace groundline::stereo
