#include "stereo/paper_kernels.hpp"

#include <algorithm>
#include <cstddef>

// x86-64 builds hold each kernel twice, plain and for AVX2, and the loader picks by the processor: twice as
// fast, the same integers. Elsewhere (and under sanitizers, which come up after the loader) there is one.
#if defined(__x86_64__) && defined(__GLIBC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__) && !defined(GROUNDLINE_PLAIN_KERNELS)
#define GROUNDLINE_KERNEL __attribute__((target_clones("avx2", "default")))
#else
#define GROUNDLINE_KERNEL
#endif
// What kernels share must melt into them, or it would stay plain code.
#define GROUNDLINE_PART [[gnu::always_inline]] inline

namespace groundline::stereo::kernels {
namespace {

// floor(a b / 65536), the high half that every vector unit can give.
GROUNDLINE_PART std::uint16_t high_half(std::uint16_t a, std::uint16_t b) {
    return static_cast<std::uint16_t>((static_cast<std::uint32_t>(a) * b) >> 16U);
}

GROUNDLINE_PART Cost distance(Cost a, Cost b) {
    const auto difference = static_cast<Cost>(a - b);
    const auto negative = static_cast<Cost>(b - a);
    return difference > negative ? difference : negative;
}

// |other - cost| < cost / 2 in whole numbers is |other - cost| < half_up(cost); never so for cost 0.
GROUNDLINE_PART Cost half_up(Cost cost) {
    return static_cast<Cost>((cost + 1) >> 1);
}

// (a + 4) / 9 for every a + 4 that 16 bits hold.
GROUNDLINE_PART Cost mean_of_nine(std::uint16_t sum) {
    return static_cast<Cost>(high_half(static_cast<std::uint16_t>(sum + 4U), 58255U) >> 3U);
}

// All ones where true. With pick() instead of ?: where GCC would make branches of a long selection.
GROUNDLINE_PART Cost mask_if(bool condition) {
    return condition ? -1 : 0;
}
GROUNDLINE_PART Cost pick(Cost mask, Cost yes, Cost no) {
    return static_cast<Cost>(no ^ ((yes ^ no) & mask));
}

template <RuleOne kRule>
GROUNDLINE_PART void rule_one_row(const Cost* __restrict above, const Cost* __restrict here,
                                  const Cost* __restrict below, const Cost* __restrict farther,
                                  const Cost* __restrict nearer, int width, std::uint16_t* __restrict columns,
                                  Cost* __restrict out) {
    for (int x = -1; x <= width; ++x)
        columns[x + 1] = static_cast<std::uint16_t>(above[x] + here[x] + below[x]);
    for (int x = 0; x < width; ++x) {
        const Cost cost = here[x];
        const Cost to_farther = distance(farther[x], cost);
        const Cost to_nearer = distance(nearer[x], cost);
        const Cost closest = to_farther < to_nearer ? to_farther : to_nearer;
        const auto sum = static_cast<std::uint16_t>(columns[x] + columns[x + 1] + columns[x + 2]);
        const Cost wide = kRule == RuleOne::kMean9 ? mean_of_nine(sum) : static_cast<Cost>(sum);
        out[x] = closest < half_up(cost) ? wide : cost;
    }
}

template <RuleTwo kRule, bool kSums>
GROUNDLINE_PART void rule_two_row(const Cost* __restrict above, const Cost* __restrict here,
                                  const Cost* __restrict below, const Cost* __restrict costs, int width,
                                  Cost* __restrict out) {
    for (int x = 0; x < width; ++x) {
        const Cost cost = here[x];
        const Cost half = half_up(cost);
        // Counted downwards, as the all-ones masks that comparisons are; GCC 12 adds ones wrongly here.
        const auto supports = [&](Cost other) __attribute__((always_inline))->Cost {
            return distance(other, cost) < half ? -1 : 0;
        };
        Cost count = kRule == RuleTwo::kSevenOfNine ? supports(cost) : Cost{0};
        count = static_cast<Cost>(count + supports(above[x - 1]));
        count = static_cast<Cost>(count + supports(above[x]));
        count = static_cast<Cost>(count + supports(above[x + 1]));
        count = static_cast<Cost>(count + supports(here[x - 1]));
        count = static_cast<Cost>(count + supports(here[x + 1]));
        count = static_cast<Cost>(count + supports(below[x - 1]));
        count = static_cast<Cost>(count + supports(below[x]));
        count = static_cast<Cost>(count + supports(below[x + 1]));
        const auto whole = static_cast<std::uint16_t>(costs[x]);
        const auto scaled = static_cast<Cost>(kSums ? static_cast<std::uint16_t>(10U * whole / 13U)
                                                    : high_half(whole, 50413U));
        out[x] = count <= -7 ? scaled : costs[x];
    }
}

GROUNDLINE_PART void select_row(const Cost* __restrict costs, int index, int width, Cost* __restrict best,
                                std::int16_t* __restrict best_index) {
    const auto now = static_cast<std::int16_t>(index);
    for (int x = 0; x < width; ++x) {
        const Cost cost = costs[x];
        const Cost old_best = best[x];
        const std::int16_t old_index = best_index[x];
        best[x] = cost < old_best ? cost : old_best;
        best_index[x] = cost < old_best ? now : old_index;
    }
}

GROUNDLINE_PART void select_row_with_evidence(const Cost* __restrict costs, const Cost* __restrict refined,
                                              const Cost* __restrict refined_before, int index, int width,
                                              Cost* __restrict best, std::int16_t* __restrict best_index,
                                              Cost* __restrict before, Cost* __restrict second,
                                              Cost* __restrict lower, Cost* __restrict centre,
                                              Cost* __restrict upper) {
    const auto now = static_cast<std::int16_t>(index);
    const auto previous = static_cast<std::int16_t>(index - 1);
    for (int x = 0; x < width; ++x) {
        // Everything is read and written whatever wins: a loop without branches.
        const Cost cost = costs[x];
        const Cost old_best = best[x];
        const Cost old_before = before[x];
        const Cost old_second = second[x];
        const Cost old_lower = lower[x];
        const Cost old_centre = centre[x];
        const Cost old_upper = upper[x];
        const Cost here = refined[x];
        const Cost there = refined_before[x];
        const std::int16_t old_index = best_index[x];
        const Cost wins = mask_if(cost < old_best);
        // Against a new winner stands the lowest cost of all disparities but the last two; against the old
        // one, this cost too once it is more than one disparity away.
        const Cost rival = old_index < previous ? cost : kNoCost;
        const Cost challenger = rival < old_second ? rival : old_second;
        second[x] = pick(wins, old_before, challenger);
        before[x] = old_best;
        best[x] = pick(wins, cost, old_best);
        best_index[x] = pick(wins, now, old_index);
        lower[x] = pick(wins, there, old_lower);
        centre[x] = pick(wins, here, old_centre);
        upper[x] = pick(mask_if(old_index == previous), here, old_upper);
    }
}

}  // namespace

GROUNDLINE_KERNEL void truncated_differences(const std::uint8_t* __restrict left,
                                             const std::uint8_t* __restrict right, int width, int disparity,
                                             int truncation, std::uint8_t* __restrict out) {
    const auto most = static_cast<std::uint8_t>(truncation);
    const int first = std::clamp(disparity, 0, width);
    const int last = std::clamp(width + disparity, 0, width);
    for (int x = 0; x < first; ++x)
        out[x] = most;
    const std::ptrdiff_t shift = disparity;
    for (int x = first; x < last; ++x) {
        const std::uint8_t a = left[x];
        const std::uint8_t b = right[x - shift];
        const auto difference = static_cast<std::uint8_t>((a > b ? a : b) - (a > b ? b : a));
        out[x] = difference < most ? difference : most;
    }
    for (int x = last; x < width; ++x)
        out[x] = most;
}

GROUNDLINE_KERNEL void weigh_down(const std::array<const std::uint8_t*, 2 * kWindowReach + 1>& rows,
                                  const WindowTaps& taps, int width, std::uint16_t* __restrict out) {
    const std::uint8_t *r0 = rows[0], *r1 = rows[1], *r2 = rows[2], *r3 = rows[3], *r4 = rows[4],
                       *r5 = rows[5], *r6 = rows[6], *r7 = rows[7], *r8 = rows[8], *r9 = rows[9],
                       *r10 = rows[10];
    const std::uint16_t g0 = taps[0], g1 = taps[1], g2 = taps[2], g3 = taps[3], g4 = taps[4], g5 = taps[5];
    for (int x = 0; x < width; ++x) {
        const auto p1 = static_cast<std::uint8_t>(r4[x] + r6[x]);  // at most 2 * 28
        const auto p2 = static_cast<std::uint8_t>(r3[x] + r7[x]);
        const auto p3 = static_cast<std::uint8_t>(r2[x] + r8[x]);
        const auto p4 = static_cast<std::uint8_t>(r1[x] + r9[x]);
        const auto p5 = static_cast<std::uint8_t>(r0[x] + r10[x]);
        out[x] = static_cast<std::uint16_t>(g0 * r5[x] + g1 * p1 + g2 * p2 + g3 * p3 + g4 * p4 + g5 * p5);
    }
}

GROUNDLINE_KERNEL void weigh_across(const std::uint16_t* __restrict in, const WindowTaps& taps, int width,
                                    Cost* __restrict out) {
    const std::uint16_t g0 = taps[0], g1 = taps[1], g2 = taps[2], g3 = taps[3], g4 = taps[4], g5 = taps[5];
    for (int x = 0; x < width; ++x) {
        const std::uint16_t p0 = in[x];  // at most 256 * 28, pairs twice that
        const auto p1 = static_cast<std::uint16_t>(in[x - 1] + in[x + 1]);
        const auto p2 = static_cast<std::uint16_t>(in[x - 2] + in[x + 2]);
        const auto p3 = static_cast<std::uint16_t>(in[x - 3] + in[x + 3]);
        const auto p4 = static_cast<std::uint16_t>(in[x - 4] + in[x + 4]);
        const auto p5 = static_cast<std::uint16_t>(in[x - 5] + in[x + 5]);
        // The sum needs 21 bits. Each p = 32 high + low, and both weighted sums fit 16: 256 * 256 * 28 / 32 =
        // 57344, 256 * 31 + 128 = 8064; floor((32 H + L) / 256) = floor((H + floor(L / 32)) / 8).
        const auto high = static_cast<std::uint16_t>(g0 * (p0 >> 5U) + g1 * (p1 >> 5U) + g2 * (p2 >> 5U) +
                                                     g3 * (p3 >> 5U) + g4 * (p4 >> 5U) + g5 * (p5 >> 5U));
        const auto low =
            static_cast<std::uint16_t>(g0 * (p0 & 31U) + g1 * (p1 & 31U) + g2 * (p2 & 31U) + g3 * (p3 & 31U) +
                                       g4 * (p4 & 31U) + g5 * (p5 & 31U) + 128U);
        const auto sum = static_cast<std::uint16_t>(high + (low >> 5U));
        out[x] = static_cast<Cost>(sum >> 3U);
    }
}

GROUNDLINE_KERNEL void rule_one(RuleOne rule, const Rows& rows, const Cost* farther, const Cost* nearer,
                                int width, std::uint16_t* columns, Cost* out) {
    const auto [above, here, below] = rows;
    if (rule == RuleOne::kOff)
        std::copy_n(here, width, out);
    else if (rule == RuleOne::kMean9)
        rule_one_row<RuleOne::kMean9>(above, here, below, farther, nearer, width, columns, out);
    else
        rule_one_row<RuleOne::kSum9>(above, here, below, farther, nearer, width, columns, out);
}

GROUNDLINE_KERNEL void rule_two(RuleTwo rule, bool sums, const Rows& looked_at, const Cost* costs, int width,
                                Cost* out) {
    const auto [above, here, below] = looked_at;
    if (rule == RuleTwo::kOff)
        std::copy_n(costs, width, out);
    else if (rule == RuleTwo::kSevenOfEight && !sums)
        rule_two_row<RuleTwo::kSevenOfEight, false>(above, here, below, costs, width, out);
    else if (rule == RuleTwo::kSevenOfEight)
        rule_two_row<RuleTwo::kSevenOfEight, true>(above, here, below, costs, width, out);
    else if (!sums)
        rule_two_row<RuleTwo::kSevenOfNine, false>(above, here, below, costs, width, out);
    else
        rule_two_row<RuleTwo::kSevenOfNine, true>(above, here, below, costs, width, out);
}

GROUNDLINE_KERNEL void select(const Cost* costs, int index, int width, const Winners& winners) {
    select_row(costs, index, width, winners.best, winners.index);
}

GROUNDLINE_KERNEL void select_with_evidence(const Cost* costs, const Cost* refined,
                                            const Cost* refined_before, int index, int width,
                                            const Winners& winners) {
    select_row_with_evidence(costs, refined, refined_before, index, width, winners.best, winners.index,
                             winners.before, winners.second, winners.lower, winners.centre, winners.upper);
}

GROUNDLINE_KERNEL void select_right(const Cost* __restrict costs, int index, int disparity, int width,
                                    Cost* __restrict best, std::int16_t* __restrict best_index) {
    const int first = std::clamp(-disparity, 0, width);
    const int last = std::clamp(width - disparity, 0, width);
    const auto now = static_cast<std::int16_t>(index);
    const std::ptrdiff_t shift = disparity;
    for (int x = first; x < last; ++x) {
        const Cost cost = costs[x + shift];
        const Cost old_best = best[x];
        const std::int16_t old_index = best_index[x];
        best[x] = cost < old_best ? cost : old_best;
        best_index[x] = cost < old_best ? now : old_index;
    }
}

}  // namespace groundline::stereo::kernels
