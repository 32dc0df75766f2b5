// Inner loops of the coarse-to-fine census matcher, built for every vector unit.
#pragma once

#include <array>
#include <cstdint>

#include "stereo/census_kernels.hpp"
#include "stereo/pyramid.hpp"

namespace groundline::stereo::kernels {

// thin_block() and fine_block() work on blocks of so many pixels of several rows, disparity after disparity,
// pixels side by side in vectors. Rows are read from kBlockMargin before the first pixel of a block to
// kBlockMargin behind the last and must be readable there; what lies outside the image has no effect.
inline constexpr int kBlock = 64;
inline constexpr int kBlockMargin = 16;

// The narrow pairs of one row of both views, each pointing to column 0. The right one is read at x -
// min_disparity - k and must repeat its ends as far as that reaches.
struct CensusPair {
    std::uint8_t* left;
    std::uint8_t* right;
};

// Most rows of one call of thin_block().
inline constexpr int kMostThinRows = 32;
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

// The prediction of a row: what the coarse level or the thin search says.
struct Prediction {
    std::uint8_t* low;    // low byte of the disparity in 1/16 px
    std::uint8_t* index;  // index nearest to it
    Invalid* against;     // the coarse level's reason; kNone where a thin thing was found
};
struct PredictRow {
    const std::int16_t* disparity_q4;  // of the coarse level, for every two pixels
    const Invalid* invalid;
    const std::uint8_t* thin;  // index of the nearer thing, 0: none; null: nothing was searched
    int width;
    int min_disparity;
    int disparities;
};
// Writes whole blocks of all three; what is behind the last pixel repeats it. Reads kWidestVector bytes
// behind its rows.
void predict_row(const PredictRow& row, const Prediction& out);

inline constexpr int kFineRows = 8;
struct FineBlock {
    std::array<CensusPair, kFineRows + 2 * kFineWindowReach> rows;
    int first_x;  // multiple of kBlock
    int width;
    int min_disparity;
    int disparities;
    bool checks;  // pixels that something speaks against may be left out
    // For each two rows, from first_x on, whole blocks.
    std::array<Prediction, kFineRows / 2> predictions;
    // Out, from first_x on, whole blocks: the winners, without `second` and `at_right`.
    std::array<CensusWinners, kFineRows> winners;
};
void fine_block(const FineBlock& block);

// With the checks: adds the coarse level's reasons to those known of a row and fills winners.at_right by the
// pixels that nothing coarse speaks against. `keys` is scratch, `width` whole vectors.
void vote_row(int width, int disparities, const Invalid* against, const CensusWinners& winners,
              std::uint16_t* keys, Invalid* invalid);

}  // namespace groundline::stereo::kernels
