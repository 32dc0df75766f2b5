// The ground line: a Hough transform over the horizon row and the disparity at the bottom row.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/image.hpp"
#include "terrain/config.hpp"

namespace groundline::terrain {

// A v-disparity histogram with the meaning of its axes: row i is image row first_row + i row_step, bin k is
// true disparity first_px + k / bins_per_px; a pixel counts 16 units.
struct RowHistogram {
    ImageView<std::uint16_t> cells;
    double first_row = 0.0;
    double row_step = 1.0;
    double first_px = 0.0;
    double bins_per_px = 4.0;

    double row_of(int i) const { return first_row + i * row_step; }
    double px_of(double bin) const { return first_px + bin / bins_per_px; }
};

// Lines d = slope (v - horizon_row), the picture of a plane without roll.
struct Line {
    double horizon_row = 0.0;
    double slope = 0.0;  // px per row
    double at(double v) const { return slope * (v - horizon_row); }
};

// The lines that are possible: horizon rows horizon_first + j horizon_step and, for each, slopes. Horizons
// lie on rows of the histogram: a step is rows_per_step of them.
struct LineGate {
    double horizon_first = 0.0;
    double horizon_step = 2.0;
    int rows_per_step = 1;
    int count = 0;
    double bottom_row = 0.0;  // where lines are told apart
    std::span<double> slope_min;
    std::span<double> slope_max;
};

// The best lines, best first, none nearly the same as another.
struct HoughResult {
    static constexpr int kPeaks = 5;
    int count = 0;
    std::array<Line, kPeaks> lines{};
    std::array<double, kPeaks> votes{};
};

// Votes, a row's strongest maxima each for every line of the gate through it: any number of rows, bounded
// time. Voting with the 6 strongest gives the same pose as with every cell, 3 to 30 times faster.
class Hough {
  public:
    static constexpr int kPeaksPerRow = 6;
    static constexpr int kMaxHorizons = 96;
    static constexpr int kMaxBottoms = 256;

    // For histograms of at most max_rows rows about a picture of that height.
    void take(Arena& arena, int max_rows);

    // `cap` is the most one maximum votes, in units of the histogram, so that a wall's cell cannot outvote
    // many rows of ground. Lines whose disparity at the bottom row exceeds bottom_max_px are not considered.
    // `longest` chooses by supported segment instead of votes.
    HoughResult find(const RowHistogram& histogram, const LineGate& gate, double bottom_max_px, int cap,
                     LineMode mode);

  private:
    static constexpr int kCandidates = 64;
    struct Cell {
        int horizon;
        int bottom;
        std::uint32_t votes;
        double length;  // of the supported segment, where asked for
    };

    struct Peak {
        int mass;
        int bin;
    };
    using Peaks = std::array<Peak, kPeaksPerRow>;

    void vote(const RowHistogram& histogram, const LineGate& gate, int cap);
    static int strongest(const std::uint16_t* cells, int first_bin, int bins, Peaks& peaks);
    void smooth(int horizons);
    int maxima(int horizons, std::array<Cell, kCandidates>& candidates) const;
    Line line_of(const LineGate& gate, int horizon, int bottom) const;

    std::span<std::uint32_t> votes_;     // [horizon][bottom], rows of kMaxBottoms
    std::span<std::uint32_t> smoothed_;  // sums of 3 x 3
    std::span<double> inverse_;          // [k] 1 / (k row_step)
    int bottoms_ = 0;
    double bottom_step_ = 0.5;
};

// Tukey-weighted least squares on the cells about `line` (tolerances 3, 2, 1.5 px; a cell weighs at most
// `cap`). Leaves the line as it was where fewer than 8 rows take part.
Line refine_line(const RowHistogram& histogram, const Line& line, int cap);

// Rows from the first to the last of the longest run of supported rows, in image rows; a row is supported
// when at least a tenth of its mass and `least` units are within 1 px of the line; gaps up to gap_rows are
// bridged. The measure of the paper's "longest line segment".
double longest_segment(const RowHistogram& histogram, const Line& line, double gap_rows, int least);

}  // namespace groundline::terrain
