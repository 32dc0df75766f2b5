// Do the two cameras see the same brightness? Measured on the pair before any matching.
#pragma once

#include "core/evidence.hpp"
#include "core/image.hpp"
#include "core/parallel.hpp"

namespace groundline::rig {

// A pixel at or below this grey level is dark: at 8 bits with usual sensor noise (1..2 levels) nothing is
// left to match there.
inline constexpr int kDarkLevel = 12;

// Compares the brightness ranks of the two views, which parallax hardly changes: histograms, the 91 quantiles
// at 5 % .. 95 %, and a robust line left = gain * right + offset through those that are not saturated.
// Views may differ in size, neither may be empty. No allocation; the same on any number of lanes.
// `mismatch` is the mean |left - right| of matched quantiles; shares are those of the worse view.
PhotometricEvidence measure_photometric(ConstLuma left, ConstLuma right, Parallel& parallel);

}  // namespace groundline::rig
