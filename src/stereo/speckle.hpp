// Takes out patches of disparity too small, or too unlike in the two views, to believe.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/image.hpp"

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
        std::int32_t
            compared;        // pairs of pixels that were compared in both views, while size < kLargestJudged
        std::int32_t alike;  // those that were ordered alike
        std::int32_t seed;   // any of its pixels, y * width + x
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

// Pixels of a patch that is believed without comparing the views; noise forms patches of up to 1600.
inline constexpr int kLargestJudged = 4096;
// Of the pairs of pixels that are compared around each pixel: beside it at 2 and 4 px, and at 3 px two rows
// above and below. Level pairs alone, because a level edge looks alike at any disparity.
inline constexpr int kComparedReach = 4;
inline constexpr int kComparedRows = 2;

// What makes a patch worth believing.
struct PatchLimits {
    int smallest = 0;       // pixels; with fewer it is kSpeckle
    int alike_percent = 0;  // of its pairs that both views must order alike; with fewer it is kCost
};

// Marks the valid pixels of each patch that misses a limit. A patch is connected over left, right, upper and
// lower neighbours whose disparities differ by at most one pixel. A pair of opposite pixels around a pixel is
// ordered alike when the brighter one (or neither) is the same around its match, at the nearest whole
// disparity, in `right`; pairs that leave a picture are not compared. `left` and `right` are the views as
// they came, of the size of `map`. Time is bounded by n log n whatever the picture. Rows of `map` keep the
// padding contract; `scratch` is made for their width.
void remove_speckles(const DisparityMap& map, ConstLuma left, ConstLuma right, const PatchLimits& limits,
                     SpeckleScratch& scratch);

}  // namespace groundline::stereo
