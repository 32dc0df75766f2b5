// The tests a disparity must pass to count as an answer, and their limits.
#pragma once

namespace groundline::stereo {

// Every limit can be switched off alone. A pixel that fails gets the reason of the first test it fails, in
// the order: saturation, texture, border, range edge, cost, uniqueness, left-right, speckle; a patch that
// fails alike_percent counts as cost.
//
// Chosen on 14 KITTI 2012 frames: share off by more than 3 px among the answered, at which density. The paper
// (128 disparities, local mean removed): nothing tested 27.0 % at 99.8 %; left-right alone 10.6 at 71.4;
// left-right and speckle 2.8 at 61.3; all defaults 1.5 at 52.3. The census pyramid (208 disparities): nothing
// tested 5.3 % at 99.9 %; all defaults 3.6 at 95.5. Where no matcher is named, figures are the paper's.
struct CheckLimits {
    // Refine to 1/16 px by the equiangular fit to the costs before rule 2. Not a test.
    bool subpixel = true;
    // What a limit says where it is left to the matcher.
    static constexpr int kMatchersOwn = -2;
    // Most percent of the 11x11 window of the left view (as given, before normalisation) at 0 or 255.
    // 100 switches off. The matcher's own: 25 for the paper (10, 25 and 50 differ by 0.2 points of error and
    // 2 of density), 75 for census, whose paths carry over what is left of a window: as much error as at 25,
    // and 1.9 points more density; what lies wholly in the glare has no answer still.
    int saturated_percent = kMatchersOwn;
    // Least sum of |I(x) - I(x-1)| over the 11x11 window of the left view as matched, grey levels.
    // 0 switches off. Half a grey level a pixel takes out only what is as good as flat; noise is left to the
    // other tests. 121 gives 1.47 % at 50.6 %, and costs 5 points of density on an indoor floor.
    int texture = 60;
    // Highest best cost (before rule 2), percent of the truncation. 100 switches off. At 80, windows that
    // agree with nothing; 70 begins to take right answers (-2.4 points of density for 0.4 of error). Judges
    // a reading with kSum9 nine times too strictly: switch it off there. Paper only.
    int cost_percent = 80;
    // The best cost outside d* - 1 .. d* + 1 must exceed the best by this many percent of it and by this
    // floor, 1/256 grey level; a tie always fails. -1 switches both off. The matcher's own: 5 for the paper
    // (10 gives 1.2 % at 44 % density, 0 gives 1.9 at 58.9), off for census (5 would give the pyramid 3.5 %
    // at 95.2 %, and census 2.7 at 92.3 where it has 3.0 at 93.5).
    int uniqueness_percent = kMatchersOwn;
    int uniqueness_floor = 0;  // paper only
    // Most |d_left - d_right| between the two views' own winners, px. Negative switches off.
    // 0 gives 0.9 % at 43 %, 2 gives 1.8 at 53.5.
    int left_right_px = 1;
    // Smallest patch to believe, px; neighbours (left, right, upper, lower) belong together when their
    // disparities differ by at most 1 px. 0 switches off. 200 gives 1.3 % at 50.6 % but takes out things of
    // 14x14 px, 100 those of 10x10.
    int speckle_px = 100;
    // Of the level pairs of pixels around each pixel of a patch: least percent that both views order alike,
    // so that noise matched in a plain sky is no answer. 0 switches off. On rendered noise such patches have
    // 43 (99 of 100 at most 51, all at most 57). At 54, 0 to 1.6 % of the answers on KITTI fall, in one frame
    // 7.7 % which are sky; of those with truth half are off by more than 3 px. 58 takes 0.4 points more of
    // the obstacles there. Patches of kLargestJudged pixels and more are not judged.
    int alike_percent = 54;
    // Smooth the answers that are left by median_3x3(). Not a test. Off: it takes out thin things.
    bool median = false;
};

inline bool judges_patches(const CheckLimits& limits) {
    return limits.speckle_px > 0 || limits.alike_percent > 0;
}

}  // namespace groundline::stereo
