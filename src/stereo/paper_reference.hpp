// The paper's matcher in floating point, to the letter: the yardstick for the fixed-point version.
#pragma once

#include <vector>

#include "core/image.hpp"
#include "stereo/paper_reading.hpp"

namespace groundline::stereo {

// 4 % of the maximum intensity, unrounded.
inline constexpr double kFourPercent = 10.2;

// Whole-pixel disparity of every pixel, row by row: truncated absolute differences (`truncation` grey levels
// in place of the reading's), aggregation over 11x11, both rules, the least cost wins, ties to the smaller
// disparity. Whole volume in memory, slow, allocates: for tests and evaluation. Both views of one size.
std::vector<int> match_paper_reference(ConstLuma left, ConstLuma right, int min_disparity, int disparities,
                                       const PaperReading& reading, double truncation);

}  // namespace groundline::stereo
