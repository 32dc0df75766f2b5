// The tests a disparity must pass to count as an answer, and their limits.
#pragma once

namespace groundline::stereo {

// Every limit can be switched off alone. A pixel that fails gets the reason of the first test it fails, in
// the order: saturation, texture, border, range edge, cost, uniqueness, left-right, speckle.
//
// The defaults were chosen on 14 KITTI 2012 frames (128 disparities, local mean removed): share off by more
// than 3 px among the answered, at which density. Nothing tested 27.0 % at 99.8 %; left-right alone 10.6 at
// 71.4; left-right and speckle 2.8 at 61.3; all defaults 1.5 at 52.3.
struct CheckLimits {
    // Refine to 1/16 px by the equiangular fit to the costs before rule 2. Not a test.
    bool subpixel = true;
    // Most percent of the 11x11 window of the left view (as given, before normalisation) at 0 or 255.
    // 100 switches off. The limits 10, 25 and 50 differ by 0.2 points of error and 2 of density.
    int saturated_percent = 25;
    // Least sum of |I(x) - I(x-1)| over the 11x11 window of the left view as matched, grey levels.
    // 0 switches off. Half a grey level a pixel takes out only what is as good as flat; noise is left to the
    // other tests. 121 gives 1.47 % at 50.6 %, and costs 5 points of density on an indoor floor.
    int texture = 60;
    // Highest best cost (before rule 2), percent of the truncation. 100 switches off. At 80, windows that
    // agree with nothing; 70 begins to take right answers (-2.4 points of density for 0.4 of error). Judges
    // a reading with kSum9 nine times too strictly: switch it off there.
    int cost_percent = 80;
    // The best cost outside d* - 1 .. d* + 1 must exceed the best by this many percent of it and by this
    // floor, 1/256 grey level; a tie always fails. A negative percentage switches both off. 10 gives 1.2 %
    // at 44 % density, 0 gives 1.9 at 58.9.
    int uniqueness_percent = 5;
    int uniqueness_floor = 0;
    // Most |d_left - d_right| between the two views' own winners, px. Negative switches off.
    // 0 gives 0.9 % at 43 %, 2 gives 1.8 at 53.5.
    int left_right_px = 1;
    // Smallest patch to believe, px; neighbours (left, right, upper, lower) belong together when their
    // disparities differ by at most 1 px. 0 switches off. 200 gives 1.3 % at 50.6 % but takes out things of
    // 14x14 px, 100 those of 10x10.
    int speckle_px = 100;
    // Smooth the answers that are left by median_3x3(). Not a test. Off: it takes out thin things.
    bool median = false;
};

}  // namespace groundline::stereo
