// The matcher's kernels compiled without the AVX2 form, for comparison on machines that would never run them.
#pragma once

#include "stereo/paper_kernels.hpp"

namespace groundline::stereo::plain_kernels {

using kernels::Cost;
using kernels::Rows;
using kernels::Winners;

void truncated_differences(const std::uint8_t* left, const std::uint8_t* right, int width, int disparity,
                           int truncation, std::uint8_t* out);
void weigh_down(const std::array<const std::uint8_t*, 2 * kWindowReach + 1>& rows, const WindowTaps& taps,
                int width, std::uint16_t* out);
void weigh_across(const std::uint16_t* in, const WindowTaps& taps, int width, Cost* out);
void rule_one(RuleOne rule, const Rows& rows, const Cost* farther, const Cost* nearer, int width,
              std::uint16_t* columns, Cost* out);
void rule_two(RuleTwo rule, bool sums, const Rows& looked_at, const Cost* costs, int width, Cost* out);
void select(const Cost* costs, int index, int width, const Winners& winners);
void select_with_evidence(const Cost* costs, const Cost* refined, const Cost* refined_before, int index,
                          int width, const Winners& winners);
void select_right(const Cost* costs, int index, int disparity, int width, Cost* best,
                  std::int16_t* best_index);

}  // namespace groundline::stereo::plain_kernels
