#include "unit/stereo_plain_kernels.hpp"

#include <algorithm>
#include <cstdlib>

namespace groundline::stereo::plain_kernels {
namespace {

bool near(int other, int cost) {
    return 2 * std::abs(other - cost) < cost;
}

template <typename Function>
void for_each_pixel(CostRows out, Function function) {
    for (int y = 0; y < out.height; ++y)
        for (int x = 0; x < out.width; ++x)
            out.row(y)[x] = static_cast<Cost>(function(x, y));
}

int tap(const WindowTaps& taps, int i) {
    return taps[static_cast<std::size_t>(std::abs(i))];
}

}  // namespace

void weigh_down(const Shifted& views, int truncation, const WindowTaps& taps, CostRows out) {
    for_each_pixel(out, [&](int x, int y) {
        int sum = 0;
        for (int j = -kWindowReach; j <= kWindowReach; ++j) {
            const int row = y + kWindowReach + j;
            const int difference = views.outside[x] != 0
                                       ? truncation
                                       : std::abs(views.left.row(row)[x] - views.right.row(row)[x]);
            sum += tap(taps, j) * std::min(difference, truncation);
        }
        return sum;
    });
}

void weigh_across(ConstCostRows in, const WindowTaps& taps, CostRows out) {
    for_each_pixel(out, [&](int x, int y) {
        int sum = 128;
        for (int i = -kWindowReach; i <= kWindowReach; ++i)
            sum += tap(taps, i) * in.row(y)[x + i];
        return sum / 256;
    });
}

void rule_one(RuleOne rule, ConstCostRows costs, ConstCostRows farther, ConstCostRows nearer, CostRows out) {
    for_each_pixel(out, [&](int x, int y) {
        const int cost = costs.row(y + 1)[x];
        if (rule == RuleOne::kOff) return cost;
        if (!near(farther.row(y + 1)[x], cost) && !near(nearer.row(y + 1)[x], cost)) return cost;
        int sum = 0;
        for (int j = 0; j <= 2; ++j)
            for (int i = -1; i <= 1; ++i)
                sum += costs.row(y + j)[x + i];
        return rule == RuleOne::kMean9 ? (sum + 4) / 9 : sum;
    });
}

void rule_two(RuleTwo rule, ConstCostRows looked_at, ConstCostRows costs, CostRows out) {
    for_each_pixel(out, [&](int x, int y) {
        const int centre = looked_at.row(y + 1)[x];
        int supporters = 0;
        for (int j = 0; j <= 2; ++j)
            for (int i = -1; i <= 1; ++i) {
                if (j == 1 && i == 0 && rule != RuleTwo::kSevenOfNine) continue;
                supporters += near(looked_at.row(y + j)[x + i], centre) ? 1 : 0;
            }
        const int cost = costs.row(y)[x];
        return rule != RuleTwo::kOff && supporters >= 7 ? 10 * cost / 13 : cost;
    });
}

Invalid judge(const WinnerRow& winners, const SearchRange& range, const CheckLimits& limits, Invalid window,
              int x) {
    const int k = winners.index[x];
    const int match = x - range.min_disparity - k;
    const int best = winners.best[x];
    const int second = winners.second[x];
    if (window != Invalid::kNone) return window;
    if (match <= 0 || match >= range.width) return Invalid::kBorder;
    if (k == range.disparities - 1) return Invalid::kRangeEdge;
    if (limits.cost_percent < 100 && 100 * winners.centre[x] > limits.cost_percent * 256 * range.truncation)
        return Invalid::kCost;
    if (limits.uniqueness_percent >= 0 && (second == best || 100 * (second - limits.uniqueness_floor) <
                                                                 (100 + limits.uniqueness_percent) * best))
        return Invalid::kUniqueness;
    if (limits.left_right_px >= 0 && std::abs(winners.index_right[match] - k) > limits.left_right_px)
        return Invalid::kLeftRight;
    return Invalid::kNone;
}

}  // namespace groundline::stereo::plain_kernels
