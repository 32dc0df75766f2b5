// A view at half its size.
#pragma once

#include "core/half_size.hpp"
#include "core/image.hpp"

namespace groundline::stereo {

// Rows `first` to `last` - 1 of `half`, which is halved() as large as `view`: each pixel is the mean of the
// 2x2 px it stands for, (a + b + c + d + 2) >> 2; the last column and row repeat where the size is odd.
void halve_rows(ConstLuma view, int first, int last, Luma half);

}  // namespace groundline::stereo
