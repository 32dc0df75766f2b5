// What the census matchers compute, in constants: the sample pairs, the path costs, the bands.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace groundline::stereo {

// Centre-symmetric census of 16 bits over a 9x7 window: bit i is set iff I(x + dx, y + dy) < I(x - dx, y -
// dy), coordinates clamped to the border. Sixteen of the window's 31 pairs, spread like a chessboard: the
// other fifteen cost as much again and gain 0.2 points of bad-1 on KITTI.
struct SamplePair {
    int dx;
    int dy;
};
// The first eight stay within 2 px to the side: what a thing 5 px wide contains.
inline constexpr std::array<SamplePair, 16> kCensusPairs = {{{1, 0},
                                                             {2, 0},
                                                             {-1, 1},
                                                             {0, 1},
                                                             {1, 1},
                                                             {-2, 2},
                                                             {0, 2},
                                                             {2, 2},
                                                             {4, 0},
                                                             {-3, 1},
                                                             {3, 1},
                                                             {-4, 2},
                                                             {4, 2},
                                                             {-2, 3},
                                                             {0, 3},
                                                             {2, 3}}};
inline constexpr unsigned kNarrowPairs = 0xFF;  // bits of the census word
inline constexpr int kCensusReachX = 4;
inline constexpr int kCensusReachY = 3;

// Costs of a step of one disparity and of a larger one along a path, where the cost of a pixel is 0 .. 32.
// From (10, 40) to (12, 72) Middlebury is alike (bad-1 6.6 to 6.7 %). KITTI takes larger ones (bad-3 6.7 % at
// (10, 40), 5.4 at (10, 60), 4.9 at (10, 90)), thin obstacles smaller ones.
inline constexpr int kSmallStep = 10;
inline constexpr int kLargeStep = 60;

// The picture is cut into bands of rows that do not know of each other, so that up to four threads share the
// work with the same result. The path from above enters a band kWarmUpRows rows before it. Against one band,
// KITTI's bad-3 rises by 0.05 points.
inline constexpr int kMostBands = 4;
inline constexpr int kLeastBandRows = 32;
inline constexpr int kWarmUpRows = 8;

struct Band {
    int start;  // first row of the path from above
    int first;  // first row answered
    int last;   // one behind the last row answered
};
constexpr int band_count(int height) {
    return std::clamp(height / kLeastBandRows, 1, kMostBands);
}
constexpr Band band_of(int height, int number) {
    const int count = band_count(height);
    const int first = height * number / count;
    return {std::max(0, first - kWarmUpRows), first, height * (number + 1) / count};
}

// The mean of two costs, halves rounded up: what every vector unit has for bytes.
constexpr int mean_up(int a, int b) {
    return (a + b + 1) >> 1;
}

}  // namespace groundline::stereo
