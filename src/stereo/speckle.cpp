#include "stereo/speckle.hpp"

#include <cstdlib>
#include <utility>

namespace groundline::stereo {
namespace {

// A forest in one array: a root holds minus the size of its patch, every other pixel the index of a parent.
std::int32_t root_of(std::span<std::int32_t> forest, std::int32_t pixel) {
    const auto at = [&](std::int32_t i) -> std::int32_t& { return forest[static_cast<std::size_t>(i)]; };
    while (at(pixel) >= 0) {
        const std::int32_t parent = at(pixel);
        if (at(parent) < 0) return parent;
        at(pixel) = at(parent);  // halve the path
        pixel = at(pixel);
    }
    return pixel;
}

void unite(std::span<std::int32_t> forest, std::int32_t a, std::int32_t b) {
    a = root_of(forest, a);
    b = root_of(forest, b);
    if (a == b) return;
    std::int32_t& size_a = forest[static_cast<std::size_t>(a)];
    std::int32_t& size_b = forest[static_cast<std::size_t>(b)];
    if (size_a > size_b) {  // the larger patch (more negative) stays root: trees stay flat
        size_b += size_a;
        size_a = b;
    } else {
        size_a += size_b;
        size_b = a;
    }
}

}  // namespace

void remove_speckles(const DisparityMap& map, int smallest, std::span<std::int32_t> scratch) {
    const int width = map.width();
    for (int y = 0; y < map.height(); ++y) {
        const std::int16_t* disparity = map.disparity_q4.row(y);
        const Invalid* invalid = map.invalid.row(y);
        const std::int16_t* disparity_above = y > 0 ? map.disparity_q4.row(y - 1) : disparity;
        const Invalid* invalid_above = y > 0 ? map.invalid.row(y - 1) : invalid;
        const std::int32_t first = y * width;
        for (int x = 0; x < width; ++x) {
            const std::int32_t pixel = first + x;
            scratch[static_cast<std::size_t>(pixel)] = -1;
            if (invalid[x] != Invalid::kNone) continue;
            if (x > 0 && invalid[x - 1] == Invalid::kNone &&
                std::abs(disparity[x] - disparity[x - 1]) <= kDisparityOne)
                unite(scratch, pixel - 1, pixel);
            if (y > 0 && invalid_above[x] == Invalid::kNone &&
                std::abs(disparity[x] - disparity_above[x]) <= kDisparityOne)
                unite(scratch, pixel - width, pixel);
        }
    }
    for (int y = 0; y < map.height(); ++y) {
        std::int16_t* disparity = map.disparity_q4.row(y);
        Invalid* invalid = map.invalid.row(y);
        for (int x = 0; x < width; ++x) {
            if (invalid[x] != Invalid::kNone) continue;
            const std::int32_t root = root_of(scratch, y * width + x);
            if (-scratch[static_cast<std::size_t>(root)] >= smallest) continue;
            invalid[x] = Invalid::kSpeckle;
            disparity[x] = 0;
        }
    }
}

}  // namespace groundline::stereo
