// Do the two cameras see the same brightness? Measured on the pair before any matching.
#pragma once

#include "core/evidence.hpp"
#include "core/image.hpp"
#include "core/parallel.hpp"

namespace groundline::rig {

// A pixel at or below this grey level is dark: with the usual sensor noise of 1 to 2 levels nothing is left
// to match there.
inline constexpr int kDarkLevel = 12;

// Compares the brightness ranks of the two views in 8 horizontal bands, since parallax moves things within a
// row: the quantiles at 10 % .. 90 % of each band that are not saturated, and a robust line left = gain *
// right
// + offset through them. `mismatch` is the mean |gain * right + offset - right| over the right view's
// quantiles at 5 % .. 95 %; where no line fits, the mean difference of the two views' quantiles.
// At least 240 rows are looked at. The shares of saturated and dark pixels are of the lower half of the
// picture (its last four bands), they and the contrast of the worse view. On pairs with dense truth the line
// is off by 1.4 grey levels in the mean, by up to 5 where the views see different things. Views may differ in
// size, neither may be empty. No allocation; the same on any number of lanes.
PhotometricEvidence measure_photometric(ConstLuma left, ConstLuma right, Parallel& parallel);

}  // namespace groundline::rig
