// The census matcher's inner loops, built for every vector unit; the processor picks at run time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/disparity.hpp"
#include "stereo/census.hpp"

namespace groundline::stereo::kernels {

// Widest vector of any unit, bytes: what memory is padded to.
inline constexpr int kWidestVector = 64;

// Widest vector that costs are held in, bytes. Not wider with AVX-512: a path waits for the lowest cost of
// the pixel before, which takes longer to find in one vector of 64 bytes than in two of 32 (1.16 times the
// time at 64 disparities).
inline constexpr int kCostVector = 32;

// Bytes that the costs of one pixel take: all disparities, whole vectors.
constexpr int cost_bytes(int disparities) {
    return (disparities + kCostVector - 1) / kCostVector * kCostVector;
}

// Census words of one row, low and high bytes apart. Where high is null only the low bytes are wanted.
struct CensusRow {
    std::uint8_t* low;
    std::uint8_t* high;
};

// rows[j] points to pixel 0 of the row kCensusReachY above to kCensusReachY below; kCensusReachX pixels
// before it and kCensusReachX + kWidestVector behind the last are read. Writes up to kWidestVector bytes
// behind the last word. `mirrored`: the rows run from right to left, the words come out in the rows' order.
void census_row(const std::array<const std::uint8_t*, 2 * kCensusReachY + 1>& rows, int width, bool mirrored,
                const CensusRow& out);

// out[i] = in[width - 1 - i].
void mirror_row(const std::uint8_t* in, int width, std::uint8_t* out);

// Of each pixel of one row: the winning disparity's index, its sum, and the sums beside it.
struct CensusWinners {
    std::uint8_t* index;
    std::uint8_t* best;
    std::uint8_t* lower;   // at index - 1; meaningless for index 0
    std::uint8_t* upper;   // at index + 1; meaningless for the last index
    std::uint8_t* second;  // lowest sum more than one disparity away; null: not wanted
    // best << 8 | 255 - index of the best left winner that points to a right pixel, at [x - index +
    // disparities - 1]; 0xFFFF where none points to.
    std::uint16_t* at_right;
};

// One row of the matcher. Costs lie pixel by pixel, cost_bytes(disparities) each.
struct CensusStep {
    int width;
    int disparities;
    CensusRow left;       // census of the row below the matched one (of the last row: itself)
    CensusRow right;      // the same, mirrored: byte j belongs to x - d = width - 1 - j + (what the caller
                          // shifts); read at [width - 1 - x + k]
    std::uint8_t* above;  // costs of the row above before smoothing; the row below's replace them
    const std::uint8_t* here;
    std::uint8_t* down;       // path from above: in of the row above, out of this row
    std::uint8_t* down_best;  // the lowest of each pixel
    std::uint8_t* smoothed;   // scratch
    std::uint8_t* sums;       // scratch
    bool start;               // the path from above starts here
    bool answer;              // false: only the path from above is wanted
};

// The costs before smoothing of the row whose census is in step.left and step.right.
void census_costs_row(const CensusStep& step, std::uint8_t* out);
// Smoothing, the three paths, the winners.
void census_step(const CensusStep& step, const CensusWinners& winners);

// What census_answer_row() needs to know beyond the winners of the row.
struct CensusAnswer {
    int width;  // at most kMostCensusWidth
    int min_disparity;
    int disparities;
    bool subpixel;
    bool checks;             // false: every pixel is answered, `invalid` need not be filled
    bool keep;               // answers stay beside reasons; otherwise they are 0 there
    int uniqueness_percent;  // as in CheckLimits; -1 off
    int left_right_px;       // as in CheckLimits; -1 off
    std::uint8_t* at_right;  // scratch, one row
};
// Turns winners into disparities in 1/16 px and reasons. `invalid` comes with the reasons that are known
// already, which stay. Writes up to kWidestVector bytes behind both rows.
void census_answer_row(const CensusAnswer& how, const CensusWinners& winners, std::int16_t* disparity_q4,
                       Invalid* invalid);
inline constexpr int kMostCensusWidth = 16384;

}  // namespace groundline::stereo::kernels
