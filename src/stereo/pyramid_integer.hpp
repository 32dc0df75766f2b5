// The coarse-to-fine census matcher in integers, stated plainly: what the fast version must equal.
#pragma once

#include <cstdint>
#include <vector>

#include "core/disparity.hpp"
#include "core/image.hpp"
#include "stereo/matcher.hpp"

namespace groundline::stereo {

// Mean of 2x2 px, halves rounded up; the last column and row repeat where the size is odd.
void halve(ConstLuma image, Luma half);

// The whole matcher: the same result as make_matcher(config, ...)->match().
void match_pyramid_integer(const MatcherConfig& config, ConstLuma left, ConstLuma right,
                           const DisparityMap& out);

}  // namespace groundline::stereo
