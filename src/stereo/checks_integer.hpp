// The tests that every matcher shares, stated plainly: what the fast versions must equal.
#pragma once

#include "core/disparity.hpp"
#include "core/image.hpp"
#include "stereo/checks.hpp"

namespace groundline::stereo {

// kSaturation, kTexture or kNone for the window around (x, y). `given` is the left view as it came, `matched`
// as the matcher saw it.
Invalid window_reason(ConstLuma given, ConstLuma matched, int x, int y, const CheckLimits& limits);

// What comes after all pixels are judged: patches against the views as they came, then the median if asked
// for. For tests: it allocates.
void finish_map(const DisparityMap& map, ConstLuma left, ConstLuma right, const CheckLimits& limits);

}  // namespace groundline::stereo
