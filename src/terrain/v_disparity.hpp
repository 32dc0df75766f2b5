// The v-disparity image: one histogram of disparity per image row.
#pragma once

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/parallel.hpp"
#include "core/result.hpp"

namespace groundline::terrain {

// Room for disparities min_disparity .. min_disparity + disparities px, bins of 1/4 px: finer bins gain
// nothing (pitch error 0.075 deg at 1/4 px, 0.074 at 1/8).
VDisparity make_v_disparity(Arena& arena, int height, int min_disparity, int disparities);

// Counts the valid pixels of each row, every second standing for two and sharing 32 units between its two
// nearest bins (exact: disparity_q4 divides a bin in 4). Cells saturate at 65535; disparities outside the
// bins are left out. `out` must have as many rows as the map. Pixels at disparity 0 count when they are
// valid.
void build_v_disparity(ConstDisparityMap map, VDisparity& out, Parallel& parallel);

}  // namespace groundline::terrain
