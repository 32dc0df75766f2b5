#include "stereo/paper_integer.hpp"

#include <algorithm>
#include <cstdlib>

#include "core/arena.hpp"
#include "stereo/checks_integer.hpp"
#include "stereo/local_mean.hpp"
#include "stereo/subpixel.hpp"

namespace groundline::stereo {
namespace {

template <typename Function>
void for_each_cost(const CostVolume& volume, Function function) {
    for (int k = 0; k < volume.disparities; ++k)
        for (int y = 0; y < volume.height; ++y)
            for (int x = 0; x < volume.width; ++x)
                function(x, y, k);
}

bool near(int other, int cost) {
    return 2 * std::abs(other - cost) < cost;
}

int best_of_left(const CostVolume& costs, int x, int y) {
    int best = 0;
    for (int k = 1; k < costs.disparities; ++k)
        if (costs.at(x, y, k) < costs.at(x, y, best)) best = k;
    return best;
}

// The right view's pixel x sees left pixel x + d at disparity d = min_disparity + k.
int best_of_right(const CostVolume& costs, int x, int y, int min_disparity) {
    int best = -1;
    for (int k = 0; k < costs.disparities; ++k) {
        const int match = x + min_disparity + k;
        if (match < 0 || match >= costs.width) continue;
        if (best < 0 || costs.at(match, y, k) < costs.at(x + min_disparity + best, y, best)) best = k;
    }
    return best;
}

}  // namespace

std::uint16_t CostVolume::clamped(int x, int y, int k) const {
    return at(std::clamp(x, 0, width - 1), std::clamp(y, 0, height - 1), k);
}

WindowTaps window_taps(Window window) {
    switch (window) {
        case Window::kGauss55:
            return {56, 48, 31, 15, 5, 1};
        case Window::kBox:
            return {24, 24, 23, 23, 23, 23};
        case Window::kGauss5:
            break;
    }
    return {62, 51, 30, 12, 3, 1};
}

CostVolume truncated_differences(ConstLuma left, ConstLuma right, int min_disparity, int disparities,
                                 int truncation) {
    CostVolume costs(left.width, left.height, disparities);
    for_each_cost(costs, [&](int x, int y, int k) {
        const int match = x - min_disparity - k;
        const bool outside = match < 0 || match >= left.width;
        const int difference = outside ? truncation : std::abs(left.at(x, y) - right.at(match, y));
        costs.at(x, y, k) = static_cast<std::uint16_t>(std::min(difference, truncation));
    });
    return costs;
}

CostVolume aggregated(const CostVolume& costs, const WindowTaps& taps) {
    CostVolume across(costs.width, costs.height, costs.disparities);
    for_each_cost(costs, [&](int x, int y, int k) {
        unsigned sum = 0;
        for (int i = -kWindowReach; i <= kWindowReach; ++i)
            sum += static_cast<unsigned>(taps[static_cast<std::size_t>(std::abs(i))]) *
                   costs.clamped(x + i, y, k);
        across.at(x, y, k) = static_cast<std::uint16_t>(sum);
    });
    CostVolume result(costs.width, costs.height, costs.disparities);
    for_each_cost(costs, [&](int x, int y, int k) {
        unsigned sum = 128;
        for (int j = -kWindowReach; j <= kWindowReach; ++j)
            sum += static_cast<unsigned>(taps[static_cast<std::size_t>(std::abs(j))]) *
                   across.clamped(x, y + j, k);
        result.at(x, y, k) = static_cast<std::uint16_t>(sum >> 8U);
    });
    return result;
}

CostVolume after_rule_one(const CostVolume& costs, RuleOne rule) {
    CostVolume result = costs;
    if (rule == RuleOne::kOff) return result;
    for_each_cost(costs, [&](int x, int y, int k) {
        const int cost = costs.at(x, y, k);
        const bool consistent = (k > 0 && near(costs.at(x, y, k - 1), cost)) ||
                                (k + 1 < costs.disparities && near(costs.at(x, y, k + 1), cost));
        if (!consistent) return;
        unsigned sum = 0;
        for (int j = -1; j <= 1; ++j)
            for (int i = -1; i <= 1; ++i)
                sum += costs.clamped(x + i, y + j, k);
        result.at(x, y, k) = static_cast<std::uint16_t>(rule == RuleOne::kMean9 ? (sum + 4) / 9 : sum);
    });
    return result;
}

CostVolume after_rule_two(const CostVolume& costs, const CostVolume& looked_at, RuleTwo rule) {
    CostVolume result = costs;
    if (rule == RuleTwo::kOff) return result;
    for_each_cost(costs, [&](int x, int y, int k) {
        const int cost = looked_at.at(x, y, k);
        int supporters = 0;
        for (int j = -1; j <= 1; ++j)
            for (int i = -1; i <= 1; ++i) {
                if (i == 0 && j == 0 && rule == RuleTwo::kSevenOfEight) continue;
                if (near(looked_at.clamped(x + i, y + j, k), cost)) ++supporters;
            }
        if (supporters >= 7) result.at(x, y, k) = static_cast<std::uint16_t>(10 * costs.at(x, y, k) / 13);
    });
    return result;
}

void match_paper_integer(const MatcherConfig& given, ConstLuma left, ConstLuma right,
                         const DisparityMap& out) {
    const MatcherConfig config = resolved(given);
    const int width = left.width;
    const int height = left.height;
    Arena arena;
    ConstLuma seen_left = left;
    ConstLuma seen_right = right;
    if (config.normalise_local_mean) {
        const auto scratch = arena.take<std::uint16_t>(static_cast<std::size_t>(local_mean_scratch(width)));
        const Luma plain_left = arena.image<std::uint8_t>(width, height);
        const Luma plain_right = arena.image<std::uint8_t>(width, height);
        subtract_local_mean(left, plain_left, 0, height, scratch);
        subtract_local_mean(right, plain_right, 0, height, scratch);
        seen_left = plain_left;
        seen_right = plain_right;
    }

    const PaperReading& reading = config.paper;
    const CostVolume costs = aggregated(truncated_differences(seen_left, seen_right, config.min_disparity,
                                                              config.disparities, reading.truncation),
                                        window_taps(reading.window));
    const CostVolume refined = after_rule_one(costs, reading.rule_one);
    const CostVolume enhanced =
        after_rule_two(refined, reading.rules_at_once ? costs : refined, reading.rule_two);

    const CheckLimits& limits = config.limits;
    const int last = config.disparities - 1;
    const auto judge = [&](int x, int y, int k) {
        const Invalid seen = window_reason(left, seen_left, x, y, limits);
        if (seen != Invalid::kNone) return seen;
        const int match = x - config.min_disparity - k;
        if (match <= 0 || match >= width) return Invalid::kBorder;
        if (k == last) return Invalid::kRangeEdge;
        if (100 * refined.at(x, y, k) > limits.cost_percent * 256 * reading.truncation &&
            limits.cost_percent < 100)
            return Invalid::kCost;
        if (limits.uniqueness_percent >= 0) {
            const int best = enhanced.at(x, y, k);
            int second = 32767;
            for (int other = 0; other <= last; ++other)
                if (std::abs(other - k) > 1) second = std::min<int>(second, enhanced.at(x, y, other));
            if (second == best ||
                100 * (second - limits.uniqueness_floor) < best * (100 + limits.uniqueness_percent))
                return Invalid::kUniqueness;
        }
        if (limits.left_right_px >= 0 &&
            std::abs(best_of_right(enhanced, match, y, config.min_disparity) - k) > limits.left_right_px)
            return Invalid::kLeftRight;
        return Invalid::kNone;
    };
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const int k = best_of_left(enhanced, x, y);
            int disparity_q4 = kDisparityOne * (config.min_disparity + k);
            Invalid invalid = Invalid::kNone;
            if (config.checks) {
                invalid = judge(x, y, k);
                if (limits.subpixel && k > 0 && k < last)
                    disparity_q4 +=
                        equiangular_q4(refined.at(x, y, k - 1), refined.at(x, y, k), refined.at(x, y, k + 1));
            }
            out.disparity_q4.at(x, y) =
                static_cast<std::int16_t>(invalid == Invalid::kNone ? disparity_q4 : 0);
            out.invalid.at(x, y) = invalid;
        }
    if (config.checks) finish_map(out, left, right, limits);
}

}  // namespace groundline::stereo
