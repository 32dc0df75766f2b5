// Every kernel in every compiled form against the plain formula, at odd widths.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <random>
#include <vector>

#include "stereo/paper_kernels.hpp"
#include "unit/stereo_plain_kernels.hpp"

namespace groundline::stereo {
namespace {

using kernels::Cost;
using kernels::kNoCost;
using kernels::Rows;
using kernels::Winners;

// Both forms of all kernels; on a processor with AVX2 `chosen` is that form.
struct Form {
    const char* name;
    decltype(&kernels::truncated_differences) truncated_differences;
    decltype(&kernels::weigh_down) weigh_down;
    decltype(&kernels::weigh_across) weigh_across;
    decltype(&kernels::rule_one) rule_one;
    decltype(&kernels::rule_two) rule_two;
    decltype(&kernels::select) select;
    decltype(&kernels::select_with_evidence) select_with_evidence;
    decltype(&kernels::select_right) select_right;
};
constexpr Form kForms[] = {
    {"chosen for this processor", kernels::truncated_differences, kernels::weigh_down, kernels::weigh_across,
     kernels::rule_one, kernels::rule_two, kernels::select, kernels::select_with_evidence,
     kernels::select_right},
    {"plain", plain_kernels::truncated_differences, plain_kernels::weigh_down, plain_kernels::weigh_across,
     plain_kernels::rule_one, plain_kernels::rule_two, plain_kernels::select,
     plain_kernels::select_with_evidence, plain_kernels::select_right},
};
constexpr int kWidths[] = {1, 7, 8, 15, 16, 17, 31, 33, 64, 97, 130};
constexpr int kPad = 8;

template <typename T>
std::vector<T> random_row(std::mt19937& random, int width, int highest) {
    std::vector<T> row(static_cast<std::size_t>(width + 2 * kPad));
    for (T& value : row)
        value = static_cast<T>(random() % static_cast<std::uint32_t>(highest + 1));
    return row;
}

// Costs scattered around one level, so that the rules' conditions go both ways.
std::vector<Cost> cost_row(std::mt19937& random, int width, int level) {
    std::vector<Cost> row(static_cast<std::size_t>(width + 2 * kPad));
    for (Cost& value : row)
        value =
            static_cast<Cost>(level / 2 + static_cast<int>(random() % static_cast<std::uint32_t>(level + 1)));
    return row;
}

bool near(int other, int cost) {
    return 2 * std::abs(other - cost) < cost;
}

TEST(StereoKernels, SaysWhichFormsRan) {
#if defined(__x86_64__)
    RecordProperty("avx2", __builtin_cpu_supports("avx2") ? "ran" : "this processor has none");
#endif
    SUCCEED();
}

TEST(StereoKernels, TruncatedDifferences) {
    for (const Form& form : kForms)
        for (const int width : kWidths)
            for (const int disparity : {-200, -5, 0, 1, 6, 16, 200})
                for (const int truncation : {1, 10, 28}) {
                    std::mt19937 random(1);
                    const auto left = random_row<std::uint8_t>(random, width, 255);
                    auto right = left;
                    for (auto& value : right)
                        value = static_cast<std::uint8_t>(value + random() % 41 - 20);
                    std::vector<std::uint8_t> out(static_cast<std::size_t>(width) + 1, 99);
                    form.truncated_differences(left.data(), right.data(), width, disparity, truncation,
                                               out.data());
                    for (int x = 0; x < width; ++x) {
                        const int match = x - disparity;
                        const int expected =
                            match < 0 || match >= width
                                ? truncation
                                : std::min(truncation, std::abs(left[static_cast<std::size_t>(x)] -
                                                                right[static_cast<std::size_t>(match)]));
                        ASSERT_EQ(out[static_cast<std::size_t>(x)], expected)
                            << form.name << " width " << width << " disparity " << disparity;
                    }
                    ASSERT_EQ(out.back(), 99) << form.name << " writes past the row";
                }
}

TEST(StereoKernels, WindowDownAndAcross) {
    for (const Form& form : kForms)
        for (const int width : kWidths)
            for (const Window window : {Window::kGauss5, Window::kGauss55, Window::kBox})
                for (const bool worst : {false, true}) {
                    std::mt19937 random(2);
                    const WindowTaps taps = window_taps(window);
                    std::vector<std::vector<std::uint8_t>> storage;
                    std::array<const std::uint8_t*, 11> rows;
                    for (int j = 0; j < 11; ++j)
                        storage.push_back(random_row<std::uint8_t>(random, width, 28));
                    if (worst)
                        for (auto& row : storage)
                            std::fill(row.begin(), row.end(), std::uint8_t{28});
                    for (std::size_t j = 0; j < 11; ++j)
                        rows[j] = storage[j].data();
                    std::vector<std::uint16_t> down(static_cast<std::size_t>(width));
                    form.weigh_down(rows, taps, width, down.data());
                    for (int x = 0; x < width; ++x) {
                        int sum = 0;
                        for (int j = -5; j <= 5; ++j)
                            sum += taps[static_cast<std::size_t>(std::abs(j))] *
                                   rows[static_cast<std::size_t>(j + 5)][x];
                        ASSERT_EQ(down[static_cast<std::size_t>(x)], sum) << form.name << " width " << width;
                    }
                    auto in = random_row<std::uint16_t>(random, width, 7168);
                    if (worst) std::fill(in.begin(), in.end(), std::uint16_t{7168});
                    std::vector<Cost> across(static_cast<std::size_t>(width));
                    form.weigh_across(in.data() + kPad, taps, width, across.data());
                    for (int x = 0; x < width; ++x) {
                        int sum = 128;
                        for (int i = -5; i <= 5; ++i)
                            sum += taps[static_cast<std::size_t>(std::abs(i))] *
                                   in[static_cast<std::size_t>(x + i + kPad)];
                        ASSERT_EQ(across[static_cast<std::size_t>(x)], sum >> 8)
                            << form.name << " width " << width;
                    }
                }
}

TEST(StereoKernels, RuleOne) {
    for (const Form& form : kForms)
        for (const int width : kWidths)
            for (const int level : {1, 40, 2000}) {
                std::mt19937 random(3);
                const auto above = cost_row(random, width, level);
                auto here = cost_row(random, width, level);
                here[kPad] = 0;
                const auto below = cost_row(random, width, level);
                const auto farther = cost_row(random, width, 2 * level);
                const auto nearer = cost_row(random, width, 3 * level);
                const Rows rows{above.data() + kPad, here.data() + kPad, below.data() + kPad};
                std::vector<std::uint16_t> columns(static_cast<std::size_t>(width) + 2);
                std::vector<Cost> out(static_cast<std::size_t>(width));
                for (const RuleOne rule : {RuleOne::kOff, RuleOne::kMean9, RuleOne::kSum9}) {
                    form.rule_one(rule, rows, farther.data() + kPad, nearer.data() + kPad, width,
                                  columns.data(), out.data());
                    for (int x = 0; x < width; ++x) {
                        const auto at = static_cast<std::size_t>(x + kPad);
                        int expected = here[at];
                        if (rule != RuleOne::kOff &&
                            (near(farther[at], here[at]) || near(nearer[at], here[at]))) {
                            int sum = 0;
                            for (std::size_t i = at - 1; i <= at + 1; ++i)
                                sum += above[i] + here[i] + below[i];
                            expected = rule == RuleOne::kMean9 ? (sum + 4) / 9 : sum;
                        }
                        ASSERT_EQ(out[static_cast<std::size_t>(x)], expected)
                            << form.name << " width " << width << " x " << x;
                    }
                }
            }
}

TEST(StereoKernels, RuleOneMeanIsExactForEverySum) {
    constexpr int kWidth = 19;  // reaches the vector loop and its remainder
    for (const Form& form : kForms)
        for (int sum = 1; sum <= 9 * 7168; ++sum) {
            // Nine equal costs and the remainder, in columns of three.
            std::vector<Cost> row(kWidth + 2, static_cast<Cost>(sum / 9));
            std::vector<Cost> above = row;
            for (std::size_t i = 1; i < above.size(); i += 3)
                above[i] = static_cast<Cost>(above[i] + sum % 9);
            if (row[0] == 0) continue;
            const Rows rows{above.data() + 1, row.data() + 1, row.data() + 1};
            std::vector<std::uint16_t> columns(kWidth + 2);
            std::vector<Cost> out(kWidth);
            form.rule_one(RuleOne::kMean9, rows, row.data() + 1, row.data() + 1, kWidth, columns.data(),
                          out.data());
            for (std::size_t x = 0; x < kWidth; ++x)
                ASSERT_EQ(out[x], (sum + 4) / 9) << form.name << " sum " << sum;
        }
}

TEST(StereoKernels, RuleTwo) {
    for (const Form& form : kForms)
        for (const int width : kWidths)
            for (const int level : {3, 700, 4500, 14000})
                for (int repeat = 0; repeat < 20; ++repeat) {
                    std::mt19937 random(static_cast<std::uint32_t>(4 + repeat));
                    const auto above = cost_row(random, width, level);
                    auto here = cost_row(random, width, level);
                    here[kPad] = 0;
                    const auto below = cost_row(random, width, level);
                    const auto costs = cost_row(random, width, level);
                    const Rows rows{above.data() + kPad, here.data() + kPad, below.data() + kPad};
                    std::vector<Cost> out(static_cast<std::size_t>(width));
                    const bool sums = level > 4500;
                    for (const RuleTwo rule :
                         {RuleTwo::kOff, RuleTwo::kSevenOfEight, RuleTwo::kSevenOfNine}) {
                        form.rule_two(rule, sums, rows, costs.data() + kPad, width, out.data());
                        for (int x = 0; x < width; ++x) {
                            const auto at = static_cast<std::size_t>(x + kPad);
                            const int cost = here[at];
                            int support = rule == RuleTwo::kSevenOfNine && cost > 0 ? 1 : 0;
                            for (std::size_t i = at - 1; i <= at + 1; ++i)
                                support += near(above[i], cost) + near(below[i], cost) +
                                           (i != at && near(here[i], cost) ? 1 : 0);
                            const bool scaled = rule != RuleTwo::kOff && support >= 7;
                            ASSERT_EQ(out[static_cast<std::size_t>(x)],
                                      scaled ? 10 * costs[at] / 13 : costs[at])
                                << form.name << " width " << width << " x " << x << " support " << support;
                        }
                    }
                }
}

TEST(StereoKernels, RuleTwoScalesEveryCostExactly) {
    constexpr int kWidth = 19;
    for (const Form& form : kForms)
        for (const bool sums : {false, true})
            for (int cost = 0; cost <= (sums ? 32256 : 7168); ++cost) {
                const std::vector<Cost> row(kWidth + 2, static_cast<Cost>(cost));
                const Rows rows{row.data() + 1, row.data() + 1, row.data() + 1};
                std::vector<Cost> out(kWidth);
                form.rule_two(RuleTwo::kSevenOfEight, sums, rows, row.data() + 1, kWidth, out.data());
                for (const Cost value : out)
                    ASSERT_EQ(value, 10 * cost / 13) << form.name << " cost " << cost;
            }
}

TEST(StereoKernels, SelectionKeepsWinnerNeighboursAndRunnerUp) {
    constexpr int kDisparities = 24;
    for (const Form& form : kForms)
        for (const int width : kWidths)
            for (const int highest : {3, 2560}) {  // many ties, few ties
                std::mt19937 random(5);
                std::vector<std::vector<Cost>> costs;
                std::vector<std::vector<Cost>> refined;
                for (int k = 0; k < kDisparities; ++k) {
                    costs.push_back(random_row<Cost>(random, width, highest));
                    refined.push_back(random_row<Cost>(random, width, highest));
                }
                const auto size = static_cast<std::size_t>(width);
                std::vector<Cost> best(size, kNoCost), before(size, kNoCost), second(size, kNoCost),
                    lower(size), centre(size), upper(size), only_best(size, kNoCost);
                std::vector<std::int16_t> index(size), only_index(size);
                const Winners winners{best.data(),  index.data(),  before.data(), second.data(),
                                      lower.data(), centre.data(), upper.data()};
                const Winners only{only_best.data(), only_index.data(), nullptr, nullptr,
                                   nullptr,          nullptr,           nullptr};
                for (std::size_t k = 0; k < kDisparities; ++k) {
                    form.select_with_evidence(costs[k].data(), refined[k].data(),
                                              refined[k > 0 ? k - 1 : 0].data(), static_cast<int>(k), width,
                                              winners);
                    form.select(costs[k].data(), static_cast<int>(k), width, only);
                }
                for (std::size_t x = 0; x < size; ++x) {
                    std::size_t winner = 0;
                    for (std::size_t k = 1; k < kDisparities; ++k)
                        if (costs[k][x] < costs[winner][x]) winner = k;
                    int runner_up = kNoCost;
                    for (std::size_t k = 0; k < kDisparities; ++k)
                        if (k + 1 < winner || k > winner + 1)
                            runner_up = std::min<int>(runner_up, costs[k][x]);
                    ASSERT_EQ(index[x], static_cast<int>(winner)) << form.name;
                    ASSERT_EQ(only_index[x], static_cast<int>(winner)) << form.name;
                    ASSERT_EQ(best[x], costs[winner][x]) << form.name;
                    ASSERT_EQ(second[x], runner_up) << form.name << " width " << width << " x " << x;
                    ASSERT_EQ(centre[x], refined[winner][x]) << form.name;
                    if (winner > 0) {
                        ASSERT_EQ(lower[x], refined[winner - 1][x]) << form.name;
                    }
                    if (winner + 1 < kDisparities) {
                        ASSERT_EQ(upper[x], refined[winner + 1][x]) << form.name;
                    }
                }
            }
}

TEST(StereoKernels, SelectionOfTheRightView) {
    constexpr int kDisparities = 16;
    for (const Form& form : kForms)
        for (const int width : {17, 33, 97})
            for (const int first : {-20, -6, 0, 9}) {
                std::mt19937 random(6);
                std::vector<std::vector<Cost>> costs;
                const auto size = static_cast<std::size_t>(width);
                std::vector<Cost> best(size, kNoCost);
                std::vector<std::int16_t> index(size, -1);
                for (int k = 0; k < kDisparities; ++k) {
                    costs.push_back(random_row<Cost>(random, width, 50));
                    form.select_right(costs.back().data(), k, first + k, width, best.data(), index.data());
                }
                for (int x = 0; x < width; ++x) {
                    int winner = -1;
                    int lowest = kNoCost;
                    for (int k = 0; k < kDisparities; ++k) {
                        const int match = x + first + k;
                        if (match < 0 || match >= width) continue;
                        const int cost = costs[static_cast<std::size_t>(k)][static_cast<std::size_t>(match)];
                        if (cost >= lowest) continue;
                        lowest = cost;
                        winner = k;
                    }
                    ASSERT_EQ(index[static_cast<std::size_t>(x)], winner) << form.name << " first " << first;
                }
            }
}

}  // namespace
}  // namespace groundline::stereo
