#include "rig/photometric.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace groundline::rig {
namespace {

constexpr int kLevels = 256;
constexpr int kFirstPercent = 5;
constexpr int kLastPercent = 95;
constexpr std::size_t kRanks = kLastPercent - kFirstPercent + 1;
// Bands per view: enough tasks for any small board, and 16 kB of histograms fit on the stack.
constexpr int kBands = 8;

using Histogram = std::array<std::uint32_t, kLevels>;
using Quantiles = std::array<double, kRanks>;

void count_rows(ConstLuma image, int first, int end, Histogram& histogram) {
    for (int y = first; y < end; ++y) {
        const std::uint8_t* row = image.row(y);
        for (int x = 0; x < image.width; ++x)
            ++histogram[row[x]];
    }
}

// Grey level below which `percent` of the pixels lie, with the pixels of a level spread evenly over it: the
// level alone would be too coarse to tell a gain of 1.02.
Quantiles quantiles_of(const Histogram& histogram, double pixels) {
    Quantiles values{};
    std::size_t level = 0;
    double below = 0.0;
    for (std::size_t i = 0; i < kRanks; ++i) {
        const double wanted = pixels * static_cast<double>(kFirstPercent + static_cast<int>(i)) / 100.0;
        while (level + 1 < kLevels && below + histogram[level] < wanted)
            below += histogram[level++];
        values[i] = static_cast<double>(level) - 0.5 + (wanted - below) / std::max(1U, histogram[level]);
    }
    return values;
}

double share_up_to(const Histogram& histogram, int level, double pixels) {
    double count = 0.0;
    for (int i = 0; i <= level; ++i)
        count += histogram[static_cast<std::size_t>(i)];
    return count / pixels;
}

struct Line {
    double gain = 1.0;
    double offset = 0.0;
};

// Least squares of left on right, reweighted (Tukey, 4 grey levels) so that a bright thing that only one view
// sees does not bend it. Ranks where a view is at its end of scale tell nothing about the gain.
Line fit_line(const Quantiles& left, const Quantiles& right) {
    constexpr double kCut = 4.0;
    constexpr int kRounds = 10;
    Line line;
    for (int round = 0; round < kRounds; ++round) {
        double sum = 0.0, sum_x = 0.0, sum_y = 0.0, sum_xx = 0.0, sum_xy = 0.0;
        for (std::size_t i = 0; i < kRanks; ++i) {
            const double x = right[i];
            const double y = left[i];
            if (x < 1.0 || y < 1.0 || x > 254.0 || y > 254.0) continue;
            double weight = 1.0;
            if (round > 0) {
                const double relative = (y - line.gain * x - line.offset) / kCut;
                const double rest = 1.0 - relative * relative;
                weight = rest > 0.0 ? rest * rest : 0.0;
            }
            sum += weight;
            sum_x += weight * x;
            sum_y += weight * y;
            sum_xx += weight * x * x;
            sum_xy += weight * x * y;
        }
        if (sum < 10.0) break;
        const double spread = sum_xx / sum - (sum_x / sum) * (sum_x / sum);
        // Fewer than 2 grey levels of spread cannot tell gain from offset.
        const double gain = spread > 4.0 ? (sum_xy / sum - (sum_x / sum) * (sum_y / sum)) / spread : 1.0;
        line = {gain, sum_y / sum - gain * sum_x / sum};
    }
    return line;
}

}  // namespace

PhotometricEvidence measure_photometric(ConstLuma left, ConstLuma right, Parallel& parallel) {
    std::array<Histogram, 2 * kBands> parts{};
    parallel.for_each(2 * kBands, [&](int task, int) {
        const ConstLuma& image = task < kBands ? left : right;
        const int band = task % kBands;
        count_rows(image, image.height * band / kBands, image.height * (band + 1) / kBands,
                   parts[static_cast<std::size_t>(task)]);
    });
    std::array<Histogram, 2> views{};
    for (std::size_t task = 0; task < parts.size(); ++task)
        for (std::size_t level = 0; level < kLevels; ++level)
            views[task / kBands][level] += parts[task][level];

    const double left_pixels = static_cast<double>(left.width) * left.height;
    const double right_pixels = static_cast<double>(right.width) * right.height;
    const Quantiles left_ranks = quantiles_of(views[0], left_pixels);
    const Quantiles right_ranks = quantiles_of(views[1], right_pixels);
    const Line line = fit_line(left_ranks, right_ranks);

    PhotometricEvidence evidence;
    evidence.gain = line.gain;
    evidence.offset = line.offset;
    double difference = 0.0;
    for (std::size_t i = 0; i < kRanks; ++i)
        difference += std::abs(left_ranks[i] - right_ranks[i]);
    evidence.mismatch = difference / static_cast<double>(kRanks);
    evidence.overexposed_share = std::max(views[0][255] / left_pixels, views[1][255] / right_pixels);
    evidence.dark_share = std::max(share_up_to(views[0], kDarkLevel, left_pixels),
                                   share_up_to(views[1], kDarkLevel, right_pixels));
    evidence.contrast =
        std::min(left_ranks.back() - left_ranks.front(), right_ranks.back() - right_ranks.front());
    return evidence;
}

}  // namespace groundline::rig
