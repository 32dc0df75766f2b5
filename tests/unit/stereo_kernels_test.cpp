// Every kernel of the paper's matcher on every vector unit against the plain formula, at odd widths, odd
// addresses and the extremes of what it may be given.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <random>
#include <vector>

#include "stereo/subpixel.hpp"
#include "support/vector_units.hpp"
#include "unit/stereo_plain_kernels.hpp"

namespace groundline::stereo {
namespace {

using kernels::Cost;
using kernels::cost_rows;
using kernels::CostRows;
using kernels::Group;
using kernels::kGroup;
using kernels::kNoCost;
using kernels::row_range;
using kernels::Winners;

constexpr int kWidths[] = {1, 7, 8, 9, 15, 16, 17, 31, 33, 63, 64, 65, 97, 130};

int up_to(std::mt19937& random, int highest) {
    return static_cast<int>(random() % static_cast<std::uint32_t>(highest + 1));
}

// Rows whose first column is not aligned, all of them and their margins from function(x, y).
template <typename Function>
CostRows made(Arena& arena, int width, int height, Function function) {
    CostRows rows = cost_rows(arena, width + 3, height);
    rows = {rows.data + width % 3, width, height, rows.stride};
    for (int y = 0; y < height; ++y)
        for (int x = -16; x < width + 16; ++x)
            rows.data[y * rows.stride + x] = static_cast<Cost>(function(x, y));
    return rows;
}

CostRows noise(Arena& arena, std::mt19937& random, int width, int height, int lowest, int highest) {
    return made(arena, width, height, [&](int, int) { return lowest + up_to(random, highest - lowest); });
}

// Costs around `level` that mostly support each other, with a stranger here and there.
CostRows strangers(Arena& arena, std::mt19937& random, int width, int height, int level, int one_in) {
    return made(arena, width, height, [&](int, int) {
        if (up_to(random, one_in - 1) == 0) return up_to(random, 2 * level);
        return level + up_to(random, level / 3) - level / 6;
    });
}

void expect_same(CostRows actual, CostRows expected) {
    for (int y = 0; y < expected.height; ++y)
        for (int x = 0; x < expected.width; ++x)
            ASSERT_EQ(actual.row(y)[x], expected.row(y)[x])
                << "width " << expected.width << " row " << y << " column " << x;
}

void expect_border(CostRows rows, int columns) {
    for (int y = 0; y < rows.height; ++y)
        for (int i = 1; i <= columns; ++i) {
            ASSERT_EQ(rows.row(y)[-i], rows.row(y)[0]) << "width " << rows.width;
            ASSERT_EQ(rows.row(y)[rows.width - 1 + i], rows.row(y)[rows.width - 1]) << "width " << rows.width;
        }
}

TEST(StereoKernels, WeighDown) {
    on_every_vector_unit([] {
        for (const int width : kWidths)
            for (const Window window : {Window::kGauss5, Window::kGauss55, Window::kBox})
                for (const int truncation : {1, 10, 28})
                    for (const bool worst : {false, true}) {
                        constexpr int kHeight = 5;
                        std::mt19937 random(1);
                        Arena arena;
                        const Luma left = arena.image<std::uint8_t>(width + 64, kHeight + 10);
                        const Luma right = arena.image<std::uint8_t>(width + 64, kHeight + 10);
                        const auto outside = arena.take<std::uint8_t>(static_cast<std::size_t>(width) + 64);
                        for (int y = 0; y < left.height; ++y)
                            for (int x = 0; x < width + 64; ++x) {
                                left.at(x, y) = static_cast<std::uint8_t>(up_to(random, 255));
                                right.at(x, y) = static_cast<std::uint8_t>(
                                    worst ? ~left.at(x, y) : left.at(x, y) + up_to(random, 40) - 20);
                            }
                        for (int x = 0; x < width; ++x)
                            outside[static_cast<std::size_t>(x + 5)] = up_to(random, 4) == 0 ? 255 : 0;
                        const kernels::Shifted views{{left.data, width, left.height, left.stride},
                                                     {right.data + 7, width, right.height, right.stride},
                                                     outside.data() + 5};
                        const CostRows out = cost_rows(arena, width, kHeight);
                        const CostRows expected = cost_rows(arena, width, kHeight);
                        kernels::weigh_down(views, truncation, window_taps(window), out);
                        plain_kernels::weigh_down(views, truncation, window_taps(window), expected);
                        expect_same(out, expected);
                        expect_border(out, kWindowReach);
                    }
    });
}

TEST(StereoKernels, WeighAcross) {
    on_every_vector_unit([] {
        for (const int width : kWidths)
            for (const Window window : {Window::kGauss5, Window::kGauss55, Window::kBox})
                for (const int lowest : {0, 7168}) {  // 7168: the highest everywhere
                    std::mt19937 random(2);
                    Arena arena;
                    const CostRows in = noise(arena, random, width, 3, lowest, 7168);
                    const CostRows out = cost_rows(arena, width, 3);
                    const CostRows expected = cost_rows(arena, width, 3);
                    kernels::weigh_across(in, window_taps(window), out);
                    plain_kernels::weigh_across(in, window_taps(window), expected);
                    expect_same(out, expected);
                    expect_border(out, 1);
                }
    });
}

TEST(StereoKernels, RuleOne) {
    on_every_vector_unit([] {
        for (const int width : kWidths)
            for (const int level : {1, 40, 2000})
                for (const RuleOne rule : {RuleOne::kOff, RuleOne::kMean9, RuleOne::kSum9}) {
                    std::mt19937 random(3);
                    Arena arena;
                    const CostRows costs = noise(arena, random, width, 6, 0, 3 * level / 2);
                    const CostRows farther = noise(arena, random, width, 6, level, 3 * level);
                    const CostRows nearer = noise(arena, random, width, 6, level, 4 * level);
                    const CostRows out = cost_rows(arena, width, 4);
                    const CostRows expected = cost_rows(arena, width, 4);
                    kernels::rule_one(rule, costs, farther, nearer, out);
                    plain_kernels::rule_one(rule, costs, farther, nearer, expected);
                    expect_same(out, expected);
                    expect_border(out, 1);
                }
    });
}

TEST(StereoKernels, RuleOneMeanIsExactForEverySum) {
    constexpr int kWidth = 35;
    on_every_vector_unit([] {
        Arena arena;
        const CostRows out = cost_rows(arena, kWidth, 1);
        const CostRows row = cost_rows(arena, kWidth, 3);
        for (int sum = 9; sum <= 9 * 7168; ++sum) {
            // Nine equal costs and the remainder, in columns of three.
            for (int y = 0; y < 3; ++y)
                for (int x = -1; x <= kWidth; ++x)
                    row.row(y)[x] = static_cast<Cost>(sum / 9 + (y == 0 && x % 3 == 0 ? sum % 9 : 0));
            kernels::rule_one(RuleOne::kMean9, row, row, row, out);
            for (int x = 0; x < kWidth; ++x)
                ASSERT_EQ(out.row(0)[x], (sum + 4) / 9) << "sum " << sum;
        }
    });
}

TEST(StereoKernels, RuleTwo) {
    on_every_vector_unit([] {
        for (const int width : kWidths)
            for (const int level : {3, 700, 3500, 14000})
                for (const int one_in : {1, 4, 30, 1000})
                    for (const RuleTwo rule :
                         {RuleTwo::kOff, RuleTwo::kSevenOfEight, RuleTwo::kSevenOfNine}) {
                        constexpr int kHeight = 5;
                        std::mt19937 random(static_cast<std::uint32_t>(4 + one_in));
                        Arena arena;
                        const CostRows looked_at =
                            strangers(arena, random, width, kHeight + 2, level, one_in);
                        const CostRows costs = strangers(arena, random, width, kHeight, level, 2);
                        for (int y = 0; y < kHeight; ++y)
                            for (int x = 0; x < width; ++x)
                                if (looked_at.row(y + 1)[x] == 0) costs.row(y)[x] = 0;
                        const CostRows out = made(arena, width, kHeight, [](int, int) { return kNoCost; });
                        const CostRows expected = cost_rows(arena, width, kHeight);
                        kernels::rule_two(rule, level > 3500, looked_at, costs, out);
                        plain_kernels::rule_two(rule, looked_at, costs, expected);
                        expect_same(out, expected);
                        for (int y = 0; y < kHeight; ++y)
                            for (int i = 0; i < 16; ++i)
                                ASSERT_EQ(out.row(y)[width + i], kNoCost) << "width " << width;
                    }
    });
}

// Every number of supporters, at the exact limits of what counts as one.
TEST(StereoKernels, RuleTwoCountsToSeven) {
    on_every_vector_unit([] {
        for (const int cost : {1, 2, 3, 4, 5, 100, 101, 7168})
            for (unsigned strange = 0; strange < 256; ++strange)
                for (const bool above : {false, true}) {
                    Arena arena;
                    unsigned bit = 1;
                    const CostRows looked_at = made(arena, 1, 3, [&](int x, int y) {
                        if (x < -1 || x > 1 || (x == 0 && y == 1)) return cost;
                        const bool is_strange = (strange & bit) != 0;
                        bit <<= 1U;
                        // The farthest that is near and the nearest that is not.
                        const int reach = (cost + 1) / 2 - (is_strange ? 0 : 1);
                        return above ? cost + reach : cost - reach;
                    });
                    const CostRows out = cost_rows(arena, 1, 1);
                    const CostRows expected = cost_rows(arena, 1, 1);
                    for (const RuleTwo rule : {RuleTwo::kSevenOfEight, RuleTwo::kSevenOfNine}) {
                        kernels::rule_two(rule, false, looked_at, row_range(looked_at, 1, 1), out);
                        plain_kernels::rule_two(rule, looked_at, row_range(looked_at, 1, 1), expected);
                        ASSERT_EQ(out.row(0)[0], expected.row(0)[0]) << "cost " << cost << " of " << strange;
                    }
                }
    });
}

TEST(StereoKernels, RuleTwoScalesEveryCostExactly) {
    constexpr int kWidth = 35;
    on_every_vector_unit([] {
        Arena arena;
        const CostRows looked_at = made(arena, kWidth, 3, [](int, int) { return 100; });
        const CostRows row = cost_rows(arena, kWidth, 1);
        const CostRows out = cost_rows(arena, kWidth, 1);
        for (const bool sums : {false, true})
            for (int cost = 0; cost <= (sums ? 32256 : 7168); ++cost) {
                fill_pixels(row, static_cast<Cost>(cost));
                kernels::rule_two(RuleTwo::kSevenOfEight, sums, looked_at, row, out);
                for (int x = 0; x < kWidth; ++x)
                    ASSERT_EQ(out.row(0)[x], 10 * cost / 13) << "cost " << cost;
            }
    });
}

TEST(StereoKernels, SelectionKeepsWinnerNeighboursAndRunnerUp) {
    constexpr int kDisparities = 24;
    constexpr int kHeight = 2;
    on_every_vector_unit([] {
        for (const int width : kWidths)
            for (const int highest : {3, 2560}) {  // many ties, few ties
                std::mt19937 random(5);
                Arena arena;
                std::vector<CostRows> costs;
                std::vector<CostRows> refined;
                for (int k = 0; k < kDisparities; ++k) {
                    costs.push_back(noise(arena, random, width, kHeight, 0, highest));
                    refined.push_back(noise(arena, random, width, kHeight, 0, highest));
                }
                const auto plane = [&] {
                    return made(arena, width, kHeight, [](int, int) { return kNoCost; });
                };
                const Winners winners{plane(), plane(), plane(), plane(), plane(), plane(), plane()};
                const Winners only{plane(), plane(), {}, {}, {}, {}, {}};
                for (std::size_t k = 0; k < kDisparities; k += kGroup) {
                    const Group group{costs[k], costs[k + 1], costs[k + 2], costs[k + 3]};
                    const Group group_refined{refined[k], refined[k + 1], refined[k + 2], refined[k + 3]};
                    kernels::select_with_evidence(group, refined[k > 0 ? k - 1 : 0], group_refined,
                                                  static_cast<int>(k), winners);
                    kernels::select(group, static_cast<int>(k), only);
                }
                for (int y = 0; y < kHeight; ++y)
                    for (int x = 0; x < width; ++x) {
                        std::size_t winner = 0;
                        for (std::size_t k = 1; k < kDisparities; ++k)
                            if (costs[k].at(x, y) < costs[winner].at(x, y)) winner = k;
                        int runner_up = kNoCost;
                        for (std::size_t k = 0; k < kDisparities; ++k)
                            if (k + 1 < winner || k > winner + 1)
                                runner_up = std::min<int>(runner_up, costs[k].at(x, y));
                        ASSERT_EQ(winners.index.at(x, y), static_cast<int>(winner));
                        ASSERT_EQ(only.index.at(x, y), static_cast<int>(winner));
                        ASSERT_EQ(winners.best.at(x, y), costs[winner].at(x, y));
                        ASSERT_EQ(only.best.at(x, y), costs[winner].at(x, y));
                        ASSERT_EQ(winners.second.at(x, y), runner_up) << "width " << width << " x " << x;
                        ASSERT_EQ(winners.centre.at(x, y), refined[winner].at(x, y));
                        if (winner > 0) {
                            ASSERT_EQ(winners.lower.at(x, y), refined[winner - 1].at(x, y));
                        }
                        if (winner + 1 < kDisparities) {
                            ASSERT_EQ(winners.upper.at(x, y), refined[winner + 1].at(x, y));
                        }
                    }
            }
    });
}

TEST(StereoKernels, SelectionOfTheRightView) {
    constexpr int kDisparities = 16;
    on_every_vector_unit([] {
        for (const int width : {17, 33, 97})
            for (const int first : {-20, -6, 0, 9}) {
                std::mt19937 random(6);
                Arena arena;
                std::vector<CostRows> costs;
                for (int k = 0; k < kDisparities; ++k) {
                    costs.push_back(cost_rows(arena, width, 1, 20, 25));
                    for (int x = -20; x < width + 25 + 64; ++x)
                        costs.back().row(0)[x] =
                            x < 0 || x >= width ? kNoCost : static_cast<Cost>(up_to(random, 50));
                }
                const CostRows best = cost_rows(arena, width, 1);
                fill_pixels(best, kNoCost);
                const CostRows index = cost_rows(arena, width, 1);
                fill_pixels(index, Cost{-1});
                for (std::size_t k = 0; k < kDisparities; k += kGroup)
                    kernels::select_right({costs[k], costs[k + 1], costs[k + 2], costs[k + 3]},
                                          static_cast<int>(k), first + static_cast<int>(k), best, index);
                for (int x = 0; x < width; ++x) {
                    int winner = -1;
                    int lowest = kNoCost;
                    for (int k = 0; k < kDisparities; ++k) {
                        const int match = x + first + k;
                        if (match < 0 || match >= width) continue;
                        const int cost = costs[static_cast<std::size_t>(k)].at(match, 0);
                        if (cost >= lowest) continue;
                        lowest = cost;
                        winner = k;
                    }
                    ASSERT_EQ(index.at(x, 0), winner) << "first " << first << " x " << x;
                }
            }
    });
}

TEST(StereoKernels, JudgesEveryWinnerAndPlacesIt) {
    on_every_vector_unit([] {
        std::mt19937 random(7);
        std::vector<int> seen(static_cast<std::size_t>(Invalid::kCount), 0);
        for (const int width : kWidths)
            for (const int min_disparity : {-9, 0, 5})
                for (const CheckLimits& limits :
                     {CheckLimits{}, CheckLimits{false, 100, 0, 100, -1, 0, -1, 0},
                      CheckLimits{true, 25, 60, 40, 8, 20, 0, 100},
                      CheckLimits{true, 0, 0, 99, 200, -500, 3, 0}})
                    for (int repeat = 0; repeat < 4; ++repeat) {
                        Arena arena;
                        const SearchRange range{width, min_disparity, 16, 10};
                        const int level = repeat < 2 ? 6 : 2560;
                        const CostRows rows = noise(arena, random, width, 8, 0, level);
                        for (int x = 0; x < width; ++x) {
                            rows.row(0)[x] = static_cast<Cost>(up_to(random, 15));
                            rows.row(6)[x] = static_cast<Cost>(up_to(random, 15));
                            const int best = rows.row(1)[x];
                            if (repeat % 2 == 0)
                                rows.row(2)[x] = static_cast<Cost>(best + up_to(random, best / 8 + 1));
                            if (up_to(random, 1) == 0)  // a minimum, more often than noise has one
                                rows.row(4)[x] = std::min(rows.row(3)[x], rows.row(5)[x]);
                        }
                        const WinnerRow winners{rows.row(0), rows.row(1), rows.row(2), rows.row(3),
                                                rows.row(4), rows.row(5), rows.row(6)};
                        const auto invalid = arena.image<Invalid>(width, 1);
                        const auto disparity = arena.image<std::int16_t>(width, 1);
                        std::vector<Invalid> window;
                        for (int x = 0; x < width; ++x) {
                            constexpr Invalid kChoices[] = {Invalid::kNone, Invalid::kNone, Invalid::kNone,
                                                            Invalid::kTexture, Invalid::kSaturation};
                            window.push_back(kChoices[up_to(random, 4)]);
                            invalid.at(x, 0) = window.back();
                        }
                        judge_winners(winners, range, limits, rows.row(7), invalid.row(0), disparity.row(0));
                        for (int x = 0; x < width; ++x) {
                            const Invalid expected = plain_kernels::judge(
                                winners, range, limits, window[static_cast<std::size_t>(x)], x);
                            ++seen[static_cast<std::size_t>(expected)];
                            ASSERT_EQ(invalid.at(x, 0), expected) << "width " << width << " x " << x;
                            const int k = winners.index[x];
                            int answer = kDisparityOne * (min_disparity + k);
                            if (limits.subpixel && k > 0 && k < 15)
                                answer +=
                                    equiangular_q4(winners.lower[x], winners.centre[x], winners.upper[x]);
                            ASSERT_EQ(disparity.at(x, 0), expected == Invalid::kNone ? answer : 0)
                                << "width " << width << " x " << x;
                        }
                    }
        for (const Invalid reason :
             {Invalid::kNone, Invalid::kBorder, Invalid::kTexture, Invalid::kUniqueness, Invalid::kLeftRight,
              Invalid::kSaturation, Invalid::kCost, Invalid::kRangeEdge})
            EXPECT_GT(seen[static_cast<std::size_t>(reason)], 0)
                << kInvalidNames[static_cast<std::size_t>(reason)];
    });
}

}  // namespace
}  // namespace groundline::stereo
