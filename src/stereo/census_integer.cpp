#include "stereo/census_integer.hpp"

#include <algorithm>
#include <bit>
#include <cstdlib>

#include "stereo/census.hpp"
#include "stereo/checks_integer.hpp"
#include "stereo/pyramid.hpp"
#include "stereo/subpixel.hpp"

namespace groundline::stereo {
namespace {

template <typename F>
void for_each_cost(const CostVolume& volume, F f) {
    for (int y = 0; y < volume.height; ++y)
        for (int x = 0; x < volume.width; ++x)
            for (int k = 0; k < volume.disparities; ++k)
                f(x, y, k);
}

// One step along a path, from (px, py) to (x, y).
void step(const CostVolume& costs, CostVolume& path, int px, int py, int x, int y) {
    const int count = costs.disparities;
    int lowest = 255;
    for (int k = 0; k < count; ++k)
        lowest = std::min<int>(lowest, path.at(px, py, k));
    for (int k = 0; k < count; ++k) {
        int from = std::min<int>(path.at(px, py, k), lowest + kLargeStep);
        if (k > 0) from = std::min(from, path.at(px, py, k - 1) + kSmallStep);
        if (k + 1 < count) from = std::min(from, path.at(px, py, k + 1) + kSmallStep);
        path.at(x, y, k) = static_cast<std::uint16_t>(costs.at(x, y, k) + from - lowest);
    }
}

}  // namespace

std::vector<std::uint16_t> census_words(ConstLuma image) {
    std::vector<std::uint16_t> words;
    const auto at = [&](int x, int y) {
        return image.at(std::clamp(x, 0, image.width - 1), std::clamp(y, 0, image.height - 1));
    };
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            unsigned word = 0;
            for (std::size_t i = 0; i < kCensusPairs.size(); ++i) {
                const auto [dx, dy] = kCensusPairs[i];
                if (at(x + dx, y + dy) < at(x - dx, y - dy)) word |= 1U << i;
            }
            words.push_back(static_cast<std::uint16_t>(word));
        }
    return words;
}

CostVolume census_costs(ConstLuma left, ConstLuma right, int min_disparity, int disparities) {
    CostVolume costs(left.width, left.height, disparities);
    const std::vector<std::uint16_t> left_words = census_words(left);
    const std::vector<std::uint16_t> right_words = census_words(right);
    const auto index = [&](int x, int y) {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(left.width) +
               static_cast<std::size_t>(std::clamp(x, 0, left.width - 1));
    };
    for_each_cost(costs, [&](int x, int y, int k) {
        const unsigned differing =
            static_cast<unsigned>(left_words[index(x, y)] ^ right_words[index(x - min_disparity - k, y)]);
        costs.at(x, y, k) = static_cast<std::uint16_t>(2 * std::popcount(differing));
    });
    return costs;
}

CostVolume smoothed_121(const CostVolume& costs) {
    CostVolume down = costs;
    for_each_cost(costs, [&](int x, int y, int k) {
        down.at(x, y, k) = static_cast<std::uint16_t>(
            mean_up(mean_up(costs.clamped(x, y - 1, k), costs.clamped(x, y + 1, k)), costs.at(x, y, k)));
    });
    CostVolume result = down;
    for_each_cost(costs, [&](int x, int y, int k) {
        result.at(x, y, k) = static_cast<std::uint16_t>(
            mean_up(mean_up(down.clamped(x - 1, y, k), down.clamped(x + 1, y, k)), down.at(x, y, k)));
    });
    return result;
}

CostVolume path_sums(const CostVolume& costs) {
    const int width = costs.width;
    const int height = costs.height;
    CostVolume rightwards = costs;
    CostVolume leftwards = costs;
    for (int y = 0; y < height; ++y)
        for (int i = 1; i < width; ++i) {
            step(costs, rightwards, i - 1, y, i, y);
            step(costs, leftwards, width - i, y, width - 1 - i, y);
        }
    CostVolume sums = costs;
    CostVolume down = costs;
    for (int number = 0; number < band_count(height); ++number) {
        const Band band = band_of(height, number);
        for (int y = band.start; y < band.last; ++y)
            for (int x = 0; x < width; ++x) {
                if (y == band.start)
                    for (int k = 0; k < costs.disparities; ++k)
                        down.at(x, y, k) = costs.at(x, y, k);
                else
                    step(costs, down, x, y - 1, x, y);
                if (y < band.first) continue;
                for (int k = 0; k < costs.disparities; ++k)
                    sums.at(x, y, k) = static_cast<std::uint16_t>(
                        std::min(255, rightwards.at(x, y, k) + leftwards.at(x, y, k) + down.at(x, y, k)));
            }
    }
    return sums;
}

namespace {

// `coarse`: answers stay beside reasons, windows and speckles are not judged.
void match(const MatcherConfig& config, bool coarse, ConstLuma left, ConstLuma right,
           const DisparityMap& out) {
    const int last = config.disparities - 1;
    const CostVolume sums =
        path_sums(smoothed_121(census_costs(left, right, config.min_disparity, config.disparities)));
    const auto winner = [&](int x, int y) {
        int best = 0;
        for (int k = 1; k <= last; ++k)
            if (sums.at(x, y, k) < sums.at(x, y, best)) best = k;
        return best;
    };
    // The winner, among the left pixels whose own winner points to this right pixel, with the lowest sum; of
    // equals the nearest. At least one points there when this is asked.
    const auto winner_at_right = [&](int match, int y) {
        int best = -1;
        int lowest = 256;
        for (int k = last; k >= 0; --k) {
            const int x = match + config.min_disparity + k;
            if (x < 0 || x >= left.width || winner(x, y) != k || sums.at(x, y, k) >= lowest) continue;
            best = k;
            lowest = sums.at(x, y, k);
        }
        return best;
    };
    const CheckLimits& limits = config.limits;
    const auto judge = [&](int x, int y, int k) {
        const Invalid seen = coarse ? Invalid::kNone : window_reason(left, left, x, y, limits);
        if (seen != Invalid::kNone) return seen;
        const int match = x - config.min_disparity - k;
        if (match <= 0 || match >= left.width) return Invalid::kBorder;
        if (k == last) return Invalid::kRangeEdge;
        if (limits.uniqueness_percent >= 0) {
            int second = 255;
            for (int other = 0; other <= last; ++other)
                if (std::abs(other - k) > 1) second = std::min<int>(second, sums.at(x, y, other));
            const int best = sums.at(x, y, k);
            if (second == best || 100 * second < (100 + limits.uniqueness_percent) * best)
                return Invalid::kUniqueness;
        }
        if (limits.left_right_px >= 0 && std::abs(winner_at_right(match, y) - k) > limits.left_right_px)
            return Invalid::kLeftRight;
        return Invalid::kNone;
    };
    for (int y = 0; y < left.height; ++y)
        for (int x = 0; x < left.width; ++x) {
            const int k = winner(x, y);
            int disparity_q4 = kDisparityOne * (config.min_disparity + k);
            if (limits.subpixel && k > 0 && k < last)
                disparity_q4 += equiangular_q4(sums.at(x, y, k - 1), sums.at(x, y, k), sums.at(x, y, k + 1));
            const Invalid invalid = config.checks ? judge(x, y, k) : Invalid::kNone;
            out.disparity_q4.at(x, y) =
                static_cast<std::int16_t>(coarse || invalid == Invalid::kNone ? disparity_q4 : 0);
            out.invalid.at(x, y) = invalid;
        }
    if (config.checks && !coarse) finish_map(out, left, right, limits);
}

}  // namespace

void match_census_integer(const MatcherConfig& config, ConstLuma left, ConstLuma right,
                          const DisparityMap& out) {
    match(resolved(config), false, left, right, out);
}

void search_coarse_integer(const MatcherConfig& config, ConstLuma left, ConstLuma right,
                           const DisparityMap& out) {
    MatcherConfig halved_config = resolved(config);
    const CoarseRange range = coarse_range(config.min_disparity, config.disparities);
    halved_config.min_disparity = range.min_disparity;
    halved_config.disparities = range.disparities;
    halved_config.limits.subpixel = true;
    match(halved_config, true, left, right, out);
}

}  // namespace groundline::stereo
