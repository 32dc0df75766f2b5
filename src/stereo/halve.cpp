#include "stereo/halve.hpp"

#include <algorithm>
#include <cassert>

namespace groundline::stereo {

void halve_rows(ConstLuma view, int first, int last, Luma half) {
    assert(half.same_size(halved(view.width), halved(view.height)));
    const int pairs = view.width / 2;
    for (int y = first; y < last; ++y) {
        const std::uint8_t* above = view.row(2 * y);
        const std::uint8_t* below = view.row(std::min(2 * y + 1, view.height - 1));
        std::uint8_t* out = half.row(y);
        for (int x = 0; x < pairs; ++x)
            out[x] = static_cast<std::uint8_t>(
                (above[2 * x] + above[2 * x + 1] + below[2 * x] + below[2 * x + 1] + 2) >> 2);
        if (view.width % 2 != 0)
            out[pairs] =
                static_cast<std::uint8_t>((2 * above[view.width - 1] + 2 * below[view.width - 1] + 2) >> 2);
    }
}

}  // namespace groundline::stereo
