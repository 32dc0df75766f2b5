// Decides of each pixel's winner whether it holds, and where between whole pixels it lies.
#pragma once

#include <cstdint>

#include "core/disparity.hpp"
#include "stereo/checks.hpp"

namespace groundline::stereo {

// One row of what select_with_evidence() kept. All keep the padding contract of image.hpp.
struct WinnerRow {
    const std::int16_t* index;
    const std::int16_t* best;
    const std::int16_t* second;
    const std::int16_t* lower;
    const std::int16_t* centre;
    const std::int16_t* upper;
    const std::int16_t* index_right;  // the right view's winners; null when left-right is off
};

struct SearchRange {
    int width;  // px
    int min_disparity;
    int disparities;
    int truncation;  // of the cost, grey levels
};

// `invalid` holds what the tests of the window found and gets what the others find, in the order of
// CheckLimits; disparity_q4 gets the answers, 0 where there is none. `scratch` is one more row. All keep the
// padding contract.
void judge_winners(const WinnerRow& winners, const SearchRange& range, const CheckLimits& limits,
                   std::int16_t* scratch, Invalid* invalid, std::int16_t* disparity_q4);

}  // namespace groundline::stereo
