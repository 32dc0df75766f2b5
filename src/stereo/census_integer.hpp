// The census matcher in integers, stated plainly: what the fast version must equal bit for bit.
#pragma once

#include <cstdint>
#include <vector>

#include "core/disparity.hpp"
#include "core/image.hpp"
#include "stereo/matcher.hpp"
#include "stereo/paper_integer.hpp"

namespace groundline::stereo {

// The census word of every pixel, row by row.
std::vector<std::uint16_t> census_words(ConstLuma image);

// 2 x the number of bits in which left(x) and right(x - d) differ, x - d clamped to the image; d =
// min_disparity + k. 0 .. 32.
CostVolume census_costs(ConstLuma left, ConstLuma right, int min_disparity, int disparities);
// Weighted 1 2 1 over rows, then over columns, by mean_up(mean_up(before, after), here); clamped to the
// image.
CostVolume smoothed_121(const CostVolume& costs);
// Sums of the three path costs L(left to right) + L(right to left) + L(top down within the band), at most
// 255. Along a path, with p the pixel before and m the lowest L(p, .):
//   L(k) = C(k) + min(L(p, k), L(p, k - 1) + kSmallStep, L(p, k + 1) + kSmallStep, m + kLargeStep) - m,
// C(k) at its start (Hirschmueller 2008, eq. 13; each L is at most 32 + kLargeStep).
CostVolume path_sums(const CostVolume& costs);

// The whole matcher: the same result as make_matcher(config, ...)->match(), from whole volumes.
void match_census_integer(const MatcherConfig& config, ConstLuma left, ConstLuma right,
                          const DisparityMap& out);

// The coarse level of the pyramid, on views already halved: every pixel is answered, in absolute disparities
// of the halved views; a reason beside it says what speaks against the answer. Windows and speckles are not
// judged.
void search_coarse_integer(const MatcherConfig& config, ConstLuma left, ConstLuma right,
                           const DisparityMap& out);

}  // namespace groundline::stereo
