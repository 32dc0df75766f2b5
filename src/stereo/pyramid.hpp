// What the coarse-to-fine census matcher computes, in constants.
#pragma once

#include <cstdint>

#include "core/half_size.hpp"
#include "stereo/census.hpp"

namespace groundline::stereo {

// Coarse: the census matcher on both views halved (means of 2x2 px), over half the disparities. Its answer,
// doubled, is the prediction for 2x2 px.
//
// Thin: what is 5 px wide near the camera is 2.5 px wide there and drowns in its surroundings. So every pixel
// of every kThinStep-th row looks for a disparity at least kThinNearer px nearer than predicted, by a window
// of 3 px times kThinRows such rows (poles and trunks stand upright) and by the kNarrowPairs of the census.
// Where the best of them costs less than half of what the prediction reaches, and is good in
// itself, it becomes the prediction. At the edges of a thin thing that window sees the background as well; so
// a pixel beside one that was found follows it if its own column of the window alone prefers that.
//
// Fine: around each prediction, within kFineReachQ4, the lowest cost of a 7x7 window of narrow pairs plus the
// distance from the prediction in 1/16 px. All sixteen pairs would take off 0.4 points of bad-1 on KITTI and
// nothing of bad-3, and take half as long again. With the checks on, pixels that the coarse level has a
// reason against keep it: they are not refined and have no
// say in the left-right check. Uniqueness is judged at the coarse level alone, left-right at both, in px of
// each. The last coarse disparity stands for two, so the range edge may be the last two disparities.
inline constexpr int kThinStep = 4;
inline constexpr int kThinRows = 8;
inline constexpr int kThinNearer = 4;
inline constexpr int kThinPredictedWithin = 2;  // px around the prediction that count as predicted
inline constexpr int kThinHighest = 57;         // of 192 bits: 30 percent differ
inline constexpr int kFineReachQ4 = 16;
inline constexpr int kFineWindowReach = 3;

// The search range of the coarse level: covers min_disparity .. min_disparity + disparities - 1, halved.
struct CoarseRange {
    int min_disparity;
    int disparities;
};
constexpr CoarseRange coarse_range(int min_disparity, int disparities) {
    const int first = min_disparity >> 1;
    const int count = ((min_disparity + disparities - 1) >> 1) - first + 1;
    return {first, (count + 15) / 16 * 16};
}

}  // namespace groundline::stereo
