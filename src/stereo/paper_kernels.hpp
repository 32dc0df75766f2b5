// The inner loops of the paper's matcher: a band of rows at one disparity, lanes across x, 16-bit integers,
// on the best vector unit there is. Costs are int16 in 1/256 grey level, 0 .. 32256: signed, so that
// comparisons are single instructions on every processor.
#pragma once

#include <array>
#include <cstdint>

#include "core/arena.hpp"
#include "core/image.hpp"
#include "stereo/paper_integer.hpp"
#include "stereo/paper_reading.hpp"

namespace groundline::stereo::kernels {

using Cost = std::int16_t;
inline constexpr Cost kNoCost = 32767;  // above every cost

// Rows of costs whose columns outside 0 .. width - 1 exist: kernels work in whole vectors and write more
// columns than there are, and what reads a window finds the border repeated.
using CostRows = ImageView<Cost>;
using ConstCostRows = ConstImageView<Cost>;
inline constexpr int kMargin = 64;  // columns in front of and behind each row

// `left` and `right` more columns than the margin may be read.
CostRows cost_rows(Arena& arena, int width, int height, int left = 0, int right = 0);
// Rows first .. first + height - 1.
template <typename T>
ImageView<T> row_range(ImageView<T> rows, int first, int height) {
    return {rows.data + first * rows.stride, rows.width, height, rows.stride};
}

// The two views at one disparity: right.row(y)[x] is what left.row(y)[x] is compared with, 64 columns behind
// the last may be read in both. outside[x] is 255 where that lies outside the right image, else 0.
struct Shifted {
    ConstLuma left;
    ConstLuma right;
    const std::uint8_t* outside;
};

// The window's sum down the columns of min(|left - right|, truncation), the truncation where outside. Row y
// of `out` is exact from rows y .. y + 10 of the views: at most 256 * 28. Repeats five columns of border.
void weigh_down(const Shifted& views, int truncation, const WindowTaps& taps, CostRows out);

// floor((weighted sum of in[x - 5] .. in[x + 5] + 128) / 256). Repeats one column of border.
void weigh_across(ConstCostRows in, const WindowTaps& taps, CostRows out);

// Rule 1 on rows 1 .. of `costs`, one fewer at each end than there are. `farther` and `nearer` are the same
// rows as `costs` at the disparities before and after; at an end of the range both are the one there is.
// Repeats one column of border.
void rule_one(RuleOne rule, ConstCostRows costs, ConstCostRows farther, ConstCostRows nearer, CostRows out);

// Rule 2: `costs` scaled where rows 1 .. of `looked_at`, one fewer at each end than there are, satisfy it. A
// cost must be 0 where it looks at 0. `sums`: costs may be above 7288, where the short form of the division
// would be wrong. Behind the last column follows kNoCost.
void rule_two(RuleTwo rule, bool sums, ConstCostRows looked_at, ConstCostRows costs, CostRows out);

// Disparities that are selected from at one time.
inline constexpr int kGroup = 4;
using Group = std::array<ConstCostRows, kGroup>;

// What is kept per pixel of the left view while disparities pass in ascending order. Rows keep the padding
// contract.
struct Winners {
    CostRows best;                  // lowest cost so far
    ImageView<std::int16_t> index;  // at which disparity index
    // The rest serves the checks only.
    CostRows before;  // lowest cost, the last disparity left out
    CostRows second;  // lowest cost more than one disparity away from index
    CostRows lower;   // before rule 2: at index - 1, index, index + 1
    CostRows centre;
    CostRows upper;

    Winners first_rows(int height) const {
        const auto part = [&](const auto& rows) { return row_range(rows, 0, height); };
        return {part(best), part(index), part(before), part(second), part(lower), part(centre), part(upper)};
    }
};

// Keeps the winner among disparities index .. index + 3. First call with index 0 and `best` at kNoCost.
void select(const Group& costs, int index, const Winners& winners);
// The same and all the checks need. `refined` are the costs before rule 2, `refined_before` those of
// index - 1. First call with index 0; best, before, second at kNoCost.
void select_with_evidence(const Group& costs, ConstCostRows refined_before, const Group& refined, int index,
                          const Winners& winners);
// Keeps the winner of the right view, whose pixel x sees costs[x + disparity + i] of the group's i-th; there
// is kNoCost in all columns outside that this reads.
void select_right(const Group& costs, int index, int disparity, CostRows best,
                  ImageView<std::int16_t> best_index);

}  // namespace groundline::stereo::kernels
