// Every kernel of the census matchers on every vector unit against a plain loop, at odd widths and odd
// addresses; what a kernel may not write stays as it was.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "stereo/census.hpp"
#include "stereo/census_kernels.hpp"
#include "stereo/pyramid.hpp"
#include "stereo/pyramid_kernels.hpp"
#include "stereo/subpixel.hpp"
#include "support/vector_units.hpp"

namespace groundline::stereo {
namespace {

using kernels::CensusPair;
using kernels::CensusRow;
using kernels::CensusWinners;
using kernels::kBlock;
using kernels::kBlockMargin;
using kernels::kWidestVector;

constexpr int kWidths[] = {1, 7, 15, 16, 17, 31, 33, 63, 64, 65, 97, 130};
constexpr int kOffsets[] = {0, 1, 3, 8, 31, 37, 63};

int up_to(std::mt19937& random, int highest) {
    return static_cast<int>(random() % static_cast<std::uint32_t>(highest + 1));
}

int bits_in(unsigned word) {
    int count = 0;
    for (; word != 0; word &= word - 1)
        ++count;
    return count;
}

// So many elements that may be written, the first `offset` bytes behind a multiple of 64, between canaries.
template <typename T>
class Guarded {
  public:
    Guarded(int count, int offset)
        : count_(static_cast<std::size_t>(count) * sizeof(T)),
          bytes_(3 * kGuard + count_ + static_cast<std::size_t>(offset), kCanary) {
        const auto address = reinterpret_cast<std::uintptr_t>(bytes_.data());
        begin_ = kGuard + (64 - address % 64) % 64 + static_cast<std::size_t>(offset);
    }
    T* data() { return reinterpret_cast<T*>(bytes_.data() + begin_); }
    T& operator[](int i) { return data()[i]; }
    bool intact() const {
        const auto is_canary = [](std::uint8_t byte) { return byte == kCanary; };
        const auto begin = bytes_.begin() + static_cast<std::ptrdiff_t>(begin_);
        return std::all_of(bytes_.begin(), begin, is_canary) &&
               std::all_of(begin + static_cast<std::ptrdiff_t>(count_), bytes_.end(), is_canary);
    }

  private:
    static constexpr std::size_t kGuard = 128;
    static constexpr std::uint8_t kCanary = 0xC7;
    std::size_t count_;
    std::vector<std::uint8_t> bytes_;
    std::size_t begin_ = 0;
};

using Bytes = Guarded<std::uint8_t>;

void fill_random(Bytes& bytes, int count, std::mt19937& random, int highest = 255) {
    for (int i = 0; i < count; ++i)
        bytes[i] = static_cast<std::uint8_t>(up_to(random, highest));
}

// --- census_row, mirror_row

TEST(CensusKernels, CensusRow) {
    on_every_vector_unit([] {
        std::mt19937 random(1);
        for (const int width : kWidths)
            for (const int offset : kOffsets)
                for (const bool mirrored : {false, true}) {
                    const int highest = offset % 2 == 0 ? 255 : 3;  // with many equal pixels
                    constexpr int kRows = 2 * kCensusReachY + 1;
                    const int readable = kCensusReachX + width + kCensusReachX + kWidestVector;
                    std::vector<Bytes> pixels;
                    std::array<const std::uint8_t*, kRows> rows;
                    for (std::size_t j = 0; j < kRows; ++j) {
                        Bytes& row = pixels.emplace_back(readable, (offset + 5 * static_cast<int>(j)) % 64);
                        fill_random(row, readable, random, highest);
                        rows[j] = row.data() + kCensusReachX;
                    }
                    Bytes low(width + kWidestVector, offset);
                    Bytes high(width + kWidestVector, 63 - offset);
                    kernels::census_row(rows, width, mirrored, {low.data(), high.data()});
                    for (int x = 0; x < width; ++x) {
                        unsigned word = 0;
                        for (std::size_t i = 0; i < kCensusPairs.size(); ++i) {
                            const int dx = mirrored ? -kCensusPairs[i].dx : kCensusPairs[i].dx;
                            const int dy = kCensusPairs[i].dy;
                            const std::uint8_t* const below =
                                rows[static_cast<std::size_t>(kCensusReachY + dy)];
                            const std::uint8_t* const above =
                                rows[static_cast<std::size_t>(kCensusReachY - dy)];
                            if (below[x + dx] < above[x - dx]) word |= 1U << i;
                        }
                        ASSERT_EQ(static_cast<unsigned>(low[x] | high[x] << 8), word)
                            << "width " << width << " column " << x << (mirrored ? " mirrored" : "");
                    }
                    EXPECT_TRUE(low.intact() && high.intact()) << "width " << width;
                    Bytes low_alone(width + kWidestVector, 63 - offset);
                    kernels::census_row(rows, width, mirrored, {low_alone.data(), nullptr});
                    EXPECT_TRUE(std::equal(low.data(), low.data() + width, low_alone.data()));
                    EXPECT_TRUE(low_alone.intact());
                }
    });
}

TEST(CensusKernels, MirrorRow) {
    on_every_vector_unit([] {
        std::mt19937 random(2);
        for (const int width : kWidths)
            for (const int offset : kOffsets) {
                Bytes in(width + kWidestVector, offset);
                fill_random(in, width + kWidestVector, random);
                Bytes out(width + kWidestVector, 63 - offset);
                kernels::mirror_row(in.data(), width, out.data());
                for (int i = 0; i < width; ++i)
                    ASSERT_EQ(out[i], in[width - 1 - i]) << "width " << width << " pixel " << i;
                EXPECT_TRUE(out.intact()) << "width " << width;
            }
    });
}

// --- costs, paths, winners

// The rows a step works on, and the same row computed one cost at a time.
struct StepRow {
    int width;
    int disparities;
    int bytes = width * kernels::cost_bytes(disparities);
    int reach = width - 1 + kernels::cost_bytes(disparities);
    Bytes left_low, left_high, right_low, right_high;
    Bytes above, here, down, down_best, smoothed, sums;
    Bytes index, best, lower, upper, second;
    Guarded<std::uint16_t> at_right;

    StepRow(int columns, int range, int offset)
        : width(columns),
          disparities(range),
          left_low(width, offset),
          left_high(width, 63 - offset),
          right_low(reach, offset),
          right_high(reach, (offset + 21) % 64),
          above(bytes, 0),
          here(bytes, 0),
          down(bytes, 0),
          down_best(width, offset),
          smoothed(bytes, 0),
          sums(bytes, 0),
          index(width, offset),
          best(width, offset),
          lower(width, offset),
          upper(width, offset),
          second(width, offset),
          at_right(width + disparities - 1, 2 * (offset / 2)) {}

    int at(int x, int k) const { return x * kernels::cost_bytes(disparities) + k; }
    std::size_t plain(int x, int k) const { return static_cast<std::size_t>(x * disparities + k); }
    kernels::CensusStep step(bool start, bool answer) {
        return {.width = width,
                .disparities = disparities,
                .left = {left_low.data(), left_high.data()},
                .right = {right_low.data(), right_high.data()},
                .above = above.data(),
                .here = here.data(),
                .down = down.data(),
                .down_best = down_best.data(),
                .smoothed = smoothed.data(),
                .sums = sums.data(),
                .start = start,
                .answer = answer};
    }
    CensusWinners winners(bool with_second) {
        return {
            index.data(),   best.data(), lower.data(), upper.data(), with_second ? second.data() : nullptr,
            at_right.data()};
    }
    bool intact() const {
        return above.intact() && here.intact() && down.intact() && down_best.intact() && smoothed.intact() &&
               sums.intact() && index.intact() && best.intact() && lower.intact() && upper.intact() &&
               second.intact() && at_right.intact();
    }
    // Costs of the row below by its words.
    int below(int x, int k) {
        const int j = width - 1 - x + k;
        return 2 * bits_in(static_cast<unsigned>((left_low[x] ^ right_low[j]) | (left_high[x] ^ right_high[j])
                                                                                    << 8));
    }
    void randomise(std::mt19937& random) {
        fill_random(left_low, width, random);
        fill_random(left_high, width, random);
        fill_random(right_low, reach, random);
        fill_random(right_high, reach, random);
    }
};

constexpr int kRanges[] = {16, 32, 48, 64, 96, 112, 128, 208, 256};

TEST(CensusKernels, CensusCostsRow) {
    on_every_vector_unit([] {
        std::mt19937 random(3);
        for (const int disparities : kRanges)
            for (const int width : {1, 17, 64, 97})
                for (const int offset : {0, 1, 37}) {
                    StepRow row(width, disparities, offset);
                    row.randomise(random);
                    kernels::census_costs_row(row.step(true, true), row.here.data());
                    for (int x = 0; x < width; ++x)
                        for (int k = 0; k < disparities; ++k)
                            ASSERT_EQ(row.here[row.at(x, k)], row.below(x, k))
                                << disparities << " disparities, width " << width << " column " << x;
                    EXPECT_TRUE(row.intact());
                }
    });
}

// What Hirschmueller's step makes of the path cost of the pixel before.
std::vector<int> stepped(const std::vector<int>& before, const std::vector<int>& cost) {
    const int lowest = *std::min_element(before.begin(), before.end());
    std::vector<int> path;
    for (std::size_t k = 0; k < cost.size(); ++k) {
        int from = std::min(before[k], lowest + kLargeStep);
        if (k > 0) from = std::min(from, before[k - 1] + kSmallStep);
        if (k + 1 < cost.size()) from = std::min(from, before[k + 1] + kSmallStep);
        path.push_back(cost[k] + from - lowest);
    }
    return path;
}

// Which costs the rows before come with.
enum class Costs { kRandom, kExtreme, kEqual };

int cost_of(Costs costs, int x, int k, std::mt19937& random) {
    if (costs == Costs::kRandom) return up_to(random, 32);
    if (costs == Costs::kExtreme) return k == 5 + x / 24 ? 0 : 32;  // far from it all sums pass 255
    return 32;
}

void check_step(int width, int disparities, int offset, Costs costs, std::mt19937& random, bool& saturated) {
    constexpr int kSteps = 4;
    StepRow row(width, disparities, offset);
    using Row = std::vector<std::vector<int>>;
    Row above(static_cast<std::size_t>(width), std::vector<int>(static_cast<std::size_t>(disparities)));
    Row here = above;
    std::uint8_t* above_at = row.above.data();
    std::uint8_t* here_at = row.here.data();
    const auto set_rows = [&] {
        for (std::size_t x = 0; x < above.size(); ++x)
            for (std::size_t k = 0; k < here[x].size(); ++k) {
                const int column = static_cast<int>(x);
                const int which = static_cast<int>(k);
                above[x][k] = cost_of(costs, column, which, random);
                here[x][k] = cost_of(costs, column, which, random);
                above_at[row.at(column, which)] = static_cast<std::uint8_t>(above[x][k]);
                here_at[row.at(column, which)] = static_cast<std::uint8_t>(here[x][k]);
            }
    };
    set_rows();
    Row down;
    for (int y = 0; y < kSteps; ++y) {
        row.randomise(random);
        if (costs == Costs::kExtreme) {
            if (y > 0) set_rows();
            for (int j = 0; j < row.reach; ++j) {
                // Complements everywhere: every cost of the row below is 32.
                row.right_low[j] = row.right_high[j] = 0xFF;
                if (j < width) row.left_low[j] = row.left_high[j] = 0;
            }
        }
        const bool with_second = y != 3;
        kernels::CensusStep step = row.step(y == 0, y != 1);
        step.above = above_at;
        step.here = here_at;
        kernels::census_step(step, row.winners(with_second));
        std::swap(above_at, here_at);

        const auto last_x = static_cast<std::size_t>(width - 1);
        const auto last_k = static_cast<std::size_t>(disparities - 1);
        Row below = here;
        Row over_rows = here;
        for (std::size_t x = 0; x <= last_x; ++x)
            for (std::size_t k = 0; k <= last_k; ++k) {
                below[x][k] = row.below(static_cast<int>(x), static_cast<int>(k));
                over_rows[x][k] = mean_up(mean_up(above[x][k], below[x][k]), here[x][k]);
            }
        Row cost = over_rows;
        for (std::size_t x = 0; x <= last_x; ++x)
            for (std::size_t k = 0; k <= last_k; ++k)
                cost[x][k] =
                    mean_up(mean_up(over_rows[x == 0 ? 0 : x - 1][k], over_rows[std::min(x + 1, last_x)][k]),
                            over_rows[x][k]);
        if (y == 0)
            down = cost;
        else
            for (std::size_t x = 0; x <= last_x; ++x)
                down[x] = stepped(down[x], cost[x]);
        above = here;
        here = below;
        if (y == 1) continue;

        Row rightwards = cost;
        Row leftwards = cost;
        for (std::size_t x = 1; x <= last_x; ++x) {
            rightwards[x] = stepped(rightwards[x - 1], cost[x]);
            leftwards[last_x - x] = stepped(leftwards[last_x - x + 1], cost[last_x - x]);
        }
        std::vector<int> at_right(static_cast<std::size_t>(width + disparities - 1), 0xFFFF);
        for (std::size_t x = 0; x <= last_x; ++x) {
            std::vector<int> sums;
            for (std::size_t k = 0; k <= last_k; ++k) {
                const int sum = rightwards[x][k] + leftwards[x][k] + down[x][k];
                saturated = saturated || sum > 255;
                sums.push_back(std::min(255, sum));
            }
            const auto best = std::min_element(sums.begin(), sums.end());
            const int index = static_cast<int>(best - sums.begin());
            int second = 255;
            for (int k = 0; k < disparities; ++k)
                if (std::abs(k - index) > 1) second = std::min(second, sums[static_cast<std::size_t>(k)]);
            const int column = static_cast<int>(x);
            const auto where = [&] {
                return std::to_string(disparities) + " disparities, width " + std::to_string(width) +
                       " row " + std::to_string(y) + " column " + std::to_string(column);
            };
            ASSERT_EQ(row.index[column], index) << where();
            ASSERT_EQ(row.best[column], *best) << where();
            if (index > 0) {
                ASSERT_EQ(row.lower[column], *(best - 1)) << where();
            }
            if (index + 1 < disparities) {
                ASSERT_EQ(row.upper[column], *(best + 1)) << where();
            }
            if (with_second) {
                ASSERT_EQ(row.second[column], second) << where();
            }
            int& voted = at_right[x + last_k - static_cast<std::size_t>(index)];
            voted = std::min(voted, *best << 8 | (255 - index));
        }
        for (std::size_t i = 0; i < at_right.size(); ++i)
            ASSERT_EQ(row.at_right[static_cast<int>(i)], at_right[i]) << "vote " << i;
    }
    EXPECT_TRUE(row.intact()) << disparities << " disparities, width " << width;
}

TEST(CensusKernels, CensusStep) {
    on_every_vector_unit([] {
        std::mt19937 random(4);
        for (const Costs costs : {Costs::kRandom, Costs::kExtreme, Costs::kEqual}) {
            bool saturated = false;
            for (const int disparities : kRanges)
                for (const int width : {1, 2, 17, 64, 97}) {
                    check_step(width, disparities, width % 2 == 0 ? 0 : 37, costs, random, saturated);
                    if (testing::Test::HasFatalFailure()) return;
                }
            EXPECT_TRUE(saturated || costs != Costs::kExtreme) << "no sum passed 255: the test is too weak";
        }
    });
}

// --- answers

struct AnswerRow {
    int width;
    Bytes index, best, lower, upper, second;
    Guarded<std::uint16_t> at_right;
    Bytes scratch;
    Guarded<std::int16_t> disparity_q4;
    Guarded<Invalid> invalid;

    AnswerRow(int columns, int disparities, int offset)
        : width(columns),
          index(width + kWidestVector, offset),
          best(width + kWidestVector, offset),
          lower(width + kWidestVector, offset),
          upper(width + kWidestVector, offset),
          second(width + kWidestVector, offset),
          at_right(width + disparities, 2 * (offset / 2)),
          scratch(width + kWidestVector, offset),
          disparity_q4(width + kWidestVector / 2, 2 * (offset / 2)),
          invalid(width + kWidestVector, offset) {}
    CensusWinners winners(bool with_second = true) {
        return {
            index.data(),   best.data(), lower.data(), upper.data(), with_second ? second.data() : nullptr,
            at_right.data()};
    }
};

// The first reason that holds, in the order of CheckLimits.
Invalid reason_of(const kernels::CensusAnswer& how, AnswerRow& row, int x, Invalid known) {
    const int index = row.index[x];
    if (known != Invalid::kNone) return known;
    const int match = x - how.min_disparity - index;
    if (match <= 0 || match >= how.width) return Invalid::kBorder;
    if (index == how.disparities - 1) return Invalid::kRangeEdge;
    if (how.uniqueness_percent >= 0 &&
        (row.second[x] == row.best[x] || 100 * row.second[x] < (100 + how.uniqueness_percent) * row.best[x]))
        return Invalid::kUniqueness;
    const int at_right = 255 - (row.at_right[x - index + how.disparities - 1] & 255);
    if (how.left_right_px >= 0 && std::abs(at_right - index) > how.left_right_px) return Invalid::kLeftRight;
    return Invalid::kNone;
}

TEST(CensusKernels, CensusAnswerRowGivesTheFirstReasonThatHolds) {
    on_every_vector_unit([] {
        std::mt19937 random(5);
        std::array<int, static_cast<std::size_t>(Invalid::kCount)> seen{};
        for (const int width : kWidths)
            for (const int offset : {0, 1, 37})
                for (const int min_disparity : {-2046, -20, 0, 9, 1791})
                    for (const int disparities : {16, 64, 256})
                        for (const int setting : {0, 1, 2, 3, 4, 5}) {
                            AnswerRow row(width, disparities, offset);
                            const kernels::CensusAnswer how{
                                .width = width,
                                .min_disparity = min_disparity,
                                .disparities = disparities,
                                .subpixel = setting != 1,
                                .checks = setting != 0,
                                .keep = setting == 2,
                                .uniqueness_percent = setting == 3 ? -1 : 10 * setting - 10,
                                .left_right_px = setting == 4 ? -1 : setting % 3,
                                .at_right = row.scratch.data()};
                            std::vector<Invalid> known;
                            for (int i = 0; i < width + disparities; ++i)
                                row.at_right[i] = static_cast<std::uint16_t>(random());
                            for (int x = 0; x < width; ++x) {
                                const int index = std::min(up_to(random, disparities - 1) + up_to(random, 3),
                                                           disparities - 1);
                                const int best = up_to(random, 200);
                                row.index[x] = static_cast<std::uint8_t>(index);
                                row.best[x] = static_cast<std::uint8_t>(best);
                                row.lower[x] = static_cast<std::uint8_t>(best + up_to(random, 55));
                                row.upper[x] = static_cast<std::uint8_t>(best + up_to(random, 55));
                                row.second[x] = static_cast<std::uint8_t>(best + up_to(random, best / 3));
                                known.push_back(up_to(random, 4) == 0 ? Invalid::kTexture : Invalid::kNone);
                                row.invalid[x] = known.back();
                                // Most right pixels agree, more or less.
                                if (up_to(random, 3) > 0)
                                    row.at_right[x - index + disparities - 1] = static_cast<std::uint16_t>(
                                        best << 8 | std::clamp(255 - index + up_to(random, 4) - 2, 0, 255));
                            }
                            kernels::census_answer_row(how, row.winners(how.uniqueness_percent >= 0),
                                                       row.disparity_q4.data(), row.invalid.data());
                            for (int x = 0; x < width; ++x) {
                                const int index = row.index[x];
                                int q4 = kDisparityOne * (min_disparity + index);
                                if (how.subpixel && index > 0 && index < disparities - 1)
                                    q4 += equiangular_q4(row.lower[x], row.best[x], row.upper[x]);
                                const Invalid reason =
                                    how.checks ? reason_of(how, row, x, known[static_cast<std::size_t>(x)])
                                               : Invalid::kNone;
                                if (how.checks && !how.keep && reason != Invalid::kNone) q4 = 0;
                                ASSERT_EQ(row.disparity_q4[x], q4)
                                    << "setting " << setting << " width " << width << " column " << x;
                                ASSERT_EQ(row.invalid[x], reason)
                                    << "setting " << setting << " width " << width << " column " << x;
                                ++seen[static_cast<std::size_t>(reason)];
                            }
                            ASSERT_TRUE(row.disparity_q4.intact() && row.invalid.intact())
                                << "width " << width;
                            ASSERT_TRUE(row.scratch.intact());
                        }
        for (const Invalid reason : {Invalid::kNone, Invalid::kBorder, Invalid::kRangeEdge, Invalid::kTexture,
                                     Invalid::kUniqueness, Invalid::kLeftRight})
            EXPECT_GT(seen[static_cast<std::size_t>(reason)], 500)
                << kInvalidNames[static_cast<std::size_t>(reason)];
    });
}

// Every pair of neighbours around a third of all centres, the extremes among them; also where the centre is
// above a neighbour, which a fine winner may be.
TEST(CensusKernels, CensusAnswerRowRefinesEveryTripleOfCosts) {
    constexpr int kWidth = 256;
    constexpr int kDisparities = 64;
    std::vector<int> centres;
    for (int best = 0; best < 256; ++best)
        if (best < 6 || best > 250 || best % 5 == 0) centres.push_back(best);
    on_every_vector_unit([&] {
        AnswerRow row(kWidth, kDisparities, 0);
        const kernels::CensusAnswer how{.width = kWidth,
                                        .min_disparity = 0,
                                        .disparities = kDisparities,
                                        .subpixel = true,
                                        .checks = false,
                                        .keep = false,
                                        .uniqueness_percent = -1,
                                        .left_right_px = -1,
                                        .at_right = row.scratch.data()};
        std::fill_n(row.index.data(), kWidth, std::uint8_t{20});
        for (int upper = 0; upper < kWidth; ++upper)
            row.upper[upper] = static_cast<std::uint8_t>(upper);
        for (const int best : centres)
            for (int lower = 0; lower < 256; ++lower) {
                std::fill_n(row.best.data(), kWidth, static_cast<std::uint8_t>(best));
                std::fill_n(row.lower.data(), kWidth, static_cast<std::uint8_t>(lower));
                kernels::census_answer_row(how, row.winners(false), row.disparity_q4.data(),
                                           row.invalid.data());
                for (int upper = 0; upper < kWidth; ++upper)
                    if (row.disparity_q4[upper] != 20 * kDisparityOne + equiangular_q4(lower, best, upper))
                        FAIL() << "costs " << lower << " " << best << " " << upper << " give "
                               << row.disparity_q4[upper] - 20 * kDisparityOne << "/16 px";
            }
    });
}

// --- the pyramid's kernels

int whole_blocks(int width) {
    return (width + kBlock - 1) / kBlock * kBlock;
}

TEST(CensusKernels, PredictRow) {
    on_every_vector_unit([] {
        std::mt19937 random(6);
        for (const int width : kWidths)
            for (const int offset : {0, 1, 37})
                for (const int min_disparity : {-2046, -33, 0, 21, 1791})
                    for (const int disparities : {16, 64, 256})
                        for (const bool with_thin : {false, true}) {
                            const CoarseRange range = coarse_range(min_disparity, disparities);
                            const int pairs = (width + 1) / 2;
                            const int blocks = whole_blocks(width);
                            Guarded<std::int16_t> coarse(pairs + kWidestVector / 2, 2 * (offset / 2));
                            Guarded<Invalid> reasons(pairs + kWidestVector, offset);
                            Bytes thin(width + kWidestVector, offset);
                            for (int i = 0; i < pairs; ++i) {
                                // What the coarse level may answer: half a step beyond its range.
                                coarse[i] = static_cast<std::int16_t>(
                                    kDisparityOne * range.min_disparity +
                                    up_to(random, kDisparityOne * (range.disparities - 1) + 8));
                                reasons[i] = static_cast<Invalid>(
                                    std::max(0, up_to(random, 2 * static_cast<int>(Invalid::kRangeEdge)) -
                                                    static_cast<int>(Invalid::kRangeEdge)));
                            }
                            for (int x = 0; x < width; ++x)
                                thin[x] = static_cast<std::uint8_t>(
                                    up_to(random, 3) == 0 ? up_to(random, disparities - 1) : 0);
                            Bytes low(blocks, offset);
                            Bytes index(blocks, 63 - offset);
                            Guarded<Invalid> against(blocks, offset);
                            kernels::predict_row({.disparity_q4 = coarse.data(),
                                                  .invalid = reasons.data(),
                                                  .thin = with_thin ? thin.data() : nullptr,
                                                  .width = width,
                                                  .min_disparity = min_disparity,
                                                  .disparities = disparities},
                                                 {low.data(), index.data(), against.data()});
                            for (int i = 0; i < blocks; ++i) {
                                const int x = std::min(i, width - 1);
                                int q4 = std::clamp(2 * coarse[x / 2], kDisparityOne * min_disparity,
                                                    kDisparityOne * (min_disparity + disparities - 1));
                                Invalid reason = reasons[x / 2];
                                if (with_thin && thin[x] != 0) {
                                    q4 = kDisparityOne * (min_disparity + thin[x]);
                                    reason = Invalid::kNone;
                                }
                                ASSERT_EQ(low[i], q4 & 255) << "width " << width << " column " << i;
                                ASSERT_EQ(index[i], ((q4 + kDisparityOne / 2) >> 4) - min_disparity)
                                    << "width " << width << " column " << i;
                                ASSERT_EQ(against[i], reason) << "width " << width << " column " << i;
                            }
                            ASSERT_TRUE(low.intact() && index.intact() && against.intact())
                                << "width " << width;
                        }
    });
}

// Rows of narrow pairs of both views. Columns outside the left image are noise; the right one repeats its
// ends as far as the disparities reach, noise beyond.
class WordRows {
  public:
    // `shift(x, row)`: the disparity whose right word the left one nearly equals.
    template <typename Shift>
    WordRows(int width, int count, int min_disparity, int disparities, int offset, std::mt19937& random,
             Shift shift)
        : width_(width), min_disparity_(min_disparity) {
        const int blocks = whole_blocks(width);
        const int longest = std::max(0, min_disparity + disparities);
        before_ = kBlockMargin + kWidestVector + longest;
        const int behind = kBlockMargin + kWidestVector + blocks - width + std::max(0, -min_disparity);
        planes_.reserve(static_cast<std::size_t>(2 * count));
        for (int r = 0; r < count; ++r) {
            Bytes& left = planes_.emplace_back(before_ + width + behind, offset);
            Bytes& right = planes_.emplace_back(before_ + width + behind, 63 - offset);
            fill_random(left, before_ + width + behind, random);
            fill_random(right, before_ + width + behind, random);
            for (int x = 1; x <= std::max(0, min_disparity + disparities - 1); ++x)
                right[before_ - x] = right[before_];
            for (int x = 0; x < std::max(0, -min_disparity); ++x)
                right[before_ + width + x] = right[before_ + width - 1];
            for (int x = 0; x < width; ++x) {
                const int match = std::clamp(x - shift(x, r), 0, width - 1);
                const auto flipped = static_cast<std::uint8_t>(
                    up_to(random, 1) == 0 ? 0 : 1U << static_cast<unsigned>(up_to(random, 7)));
                left[before_ + x] = right[before_ + match] ^ flipped;
            }
            rows.push_back({left.data() + before_, right.data() + before_});
        }
    }
    int difference(int x, int row, int k) const {
        x = std::clamp(x, 0, width_ - 1);
        const int match = std::clamp(x - min_disparity_ - k, 0, width_ - 1);
        const CensusPair& at = rows[static_cast<std::size_t>(row)];
        return bits_in(static_cast<unsigned>(at.left[x] ^ at.right[match]));
    }
    std::vector<CensusPair> rows;

  private:
    int width_;
    int min_disparity_;
    int before_;
    std::vector<Bytes> planes_;
};

TEST(CensusKernels, ThinBlock) {
    on_every_vector_unit([] {
        std::mt19937 random(7);
        int found = 0;
        int refused = 0;
        struct Range {
            int min;
            int count;
        };
        for (const Range range : {Range{0, 32}, Range{-20, 48}, Range{7, 256}})
            for (const int width : {11, 64, 65, 97, 130})
                for (const int count : {1, 5, kernels::kMostThinRows}) {
                    if (range.count > 200 && (width != 97 || count != 5)) continue;
                    const int offset = width % 64;
                    const int far = range.min + 3;
                    const int near = range.min + 15;
                    // Things 1 to 4 px wide before a far background, some of them short.
                    const WordRows words(width, count + kThinRows - 1, range.min, range.count, offset, random,
                                         [&](int x, int r) {
                                             const bool at_end = x < 4 || x >= width - 4;
                                             const bool thing =
                                                 at_end || (x % 16 < 1 + x / 16 % 4 && (x < 60 || r < 7));
                                             return thing ? near : far;
                                         });
                    const int blocks = whole_blocks(width);
                    Bytes predicted(count * blocks, 63 - offset);
                    for (int i = 0; i < count * blocks; ++i)
                        predicted[i] = static_cast<std::uint8_t>(
                            up_to(random, 9) == 0 ? up_to(random, range.count - 1) : 3 + up_to(random, 2));
                    // A block to the side of each written one must stay as it was.
                    Bytes nearer(count * 3 * kBlock, offset);
                    for (int first_x = 0; first_x < width; first_x += kBlock) {
                        std::fill_n(nearer.data(), count * 3 * kBlock, std::uint8_t{99});
                        kernels::thin_block({.rows = words.rows.data(),
                                             .count = count,
                                             .first_x = first_x,
                                             .width = width,
                                             .min_disparity = range.min,
                                             .disparities = range.count,
                                             .predicted = predicted.data() + first_x,
                                             .predicted_stride = blocks,
                                             .nearer = nearer.data() + kBlock,
                                             .nearer_stride = 3 * kBlock});
                        for (int r = 0; r < count; ++r)
                            for (int i = 0; i < 3 * kBlock; ++i) {
                                const int got = nearer[r * 3 * kBlock + i];
                                if (i < kBlock || i >= 2 * kBlock) {
                                    ASSERT_EQ(got, 99) << "written beside the block, row " << r;
                                    continue;
                                }
                                const int x = first_x + i - kBlock;
                                if (x >= width) continue;
                                const int at = predicted[r * blocks + x];
                                int lowest_predicted = 255;
                                int lowest = 255;
                                int index = 0;
                                for (int k = 0; k < range.count; ++k) {
                                    if (k - at < kThinNearer && std::abs(k - at) > kThinPredictedWithin)
                                        continue;
                                    int cost = 0;
                                    for (int j = 0; j < kThinRows; ++j)
                                        for (int side = -1; side <= 1; ++side)
                                            cost += words.difference(x + side, r + j, k);
                                    if (std::abs(k - at) <= kThinPredictedWithin)
                                        lowest_predicted = std::min(lowest_predicted, cost);
                                    else if (cost < lowest) {
                                        lowest = cost;
                                        index = k;
                                    }
                                }
                                const int match = x - range.min - index;
                                const bool good = 2 * lowest < lowest_predicted && lowest <= kThinHighest &&
                                                  match >= 0 && match < width;
                                ASSERT_EQ(got, good ? index : 0) << "width " << width << " row " << r
                                                                 << " column " << x << " from " << range.min;
                                ++(good && index > 0 ? found : refused);
                            }
                    }
                    EXPECT_TRUE(nearer.intact());
                }
        EXPECT_GT(found, 300);
        EXPECT_GT(refused, 300);
    });
}

void check_fine_block(int width, int min_disparity, int disparities, bool checks, std::mt19937& random) {
    constexpr int kRows = kernels::kFineRows;
    constexpr int kPairs = kRows / 2;
    const int last = disparities - 1;
    const int blocks = whole_blocks(width);
    const int offset = width % 64;
    const WordRows words(width, kRows + 2 * kFineWindowReach, min_disparity, disparities, offset, random,
                         [&](int x, int) { return min_disparity + (x / 9 * 5) % disparities; });
    Bytes low(kPairs * blocks, offset);
    Bytes index(kPairs * blocks, 63 - offset);
    Guarded<Invalid> against(kPairs * blocks, offset);
    std::vector<int> predicted_q4;
    for (int i = 0; i < kPairs * blocks; ++i) {
        // Often right, at times anywhere, at both ends of the range too.
        const int x = i % blocks;
        int q4 = kDisparityOne * (min_disparity + (x / 9 * 5) % disparities) + up_to(random, 40) - 20;
        if (x % 40 >= 20) q4 = kDisparityOne * min_disparity + up_to(random, kDisparityOne * disparities);
        q4 = std::clamp(q4, kDisparityOne * min_disparity, kDisparityOne * (min_disparity + last));
        predicted_q4.push_back(q4);
        low[i] = static_cast<std::uint8_t>(q4 & 255);
        index[i] = static_cast<std::uint8_t>(((q4 + kDisparityOne / 2) >> 4) - min_disparity);
        against[i] = up_to(random, 3) == 0 ? Invalid::kLeftRight : Invalid::kNone;
        // A whole group that may be left out.
        if (x < 32 && i / blocks != 1) against[i] = Invalid::kUniqueness;
    }
    std::vector<Bytes> planes;
    for (int i = 0; i < 4 * kRows; ++i)
        planes.emplace_back(blocks, (offset + i) % 64);
    const auto plane = [&](int row, int which) {
        return planes[static_cast<std::size_t>(4 * row + which)].data();
    };
    kernels::FineBlock block{};
    for (std::size_t j = 0; j < block.rows.size(); ++j)
        block.rows[j] = words.rows[j];
    block.width = width;
    block.min_disparity = min_disparity;
    block.disparities = disparities;
    block.checks = checks;
    for (int x = 0; x < width; x += kBlock) {
        block.first_x = x;
        for (int j = 0; j < kPairs; ++j)
            block.predictions[static_cast<std::size_t>(j)] = {
                low.data() + j * blocks + x, index.data() + j * blocks + x, against.data() + j * blocks + x};
        for (int r = 0; r < kRows; ++r)
            block.winners[static_cast<std::size_t>(r)] = {plane(r, 0) + x, plane(r, 1) + x, plane(r, 2) + x,
                                                          plane(r, 3) + x, nullptr,         nullptr};
        kernels::fine_block(block);
    }
    const auto cost_of = [&](int x, int r, int k, int q4) {
        const auto column = [&](int u) {
            int sum = 0;
            for (int j = 0; j <= 2 * kFineWindowReach; ++j)
                sum += words.difference(u, r + j, k);
            return sum;
        };
        const int window = mean_up(column(x - 3) + column(x + 3), column(x - 2) + column(x + 2)) +
                           mean_up(column(x - 1) + column(x + 1), 2 * column(x));
        return std::min(255, window + std::abs(kDisparityOne * (min_disparity + k) - q4));
    };
    for (int r = 0; r < kRows; ++r)
        for (int x = 0; x < width; ++x) {
            const int i = r / 2 * blocks + x;
            if (checks && against[i] != Invalid::kNone) continue;
            const int q4 = predicted_q4[static_cast<std::size_t>(i)];
            int best = -1;
            int lowest = 256;
            for (int k = 0; k <= last; ++k) {
                if (std::abs(kDisparityOne * (min_disparity + k) - q4) > kFineReachQ4) continue;
                const int cost = cost_of(x, r, k, q4);
                if (cost >= lowest) continue;
                best = k;
                lowest = cost;
            }
            const auto where = [&] {
                return "width " + std::to_string(width) + " from " + std::to_string(min_disparity) + " row " +
                       std::to_string(r) + " column " + std::to_string(x);
            };
            ASSERT_EQ(plane(r, 0)[x], best) << where();
            ASSERT_EQ(plane(r, 1)[x], lowest) << where();
            if (best > 0 && best < last) {
                ASSERT_EQ(plane(r, 2)[x], cost_of(x, r, best - 1, q4)) << where();
                ASSERT_EQ(plane(r, 3)[x], cost_of(x, r, best + 1, q4)) << where();
            }
        }
    for (const Bytes& written : planes)
        ASSERT_TRUE(written.intact()) << "width " << width;
}

TEST(CensusKernels, FineBlock) {
    on_every_vector_unit([] {
        std::mt19937 random(8);
        struct Range {
            int min;
            int count;
        };
        for (const Range range :
             {Range{0, 16}, Range{-21, 32}, Range{9, 64}, Range{0, 256}, Range{-1700, 48}})
            for (const int width : {11, 32, 33, 64, 65, 97, 130})
                for (const bool checks : {false, true}) {
                    check_fine_block(width, range.min, range.count, checks, random);
                    if (testing::Test::HasFatalFailure()) return;
                }
    });
}

TEST(CensusKernels, VoteRow) {
    on_every_vector_unit([] {
        std::mt19937 random(9);
        for (const int width : kWidths)
            for (const int offset : kOffsets)
                for (const int disparities : {16, 64, 256}) {
                    const int blocks = whole_blocks(width);
                    const int votes = width + disparities - 1;
                    Bytes index(blocks, offset);
                    Bytes best(blocks, 63 - offset);
                    Guarded<Invalid> against(blocks, offset);
                    Guarded<Invalid> invalid(width + kWidestVector, 63 - offset);
                    Guarded<std::uint16_t> at_right(votes, 2 * (offset / 2));
                    Guarded<std::uint16_t> keys(blocks, 2 * (offset / 2));
                    std::vector<Invalid> known;
                    for (int i = 0; i < blocks; ++i) {
                        index[i] = static_cast<std::uint8_t>(up_to(random, disparities - 1) / (i % 2 + 1));
                        best[i] = static_cast<std::uint8_t>(up_to(random, 7));  // with many ties
                        if (offset % 2 == 0) best[i] = static_cast<std::uint8_t>(up_to(random, 240));
                        against[i] = up_to(random, 2) == 0 ? Invalid::kUniqueness : Invalid::kNone;
                    }
                    for (int x = 0; x < width; ++x) {
                        known.push_back(up_to(random, 3) == 0 ? Invalid::kTexture : Invalid::kNone);
                        invalid[x] = known.back();
                    }
                    kernels::vote_row(width, disparities, against.data(),
                                      {index.data(), best.data(), nullptr, nullptr, nullptr, at_right.data()},
                                      keys.data(), invalid.data());
                    std::vector<int> expected(static_cast<std::size_t>(votes), 0xFFFF);
                    for (int x = 0; x < width; ++x) {
                        const Invalid before = known[static_cast<std::size_t>(x)];
                        ASSERT_EQ(invalid[x], before != Invalid::kNone ? before : against[x])
                            << "width " << width << " column " << x;
                        if (against[x] != Invalid::kNone) continue;
                        int& voted = expected[static_cast<std::size_t>(x - index[x] + disparities - 1)];
                        voted = std::min(voted, best[x] << 8 | (255 - index[x]));
                    }
                    for (int i = 0; i < votes; ++i) {
                        const int wanted = expected[static_cast<std::size_t>(i)];
                        // Where nothing points to, what the left-out pixels leave is as good as nothing.
                        const bool as_wanted =
                            wanted == 0xFFFF ? at_right[i] >= 0xFF00 : at_right[i] == wanted;
                        ASSERT_TRUE(as_wanted) << "width " << width << " vote " << i;
                    }
                    ASSERT_TRUE(invalid.intact() && at_right.intact() && keys.intact()) << "width " << width;
                }
    });
}

}  // namespace
}  // namespace groundline::stereo
