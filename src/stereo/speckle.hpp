// Takes out patches of disparity too small to believe.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"

namespace groundline::stereo {

// Memory of remove_speckles(): two rows of runs, the patches they belong to, and the runs of small patches,
// about 100 bytes a column.
struct SpeckleScratch {
    // Pixels of one row, a bit each, and its runs: neighbours in the row that belong together.
    struct Row {
        std::span<std::uint64_t> valid;
        std::span<std::uint64_t> joined;  // to the left neighbour
        std::span<std::uint64_t> first;   // of its run
        std::span<std::int32_t> rank;     // runs that begin before each word of `first`
        std::span<std::int32_t> patch;    // of each run
        int runs = 0;
    };
    struct Patch {
        std::int32_t parent;  // itself, or the patch it was found to be part of
        std::int32_t size;
        std::int32_t seed;  // any of its pixels, y * width + x
        std::int32_t last_row;
        std::int32_t head;  // list of its runs; kNoList when it is large, or `runs` were used up
        std::int32_t tail;
    };
    struct Run {
        std::int32_t next;
        std::int32_t y;
        std::int32_t first;
        std::int32_t last;
    };
    static constexpr std::int32_t kNoList = -1;

    SpeckleScratch() = default;
    SpeckleScratch(int width, Arena& arena);

    std::array<Row, 2> rows;
    std::span<std::uint64_t> like_right;  // disparity like that of the right neighbour
    std::span<std::uint64_t> like_above;
    std::span<std::int32_t> last;  // column of each run of the current row
    std::span<Patch> patches;
    std::span<std::int32_t> unused;  // indices of patches
    std::span<Run> runs;
    std::int32_t unused_run = 0;  // list of them
};

// Marks as kSpeckle each valid pixel whose patch has fewer than `smallest` pixels. A patch is connected over
// left, right, upper and lower neighbours whose disparities differ by at most one pixel. Time is bounded by
// n log n whatever the picture. Rows of `map` keep the padding contract; `scratch` is made for their width.
void remove_speckles(const DisparityMap& map, int smallest, SpeckleScratch& scratch);

}  // namespace groundline::stereo
