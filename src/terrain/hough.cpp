#include "terrain/hough.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

#include "terrain/plane_kernels.hpp"

namespace groundline::terrain {
namespace {

constexpr int kUnitsPerPixel = 16;
constexpr int kLeastRowsBelow = 3;  // histogram rows; nearer to the horizon half a bin swings a line by 10 %

// Two lines are the same ground seen twice when they differ by little both at the bottom and half-way to the
// horizon: a peak's own slopes in the accumulator must not count as a rival.
bool nearly_same(const Line& a, const Line& b, double bottom_row) {
    const double middle_row = 0.5 * (bottom_row + a.horizon_row);
    for (const double row : {bottom_row, middle_row}) {
        const double reference = a.at(row);
        const double difference = std::fabs(reference - b.at(row));
        if (difference > std::max(3.0, 0.2 * reference)) return false;
    }
    return true;
}

// Mass within `reach_px` of the line in one row.
int mass_near(const RowHistogram& histogram, const std::uint16_t* cells, double d_px, double reach_px) {
    const double centre = (d_px - histogram.first_px) * histogram.bins_per_px;
    const double reach = reach_px * histogram.bins_per_px;
    const int bins = histogram.cells.width;
    if (!(centre + reach >= 0.0) || centre - reach >= bins) return 0;
    const int first = std::max(0, static_cast<int>(std::ceil(centre - reach)));
    const int last = std::min(bins - 1, static_cast<int>(std::floor(centre + reach)));
    int mass = 0;
    for (int k = first; k <= last; ++k)
        mass += cells[k];
    return mass;
}

}  // namespace

void Hough::take(Arena& arena, int max_rows) {
    votes_ = arena.take<std::uint32_t>(static_cast<std::size_t>(kMaxHorizons) * kMaxBottoms);
    smoothed_ = arena.take<std::uint32_t>(votes_.size());
    inverse_ = arena.take<double>(static_cast<std::size_t>(max_rows));
}

Line Hough::line_of(const LineGate& gate, int horizon, int bottom) const {
    const double row = gate.horizon_first + horizon * gate.horizon_step;
    return {row, bottom * bottom_step_ / (gate.bottom_row - row)};
}

// The heaviest local maxima (mass of three bins, at least 4 pixels) of one row, heaviest first.
int Hough::strongest(const std::uint16_t* cells, int first_bin, int bins, Peaks& peaks) {
    constexpr int kLeast = 4 * kUnitsPerPixel;
    int count = 0;
    int before = 0;
    int mass = first_bin + 1 < bins ? cells[first_bin - 1] + cells[first_bin] + cells[first_bin + 1] : 0;
    for (int k = first_bin; k + 1 < bins; ++k) {
        const int after = k + 2 < bins ? cells[k] + cells[k + 1] + cells[k + 2] : 0;
        if (mass >= kLeast && mass > before && mass >= after) {
            int at = count;
            while (at > 0 && peaks[static_cast<std::size_t>(at - 1)].mass < mass)
                --at;
            if (at < kPeaksPerRow) {
                count = std::min(count + 1, kPeaksPerRow);
                for (int i = count - 1; i > at; --i)
                    peaks[static_cast<std::size_t>(i)] = peaks[static_cast<std::size_t>(i - 1)];
                peaks[static_cast<std::size_t>(at)] = {mass, k};
            }
        }
        before = mass;
        mass = after;
    }
    return count;
}

void Hough::vote(const RowHistogram& histogram, const LineGate& gate, int cap) {
    const int bins = histogram.cells.width;
    // Lines need at least one true pixel of disparity: farther is beyond any use and full of mismatches.
    const int first_bin =
        std::max(1, static_cast<int>(std::ceil((1.0 - histogram.first_px) * histogram.bins_per_px)));
    double slope_least = std::numeric_limits<double>::max();
    double slope_most = 0.0;
    for (int j = 0; j < gate.count; ++j) {
        slope_least = std::min(slope_least, gate.slope_min[static_cast<std::size_t>(j)]);
        slope_most = std::max(slope_most, gate.slope_max[static_cast<std::size_t>(j)]);
    }
    for (std::size_t k = 1; k < inverse_.size(); ++k)
        inverse_[k] = 1.0 / (static_cast<double>(k) * histogram.row_step);
    const int to_first =
        static_cast<int>(std::floor((histogram.first_row - gate.horizon_first) / histogram.row_step + 0.5));
    const double per_bottom = 1.0 / bottom_step_;
    for (int i = 0; i < histogram.cells.height; ++i) {
        const int rows_down = i + to_first;  // below the highest horizon
        const int last = std::min(gate.count - 1, (rows_down - kLeastRowsBelow) / gate.rows_per_step);
        if (rows_down < kLeastRowsBelow) continue;
        Peaks peaks;
        const int count = strongest(histogram.cells.row(i), first_bin, bins, peaks);
        for (int p = 0; p < count; ++p) {
            const Peak& peak = peaks[static_cast<std::size_t>(p)];
            const double d_px = histogram.px_of(peak.bin);
            const auto weight = static_cast<std::uint32_t>(std::min(peak.mass, cap));
            // Slopes in the gate put the horizon this many rows above.
            const double fewest = d_px / slope_most / histogram.row_step;
            const double most = d_px / slope_least / histogram.row_step;
            const int lowest =
                std::min(last, static_cast<int>(std::floor((rows_down - fewest) / gate.rows_per_step)) + 1);
            const int highest =
                std::max(0, static_cast<int>(std::floor((rows_down - most) / gate.rows_per_step)) - 1);
            for (int j = highest; j <= lowest; ++j) {
                const auto at = static_cast<std::size_t>(j);
                const double slope =
                    d_px * inverse_[static_cast<std::size_t>(rows_down - j * gate.rows_per_step)];
                if (slope > gate.slope_max[at] || slope < gate.slope_min[at]) continue;
                const double horizon = gate.horizon_first + j * gate.horizon_step;
                const double bottom = slope * (gate.bottom_row - horizon) * per_bottom + 0.5;
                if (bottom >= bottoms_) continue;
                votes_[at * kMaxBottoms + static_cast<std::size_t>(bottom)] += weight;
            }
        }
    }
}

void Hough::smooth(int horizons) {
    const auto width = static_cast<std::size_t>(bottoms_);
    for (int j = 0; j < horizons; ++j) {
        const std::uint32_t* here = &votes_[static_cast<std::size_t>(j) * kMaxBottoms];
        const std::uint32_t* above = j > 0 ? here - kMaxBottoms : nullptr;
        const std::uint32_t* below = j + 1 < horizons ? here + kMaxBottoms : nullptr;
        std::uint32_t* out = &smoothed_[static_cast<std::size_t>(j) * kMaxBottoms];
        std::uint32_t left = 0;
        const auto column = [&](std::size_t k) {
            return here[k] + (above != nullptr ? above[k] : 0U) + (below != nullptr ? below[k] : 0U);
        };
        std::uint32_t middle = column(0);
        for (std::size_t k = 0; k < width; ++k) {
            const std::uint32_t right = k + 1 < width ? column(k + 1) : 0U;
            out[k] = left + middle + right;
            left = middle;
            middle = right;
        }
    }
}

HoughResult Hough::find(const RowHistogram& histogram, const LineGate& gate, double bottom_max_px, int cap,
                        LineMode mode) {
    assert(gate.count <= kMaxHorizons);
    HoughResult result;
    bottom_step_ = std::max(0.5, bottom_max_px / (kMaxBottoms - 1));
    bottoms_ = std::min(kMaxBottoms, static_cast<int>(bottom_max_px / bottom_step_) + 1);
    for (int j = 0; j < gate.count; ++j)
        std::fill_n(&votes_[static_cast<std::size_t>(j) * kMaxBottoms], bottoms_, 0U);
    vote(histogram, gate, cap);
    smooth(gate.count);

    // The heaviest local maxima, heaviest first.
    std::array<Cell, kCandidates> candidates;
    const int count = maxima(gate.count, candidates);
    if (mode == LineMode::kLongest) {
        const double gap_rows = (gate.bottom_row + 1.0) / 40.0;
        for (int c = 0; c < count; ++c) {
            Cell& cell = candidates[static_cast<std::size_t>(c)];
            cell.length = longest_segment(histogram, line_of(gate, cell.horizon, cell.bottom), gap_rows,
                                          4 * kUnitsPerPixel);
        }
        // Stable: votes decide between equals.
        for (int c = 1; c < count; ++c)
            for (int i = c; i > 0 && candidates[static_cast<std::size_t>(i)].length >
                                         candidates[static_cast<std::size_t>(i - 1)].length;
                 --i)
                std::swap(candidates[static_cast<std::size_t>(i)],
                          candidates[static_cast<std::size_t>(i - 1)]);
    }
    for (int c = 0; c < count && result.count < HoughResult::kPeaks; ++c) {
        const Cell& cell = candidates[static_cast<std::size_t>(c)];
        const Line line = line_of(gate, cell.horizon, cell.bottom);
        bool known = false;
        for (int i = 0; i < result.count && !known; ++i)
            known = nearly_same(result.lines[static_cast<std::size_t>(i)], line, gate.bottom_row);
        if (known) continue;
        result.lines[static_cast<std::size_t>(result.count)] = line;
        result.votes[static_cast<std::size_t>(result.count)] = cell.votes;
        ++result.count;
    }
    return result;
}

int Hough::maxima(int horizons, std::array<Cell, kCandidates>& candidates) const {
    int count = 0;
    for (int j = 0; j < horizons; ++j) {
        const std::uint32_t* here = &smoothed_[static_cast<std::size_t>(j) * kMaxBottoms];
        for (int k = 1; k < bottoms_; ++k) {
            const std::uint32_t votes = here[k];
            const bool full = count == kCandidates;
            if (votes == 0 || (full && votes <= candidates[kCandidates - 1].votes)) continue;
            // Earlier neighbours win ties, so that a plateau counts once.
            if (here[k - 1] >= votes || (k + 1 < bottoms_ && here[k + 1] > votes)) continue;
            bool peak = true;
            for (int dk = -1; dk <= 1 && peak; ++dk) {
                if (k + dk >= bottoms_) continue;
                if (j > 0) peak = here[k + dk - kMaxBottoms] < votes;
                if (peak && j + 1 < horizons) peak = here[k + dk + kMaxBottoms] <= votes;
            }
            if (!peak) continue;
            int at = full ? kCandidates - 1 : count++;
            for (; at > 0 && candidates[static_cast<std::size_t>(at - 1)].votes < votes; --at)
                candidates[static_cast<std::size_t>(at)] = candidates[static_cast<std::size_t>(at - 1)];
            candidates[static_cast<std::size_t>(at)] = {j, k, votes, 0.0};
        }
    }
    return count;
}

Line refine_line(const RowHistogram& histogram, const Line& start, int cap) {
    constexpr std::array<double, 5> kTolerancesPx = {3.0, 3.0, 2.0, 1.5, 1.5};
    Line line = start;
    const double middle_row = histogram.row_of(histogram.cells.height / 2);
    for (const double tolerance : kTolerancesPx) {
        double w = 0.0, wv = 0.0, wvv = 0.0, wd = 0.0, wvd = 0.0;
        int rows = 0;
        for (int i = 0; i < histogram.cells.height; ++i) {
            const double row = histogram.row_of(i);
            const double expected = line.at(row);
            if (expected < 1.0) continue;
            const double reach = kernels::reach_px(tolerance, expected);
            const double centre = (expected - histogram.first_px) * histogram.bins_per_px;
            const double reach_bins = reach * histogram.bins_per_px;
            if (centre - reach_bins >= histogram.cells.width || centre + reach_bins < 0.0) continue;
            const int first = std::max(0, static_cast<int>(std::ceil(centre - reach_bins)));
            const int last =
                std::min(histogram.cells.width - 1, static_cast<int>(std::floor(centre + reach_bins)));
            const std::uint16_t* cells = histogram.cells.row(i);
            const double v = row - middle_row;
            bool used = false;
            for (int k = first; k <= last; ++k) {
                if (cells[k] == 0) continue;
                const double d_px = histogram.px_of(k);
                const double t = (d_px - expected) / reach;
                const double inside = 1.0 - t * t;
                if (inside <= 0.0) continue;
                const double weight = inside * inside * std::min<int>(cells[k], cap);
                w += weight;
                wv += weight * v;
                wvv += weight * v * v;
                wd += weight * d_px;
                wvd += weight * v * d_px;
                used = true;
            }
            rows += used ? 1 : 0;
        }
        const double determinant = w * wvv - wv * wv;
        if (rows < 8 || determinant <= 1e-6 * w * wvv) return start;
        const double slope = (w * wvd - wv * wd) / determinant;
        if (slope <= 0.0) return start;
        const double at_middle = (wd - slope * wv) / w;
        line = {middle_row - at_middle / slope, slope};
    }
    return line;
}

double longest_segment(const RowHistogram& histogram, const Line& line, double gap_rows, int least) {
    double longest = 0.0;
    double run_start = 0.0;  // rows run downward in index, upward in the picture: from the bottom row
    double last_supported = 0.0;
    bool in_run = false;
    for (int i = histogram.cells.height - 1; i >= 0; --i) {
        const double row = histogram.row_of(i);
        const double expected = line.at(row);
        if (expected < 1.0) break;
        const std::uint16_t* cells = histogram.cells.row(i);
        int mass = 0;
        for (int k = 0; k < histogram.cells.width; ++k)
            mass += cells[k];
        const int near = mass_near(histogram, cells, expected, 1.0);
        if (near < least || near * 10LL < mass) continue;
        if (!in_run || last_supported - row > gap_rows + histogram.row_step) run_start = row;
        in_run = true;
        last_supported = row;
        longest = std::max(longest, run_start - row + histogram.row_step);
    }
    return longest;
}

}  // namespace groundline::terrain
