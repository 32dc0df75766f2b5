// What each kernel of the paper's matcher says it does, one pixel at a time.
#pragma once

#include "stereo/paper_judge.hpp"
#include "stereo/paper_kernels.hpp"

namespace groundline::stereo::plain_kernels {

using kernels::ConstCostRows;
using kernels::Cost;
using kernels::CostRows;
using kernels::Group;
using kernels::Shifted;
using kernels::Winners;

void weigh_down(const Shifted& views, int truncation, const WindowTaps& taps, CostRows out);
void weigh_across(ConstCostRows in, const WindowTaps& taps, CostRows out);
void rule_one(RuleOne rule, ConstCostRows costs, ConstCostRows farther, ConstCostRows nearer, CostRows out);
void rule_two(RuleTwo rule, ConstCostRows looked_at, ConstCostRows costs, CostRows out);
Invalid judge(const WinnerRow& winners, const SearchRange& range, const CheckLimits& limits, Invalid window,
              int x);

}  // namespace groundline::stereo::plain_kernels
