#include "stereo/median.hpp"

#include <algorithm>
#include <array>

namespace groundline::stereo {

void median_3x3(const DisparityMap& map, std::span<std::int16_t> scratch) {
    const int width = map.width();
    const int height = map.height();
    // The rows above and here as they came; the row below is still untouched in the map.
    std::int16_t* above = scratch.data();
    std::int16_t* here = above + width;
    for (int y = 0; y < height; ++y) {
        std::copy_n(map.disparity_q4.row(y), width, here);
        const std::array<const std::int16_t*, 3> rows = {above, here,
                                                         y + 1 < height ? map.disparity_q4.row(y + 1) : here};
        const int first_row = y > 0 ? 0 : 1;
        const int last_row = y + 1 < height ? 2 : 1;
        for (int x = 0; x < width; ++x) {
            if (map.invalid.row(y)[x] != Invalid::kNone) continue;
            std::array<std::int16_t, 9> sorted{};
            int count = 0;
            for (int row = first_row; row <= last_row; ++row) {
                const Invalid* invalid = map.invalid.row(y + row - 1);
                for (int u = std::max(x - 1, 0); u <= std::min(x + 1, width - 1); ++u) {
                    if (invalid[u] != Invalid::kNone) continue;
                    const std::int16_t value = rows[static_cast<std::size_t>(row)][u];
                    int place = count++;
                    for (; place > 0 && sorted[static_cast<std::size_t>(place - 1)] > value; --place)
                        sorted[static_cast<std::size_t>(place)] = sorted[static_cast<std::size_t>(place - 1)];
                    sorted[static_cast<std::size_t>(place)] = value;
                }
            }
            map.disparity_q4.row(y)[x] = sorted[static_cast<std::size_t>((count - 1) / 2)];
        }
        std::swap(above, here);
    }
}

}  // namespace groundline::stereo
