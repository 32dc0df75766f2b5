// Inner loops of the coarse-to-fine census matcher, built for every vector unit.
#pragma once

#include <array>
#include <cstdint>

#include "stereo/census_kernels.hpp"
#include "stereo/pyramid.hpp"

namespace groundline::stereo::kernels {

// Both kernels work on blocks of so many pixels of several rows, disparity after disparity, pixels side by
// side in vectors. Rows are read from kBlockMargin before the first pixel of a block to kBlockMargin behind
// the last and must be readable there; what lies outside the image has no effect.
inline constexpr int kBlock = 64;
inline constexpr int kBlockMargin = 16;

// Census words of one row of both views, each pointing to column 0. The right one is read at x -
// min_disparity - k and must repeat its ends as far as that reaches.
struct CensusPair {
    CensusRow left;
    CensusRow right;
};

// Most rows of one call of thin_block().
inline constexpr int kMostThinRows = 16;
struct ThinBlock {
    const CensusPair* rows;  // count + kThinRows - 1 sampled rows, from kThinRows / 2 above the first
    int count;
    int first_x;  // multiple of kBlock
    int width;
    int min_disparity;
    int disparities;
    const std::uint8_t* predicted;  // index predicted at each pixel, from first_x on, a whole block
    std::ptrdiff_t predicted_stride;
    std::uint8_t* nearer;  // out: index of what is to replace it, 0: nothing; a whole block is written
    std::ptrdiff_t nearer_stride;
};
void thin_block(const ThinBlock& block);

inline constexpr int kFineRows = 8;
struct FineBlock {
    std::array<CensusPair, kFineRows + 2 * kFineWindowReach> rows;
    int first_x;  // multiple of kBlock
    int width;
    int min_disparity;
    int disparities;
    // For each two rows, from first_x on: the low byte of the predicted disparity in 1/16 px, and the index
    // nearest to it; readable up to a whole block.
    std::array<const std::uint8_t*, kFineRows / 2> predicted_low;
    std::array<const std::uint8_t*, kFineRows / 2> predicted_index;
    // Out, from first_x on, whole blocks: the winners, without `second` and `at_right`.
    std::array<CensusWinners, kFineRows> winners;
};
void fine_block(const FineBlock& block);

}  // namespace groundline::stereo::kernels
