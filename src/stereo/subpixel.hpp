// Sub-pixel offset of a disparity from its cost and its neighbours' costs.
#pragma once

namespace groundline::stereo {

// Equiangular fit (two lines of equal and opposite slope), in 1/16 px:
//   (lower - upper) / (2 (max(lower, upper) - centre)) px, rounded half away from zero, -8 .. 8.
// 0 unless the centre is the lowest of the three and below one of them. Absolute differences make V-shaped
// costs, which a parabola would bend towards whole pixels.
constexpr int equiangular_q4(int lower, int centre, int upper) {
    if (centre > lower || centre > upper) return 0;
    const int depth = (lower > upper ? lower : upper) - centre;
    if (depth == 0) return 0;
    const int difference = lower - upper;
    const int magnitude = difference < 0 ? -difference : difference;
    const int offset = (16 * magnitude + depth) / (2 * depth);
    return difference < 0 ? -offset : offset;
}

}  // namespace groundline::stereo
