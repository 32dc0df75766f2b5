#include "rig/photometric.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace groundline::rig {
namespace {

constexpr std::size_t kLevels = 256;
// Enough to keep sky and ground apart, few enough that 16 kB of histograms fit on the stack; 16 or 32 bands
// are only 0.05 grey levels better.
constexpr int kBands = 8;
// Rows looked at, at least: all of a small picture, every second at VGA, which changes the gain of real pairs
// by 0.003 at most and saves half the time.
constexpr int kLeastRows = 240;
constexpr int kRanksPerBand = 17;  // 10 %, 15 % .. 90 %

class Histogram {
  public:
    void add_rows(ConstLuma image, int first, int end, int step) {
        for (int y = first; y < end; y += step) {
            const std::uint8_t* row = image.row(y);
            for (int x = 0; x < image.width; ++x)
                ++counts_[row[x]];
            pixels_ += static_cast<std::uint32_t>(image.width);
        }
    }
    void add(const Histogram& other) {
        for (std::size_t level = 0; level < kLevels; ++level)
            counts_[level] += other.counts_[level];
        pixels_ += other.pixels_;
    }
    bool empty() const { return pixels_ == 0; }
    // Grey level below which `percent` of the pixels lie, the pixels of a level spread evenly over it: whole
    // levels would be too coarse to tell a gain of 1.02. From -0.5 to 255.5.
    double quantile(double percent) const {
        const double wanted = pixels_ * percent / 100.0;
        std::size_t level = 0;
        double below = 0.0;
        while (level + 1 < kLevels && below + counts_[level] < wanted)
            below += counts_[level++];
        return static_cast<double>(level) - 0.5 + (wanted - below) / std::max(1U, counts_[level]);
    }
    double share_within(std::size_t first, std::size_t last) const {
        double count = 0.0;
        for (std::size_t level = first; level <= last; ++level)
            count += counts_[level];
        return count / pixels_;
    }

  private:
    std::array<std::uint32_t, kLevels> counts_{};
    std::uint32_t pixels_ = 0;
};

// Brightness of one rank in both views.
struct Match {
    double left;
    double right;
    double weight;
};

class Matches {
  public:
    // Ranks where a view is near an end of its scale tell nothing about the gain and are left out.
    void add_band(const Histogram& left, const Histogram& right) {
        constexpr double kLowest = 3.0;
        constexpr double kHighest = 250.0;
        for (int rank = 0; rank < kRanksPerBand; ++rank) {
            const double percent = 10.0 + 5.0 * rank;
            const Match match = {left.quantile(percent), right.quantile(percent), 0.0};
            if (std::min(match.left, match.right) < kLowest || std::max(match.left, match.right) > kHighest)
                continue;
            // What only one view sees shifts the ranks; between two brightnesses of which there is little in
            // the picture that moves a quantile far.
            const double spacing = std::max(left.quantile(percent + 3.0) - left.quantile(percent - 3.0),
                                            right.quantile(percent + 3.0) - right.quantile(percent - 3.0));
            matches_[count_++] = {match.left, match.right, 1.0 / (1.0 + 0.1 * spacing * spacing)};
        }
    }

    struct Line {
        bool found = false;
        double gain = 1.0;
        double offset = 0.0;
    };

    // Least squares reweighted by Tukey's function, whose reach narrows from 32 to 8 grey levels.
    Line fit() const {
        constexpr int kWideRounds = 10;
        constexpr int kRounds = 30;
        // Of all weight: with less, the line would speak for a small part of the picture.
        constexpr double kLeastSupport = 0.3;
        Line line;
        double all = 0.0;
        for (std::size_t i = 0; i < count_; ++i)
            all += matches_[i].weight;
        for (int round = 0; round < kRounds; ++round) {
            const double reach = round < kWideRounds ? 32.0 : 8.0;
            double sum = 0.0, sum_x = 0.0, sum_y = 0.0, sum_xx = 0.0, sum_xy = 0.0;
            for (std::size_t i = 0; i < count_; ++i) {
                const double x = matches_[i].right;
                const double y = matches_[i].left;
                double weight = matches_[i].weight;
                if (round > 0) {
                    const double relative = (y - line.gain * x - line.offset) / reach;
                    const double rest = std::max(0.0, 1.0 - relative * relative);
                    weight *= rest * rest;
                }
                sum += weight;
                sum_x += weight * x;
                sum_y += weight * y;
                sum_xx += weight * x * x;
                sum_xy += weight * x * y;
            }
            if (sum <= kLeastSupport * all) return {};
            const double mean_x = sum_x / sum;
            const double mean_y = sum_y / sum;
            const double spread = sum_xx / sum - mean_x * mean_x;
            // Less than 2 grey levels of spread cannot tell gain from offset.
            line.gain = spread > 4.0 ? (sum_xy / sum - mean_x * mean_y) / spread : 1.0;
            line.offset = mean_y - line.gain * mean_x;
            line.found = true;
        }
        return line;
    }

  private:
    std::array<Match, static_cast<std::size_t>(kBands* kRanksPerBand)> matches_{};
    std::size_t count_ = 0;
};

}  // namespace

PhotometricEvidence measure_photometric(ConstLuma left, ConstLuma right, Parallel& parallel) {
    std::array<Histogram, kBands> left_bands;
    std::array<Histogram, kBands> right_bands;
    parallel.for_each(2 * kBands, [&](int task, int) {
        const ConstLuma& image = task < kBands ? left : right;
        const int band = task % kBands;
        (task < kBands ? left_bands : right_bands)[static_cast<std::size_t>(band)].add_rows(
            image, image.height * band / kBands, image.height * (band + 1) / kBands,
            std::max(1, image.height / kLeastRows));
    });
    Histogram left_all;
    Histogram right_all;
    Histogram left_lower;
    Histogram right_lower;
    Matches matches;
    for (std::size_t band = 0; band < kBands; ++band) {
        left_all.add(left_bands[band]);
        right_all.add(right_bands[band]);
        if (band >= kBands / 2) {
            left_lower.add(left_bands[band]);
            right_lower.add(right_bands[band]);
        }
        if (!left_bands[band].empty() && !right_bands[band].empty())
            matches.add_band(left_bands[band], right_bands[band]);
    }
    const Matches::Line line = matches.fit();

    PhotometricEvidence evidence;
    evidence.gain = line.gain;
    evidence.offset = line.offset;
    double difference = 0.0;
    constexpr int kFirst = 5;
    constexpr int kLast = 95;
    for (int percent = kFirst; percent <= kLast; ++percent) {
        const double grey = right_all.quantile(percent);
        difference +=
            std::abs((line.found ? line.gain * grey + line.offset : left_all.quantile(percent)) - grey);
    }
    evidence.mismatch = difference / (kLast - kFirst + 1);
    evidence.overexposed_share =
        std::max(left_lower.share_within(255, 255), right_lower.share_within(255, 255));
    evidence.dark_share =
        std::max(left_lower.share_within(0, kDarkLevel), right_lower.share_within(0, kDarkLevel));
    evidence.contrast = std::min(left_all.quantile(kLast) - left_all.quantile(kFirst),
                                 right_all.quantile(kLast) - right_all.quantile(kFirst));
    return evidence;
}

}  // namespace groundline::rig
