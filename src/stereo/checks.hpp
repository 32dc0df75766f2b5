// The tests a disparity must pass to count as an answer, and their limits.
#pragma once

namespace groundline::stereo {

// Every limit can be switched off alone. A pixel that fails gets the reason of the first test it fails, in
// the order: saturation, texture, border, range edge, cost, uniqueness, left-right, speckle.
struct CheckLimits {
    // Refine to 1/16 px by the equiangular fit to the costs before rule 2. Not a test.
    bool subpixel = true;
    // Most percent of the 11x11 window of the left view (as given, before normalisation) at 0 or 255.
    // 100 switches off. A quarter of the window leaves the others to decide.
    int saturated_percent = 25;
    // Least sum of |I(x) - I(x-1)| over the 11x11 window of the left view as matched, grey levels.
    // 0 switches off.
    int texture = 182;
    // Highest best cost (before rule 2), percent of the truncation. 100 switches off.
    int cost_percent = 80;
    // The best cost outside d* - 1 .. d* + 1 must exceed the best by this many percent of it and by this
    // floor, 1/256 grey level; a tie always fails unless uniqueness_percent is negative, which switches off.
    int uniqueness_percent = 10;
    int uniqueness_floor = 0;
    // Most |d_left - d_right| between the two views' own winners, px. Negative switches off.
    int left_right_px = 1;
    // Smallest patch to believe, px; neighbours (left, right, up, down) belong together when their
    // disparities differ by at most 1 px. 0 switches off.
    int speckle_px = 100;
};

}  // namespace groundline::stereo
