// The inner loops of the paper's matcher: one row at one disparity, lanes across x, 16-bit integers.
// Pointers must not overlap except where said. Costs are int16 in 1/256 grey level, 0 .. 32256: signed, so
// that comparisons are single instructions on every processor.
#pragma once

#include <array>
#include <cstdint>

#include "stereo/paper_integer.hpp"
#include "stereo/paper_reading.hpp"

namespace groundline::stereo::kernels {

using Cost = std::int16_t;
inline constexpr Cost kNoCost = 32767;  // above every cost

// min(|left[x] - right[x - d]|, truncation); the truncation where x - d lies outside 0 .. width - 1.
void truncated_differences(const std::uint8_t* left, const std::uint8_t* right, int width, int disparity,
                           int truncation, std::uint8_t* out);

// Weighted sum of eleven rows of costs, topmost first; rows may repeat. Exact: at most 256 * 28.
void weigh_down(const std::array<const std::uint8_t*, 2 * kWindowReach + 1>& rows, const WindowTaps& taps,
                int width, std::uint16_t* out);

// floor((weighted sum of in[x - 5] .. in[x + 5] + 128) / 256). in[-5] .. in[width + 4] must be readable.
void weigh_across(const std::uint16_t* in, const WindowTaps& taps, int width, Cost* out);

// Three rows around the one in work, each readable from -1 to width.
struct Rows {
    const Cost* above;
    const Cost* here;
    const Cost* below;
};

// Rule 1. `farther` and `nearer` are the same row at the disparities before and after; at an end of the range
// both point to the one there is. `columns` has width + 2 elements.
void rule_one(RuleOne rule, const Rows& rows, const Cost* farther, const Cost* nearer, int width,
              std::uint16_t* columns, Cost* out);

// Rule 2: `costs` scaled where `looked_at` satisfies it; `costs` may be looked_at.here. `sums`: costs may be
// above 7288, where the short form of the division would be wrong.
void rule_two(RuleTwo rule, bool sums, const Rows& looked_at, const Cost* costs, int width, Cost* out);

// What is kept per pixel of the left view while disparities pass in ascending order.
struct Winners {
    Cost* best;           // lowest cost so far
    std::int16_t* index;  // at which disparity index
    // The rest serves the checks only.
    Cost* before;  // lowest cost, the last two disparities left out
    Cost* second;  // lowest cost more than one disparity away from index
    Cost* lower;   // before rule 2: at index - 1, index, index + 1
    Cost* centre;
    Cost* upper;
};

// Keeps the winner. First call with index 0 and `best` at kNoCost.
void select(const Cost* costs, int index, int width, const Winners& winners);
// The same and all the checks need. `refined` and `refined_before` are the costs before rule 2 at this and
// the disparity before. First call with index 0; best, before, second at kNoCost.
void select_with_evidence(const Cost* costs, const Cost* refined, const Cost* refined_before, int index,
                          int width, const Winners& winners);
// Keeps the winner of the right view, whose pixel x sees costs[x + disparity].
void select_right(const Cost* costs, int index, int disparity, int width, Cost* best,
                  std::int16_t* best_index);

}  // namespace groundline::stereo::kernels
