#include "stereo/paper_kernels.hpp"

#include <algorithm>
#include <cassert>
#include <cstddef>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stereo/paper_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace groundline::stereo::kernels::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr int kWindow = 2 * kWindowReach + 1;

const hn::CappedTag<std::uint8_t, kRowPadding> kBytes;
const hn::CappedTag<std::int16_t, kRowPadding / sizeof(std::int16_t)> kCosts;
const hn::RebindToUnsigned<decltype(kCosts)> kWords;
using Costs = hn::Vec<decltype(kCosts)>;
using Words = hn::Vec<decltype(kWords)>;
using Bytes = hn::Vec<decltype(kBytes)>;

HWY_INLINE int lanes() {
    return static_cast<int>(hn::Lanes(kCosts));
}

// The first and the last pixel in five columns outside at least.
HWY_INLINE void repeat_border(Cost* row, int width) {
    const auto first = hn::Set(kCosts, row[0]);
    const auto last = hn::Set(kCosts, row[width - 1]);
    for (int i = 0; i < kWindowReach; i += lanes()) {
        hn::StoreU(first, kCosts, row - lanes() - i);
        hn::StoreU(last, kCosts, row + width + i);
    }
}

// Weights of two addends, for vectors that have both in turns.
template <typename Tag>
HWY_INLINE auto in_turns(Tag tag, int a, int b) {
    using T = hn::TFromD<Tag>;
    return hn::InterleaveLower(hn::Set(tag, static_cast<T>(a)), hn::Set(tag, static_cast<T>(b)));
}

#undef GROUNDLINE_PAIRS_OF_BYTES
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_SSSE3
#define GROUNDLINE_PAIRS_OF_BYTES 1
// a[2i] w[2i] + a[2i+1] w[2i+1] of bytes, one instruction that Highway does not have yet.
#if HWY_TARGET <= HWY_AVX3
HWY_INLINE Costs weighed_pairs(hn::Vec512<std::uint8_t> a, hn::Vec512<std::int8_t> w) {
    return Costs{_mm512_maddubs_epi16(a.raw, w.raw)};
}
#elif HWY_TARGET <= HWY_AVX2
HWY_INLINE Costs weighed_pairs(hn::Vec256<std::uint8_t> a, hn::Vec256<std::int8_t> w) {
    return Costs{_mm256_maddubs_epi16(a.raw, w.raw)};
}
#else
HWY_INLINE Costs weighed_pairs(hn::Vec128<std::uint8_t> a, hn::Vec128<std::int8_t> w) {
    return Costs{_mm_maddubs_epi16(a.raw, w.raw)};
}
#endif
#else
#define GROUNDLINE_PAIRS_OF_BYTES 0
#endif

void weigh_down(const Shifted& views, int truncation, const WindowTaps& taps, CostRows out) {
    // Interleaving works within blocks of 16 bytes. Its lower and upper halves become the first and the
    // second half of the pixels when the bytes are brought into this order of eights before:
    const hn::Repartition<std::uint32_t, decltype(kBytes)> fours;
    const int blocks = static_cast<int>(hn::Lanes(fours)) / 4;
    HWY_ALIGN std::uint32_t order[kRowPadding / sizeof(std::uint32_t)];
    for (int i = 0; i < 4 * blocks; ++i)
        order[i] = static_cast<std::uint32_t>(i / 4 * 2 + i % 2 + (i % 4 / 2) * 2 * blocks);
    const auto order_of_eights = hn::SetTableIndices(fours, order);

    const auto most = hn::Set(kBytes, static_cast<std::uint8_t>(truncation));
    for (int x = 0; x < out.width; x += 2 * lanes()) {
        const auto outside = hn::LoadU(kBytes, views.outside + x);
        const auto difference = [&](int y) HWY_ATTR {
            const auto a = hn::LoadU(kBytes, views.left.data + y * views.left.stride + x);
            const auto b = hn::LoadU(kBytes, views.right.data + y * views.right.stride + x);
            const auto distance = hn::Or(hn::SaturatedSub(a, b), hn::SaturatedSub(b, a));
            const auto cost = hn::Min(hn::Or(distance, outside), most);
            if (blocks == 1) return cost;
            return hn::BitCast(kBytes, hn::TableLookupLanes(hn::BitCast(fours, cost), order_of_eights));
        };
        Bytes r0 = difference(0), r1 = difference(1), r2 = difference(2), r3 = difference(3),
              r4 = difference(4), r5 = difference(5), r6 = difference(6), r7 = difference(7),
              r8 = difference(8), r9 = difference(9);
#if GROUNDLINE_PAIRS_OF_BYTES
        const hn::RebindToSigned<decltype(kBytes)> signed_bytes;
        const auto w01 = in_turns(signed_bytes, taps[0], taps[1]);
        const auto w23 = in_turns(signed_bytes, taps[2], taps[3]);
        const auto w45 = in_turns(signed_bytes, taps[4], taps[5]);
#else
        const auto zero = hn::Zero(kBytes);
        const auto w0 = hn::Set(kWords, taps[0]);
        const auto w1 = hn::Set(kWords, taps[1]);
        const auto w2 = hn::Set(kWords, taps[2]);
        const auto w3 = hn::Set(kWords, taps[3]);
        const auto w4 = hn::Set(kWords, taps[4]);
        const auto w5 = hn::Set(kWords, taps[5]);
#endif
        for (int y = 0; y < out.height; ++y) {
            const auto r10 = difference(y + kWindow - 1);
            const auto p1 = hn::Add(r4, r6);  // at most 2 * 28
            const auto p2 = hn::Add(r3, r7);
            const auto p3 = hn::Add(r2, r8);
            const auto p4 = hn::Add(r1, r9);
            const auto p5 = hn::Add(r0, r10);
#if GROUNDLINE_PAIRS_OF_BYTES
            const auto lower = hn::Add(hn::Add(weighed_pairs(hn::InterleaveLower(r5, p1), w01),
                                               weighed_pairs(hn::InterleaveLower(p2, p3), w23)),
                                       weighed_pairs(hn::InterleaveLower(p4, p5), w45));
            const auto upper = hn::Add(hn::Add(weighed_pairs(hn::InterleaveUpper(kBytes, r5, p1), w01),
                                               weighed_pairs(hn::InterleaveUpper(kBytes, p2, p3), w23)),
                                       weighed_pairs(hn::InterleaveUpper(kBytes, p4, p5), w45));
#else
            const auto weighed = [&](auto half) HWY_ATTR {
                const auto a = hn::Add(hn::Mul(half(r5), w0), hn::Mul(half(p1), w1));
                const auto b = hn::Add(hn::Mul(half(p2), w2), hn::Mul(half(p3), w3));
                const auto c = hn::Add(hn::Mul(half(p4), w4), hn::Mul(half(p5), w5));
                return hn::BitCast(kCosts, hn::Add(hn::Add(a, b), c));
            };
            const auto lower =
                weighed([&](Bytes v) HWY_ATTR { return hn::BitCast(kWords, hn::InterleaveLower(v, zero)); });
            const auto upper = weighed(
                [&](Bytes v) HWY_ATTR { return hn::BitCast(kWords, hn::InterleaveUpper(kBytes, v, zero)); });
#endif
            Cost* const to = out.data + y * out.stride + x;
            hn::StoreU(lower, kCosts, to);
            hn::StoreU(upper, kCosts, to + lanes());
            r0 = r1;
            r1 = r2;
            r2 = r3;
            r3 = r4;
            r4 = r5;
            r5 = r6;
            r6 = r7;
            r7 = r8;
            r8 = r9;
            r9 = r10;
        }
    }
    for (int y = 0; y < out.height; ++y)
        repeat_border(out.row(y), out.width);
}

// Both as 16 bits, `lower` in the lower half of each block of 16 bytes. Highway 1.0 packs in the other order
// on 32-bit NEON, which its contract leaves open.
template <typename Wide>
HWY_INLINE Costs packed(Wide lower, Wide upper) {
#if HWY_ARCH_ARM_V7
    const hn::Half<decltype(kCosts)> half;
    return hn::Combine(kCosts, hn::DemoteTo(half, upper), hn::DemoteTo(half, lower));
#else
    return hn::ReorderDemote2To(kCosts, lower, upper);
#endif
}

void weigh_across(ConstCostRows in, const WindowTaps& taps, CostRows out) {
    const hn::RepartitionToWide<decltype(kCosts)> wide;
    using Wide = hn::Vec<decltype(wide)>;
    const auto w01 = in_turns(kCosts, taps[0], taps[1]);
    const auto w23 = in_turns(kCosts, taps[2], taps[3]);
    const auto w45 = in_turns(kCosts, taps[4], taps[5]);
    const auto half = hn::Set(wide, 128);
    for (int y = 0; y < out.height; ++y) {
        const Cost* const from = in.row(y);
        Cost* const to = out.row(y);
        for (int x = 0; x < out.width; x += lanes()) {
            const auto before = hn::LoadU(kCosts, from + x - 8);
            const auto here = hn::LoadU(kCosts, from + x);
            const auto after = hn::LoadU(kCosts, from + x + 8);
            const auto p1 = hn::Add(hn::CombineShiftRightBytes<14>(kCosts, here, before),
                                    hn::CombineShiftRightBytes<2>(kCosts, after, here));
            const auto p2 = hn::Add(hn::CombineShiftRightBytes<12>(kCosts, here, before),
                                    hn::CombineShiftRightBytes<4>(kCosts, after, here));
            const auto p3 = hn::Add(hn::LoadU(kCosts, from + x - 3), hn::LoadU(kCosts, from + x + 3));
            const auto p4 = hn::Add(hn::LoadU(kCosts, from + x - 4), hn::LoadU(kCosts, from + x + 4));
            const auto p5 = hn::Add(hn::LoadU(kCosts, from + x - 5), hn::LoadU(kCosts, from + x + 5));

            const auto weighed = [&](Costs p01, Costs p23, Costs p45) HWY_ATTR {
                Wide more = hn::Zero(wide);
                Wide sum = hn::ReorderWidenMulAccumulate(wide, p01, w01, hn::Zero(wide), more);
                sum = hn::ReorderWidenMulAccumulate(wide, p23, w23, sum, more);
                sum = hn::ReorderWidenMulAccumulate(wide, p45, w45, sum, more);
                return hn::ShiftRight<8>(hn::Add(hn::RearrangeToOddPlusEven(sum, more), half));
            };
            const auto lower = weighed(hn::InterleaveLower(here, p1), hn::InterleaveLower(p2, p3),
                                       hn::InterleaveLower(p4, p5));
            const auto upper =
                weighed(hn::InterleaveUpper(kCosts, here, p1), hn::InterleaveUpper(kCosts, p2, p3),
                        hn::InterleaveUpper(kCosts, p4, p5));
            hn::StoreU(packed(lower, upper), kCosts, to + x);
        }
        repeat_border(to, out.width);
    }
}

// |other - cost| < cost / 2 in whole numbers is |other - cost| < half_up(cost); never so for cost 0.
HWY_INLINE Costs half_up(Costs cost) {
    return hn::BitCast(kCosts, hn::AverageRound(hn::BitCast(kWords, cost), hn::Zero(kWords)));
}

HWY_INLINE Words three_across(const Cost* at) {
    return hn::BitCast(kWords, hn::Add(hn::Add(hn::LoadU(kCosts, at - 1), hn::LoadU(kCosts, at)),
                                       hn::LoadU(kCosts, at + 1)));
}

template <RuleOne kRule>
void rule_one_as(ConstCostRows costs, ConstCostRows farther, ConstCostRows nearer, CostRows out) {
    for (int x = 0; x < out.width; x += lanes()) {
        auto above = three_across(costs.data + x);
        auto here = three_across(costs.data + costs.stride + x);
        for (int y = 0; y < out.height; ++y) {
            const std::ptrdiff_t at = (y + 1) * costs.stride + x;
            const auto below = three_across(costs.data + at + costs.stride);
            const auto cost = hn::LoadU(kCosts, costs.data + at);
            const auto to_farther = hn::Abs(hn::Sub(hn::LoadU(kCosts, farther.data + at), cost));
            const auto to_nearer = hn::Abs(hn::Sub(hn::LoadU(kCosts, nearer.data + at), cost));
            const auto consistent = hn::Lt(hn::Min(to_farther, to_nearer), half_up(cost));
            auto sum = hn::Add(hn::Add(above, here), below);
            // (sum + 4) / 9 for every sum + 4 that 16 bits hold.
            if (kRule == RuleOne::kMean9)
                sum =
                    hn::ShiftRight<3>(hn::MulHigh(hn::Add(sum, hn::Set(kWords, 4)), hn::Set(kWords, 58255)));
            hn::StoreU(hn::IfThenElse(consistent, hn::BitCast(kCosts, sum), cost), kCosts,
                       out.data + y * out.stride + x);
            above = here;
            here = below;
        }
    }
    for (int y = 0; y < out.height; ++y)
        repeat_border(out.row(y), out.width);
}

void rule_one(RuleOne rule, ConstCostRows costs, ConstCostRows farther, ConstCostRows nearer, CostRows out) {
    if (rule == RuleOne::kMean9) return rule_one_as<RuleOne::kMean9>(costs, farther, nearer, out);
    if (rule == RuleOne::kSum9) return rule_one_as<RuleOne::kSum9>(costs, farther, nearer, out);
    for (int y = 0; y < out.height; ++y) {
        std::copy_n(costs.row(y + 1), out.width, out.row(y));
        repeat_border(out.row(y), out.width);
    }
}

// floor(10 cost / 13)
template <bool kSums>
HWY_INLINE Costs scaled(Costs cost) {
    const auto whole = hn::BitCast(kWords, cost);
    if (!kSums) return hn::BitCast(kCosts, hn::MulHigh(whole, hn::Set(kWords, 50413)));
    // Too small by one or right; 10 cost - 13 quotient, below 26, says which.
    const auto quotient = hn::MulHigh(whole, hn::Set(kWords, 50412));
    const auto rest = hn::Sub(hn::Mul(whole, hn::Set(kWords, 10)), hn::Mul(quotient, hn::Set(kWords, 13)));
    const auto over = hn::Gt(hn::BitCast(kCosts, rest), hn::Set(kCosts, 12));
    return hn::Sub(hn::BitCast(kCosts, quotient), hn::VecFromMask(kCosts, over));
}

// The lowest and highest of three neighbours.
struct Span {
    Costs lowest;
    Costs highest;
};
HWY_INLINE Span span_of_three(Costs a, Costs b, Costs c) {
    return {hn::Min(hn::Min(a, b), c), hn::Max(hn::Max(a, b), c)};
}

// A mask is a vector of -1 and 0, or costs an instruction to become one.
template <typename Mask>
HWY_INLINE Costs one_less_if(Mask mask, Costs count) {
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3
    return hn::IfThenElse(mask, hn::Sub(count, hn::Set(kCosts, 1)), count);
#else
    return hn::Add(count, hn::VecFromMask(kCosts, mask));
#endif
}

// Where fewer than `enough` of the eight around `at` support it.
HWY_INLINE auto lacks_support(const Cost* at, std::ptrdiff_t stride, int enough) {
    // Near is centre - half_up(centre) < other < centre + half_up(centre). Moved so that the lowest such
    // other becomes the lowest int16, one comparison tells, wrapping round included. For centre 0 almost
    // everything is near: there both results are 0.
    const auto centre = hn::LoadU(kCosts, at);
    const auto lowest = hn::Add(hn::ShiftRight<1>(centre), hn::Set(kCosts, -32767));
    const auto limit = hn::Or(hn::Add(centre, hn::Set(kCosts, 32767)), hn::Set(kCosts, 1));
    auto minus_supporters = hn::Zero(kCosts);
    const auto look = [&](std::ptrdiff_t step) HWY_ATTR {
        const auto moved = hn::Sub(hn::LoadU(kCosts, at + step), lowest);
        minus_supporters = one_less_if(hn::Lt(moved, limit), minus_supporters);
    };
    look(-stride - 1);
    look(-stride);
    look(-stride + 1);
    look(-1);
    look(1);
    look(stride - 1);
    look(stride);
    look(stride + 1);
    return hn::Gt(minus_supporters, hn::Set(kCosts, static_cast<Cost>(-enough)));
}

template <bool kSums>
void rule_two_as(int enough, ConstCostRows looked_at, ConstCostRows costs, CostRows out) {
    const std::ptrdiff_t stride = looked_at.stride;
    const auto across = [](const Cost* at) HWY_ATTR {
        return span_of_three(hn::LoadU(kCosts, at - 1), hn::LoadU(kCosts, at), hn::LoadU(kCosts, at + 1));
    };
    for (int x = 0; x < out.width; x += lanes()) {
        const Cost* at = looked_at.data + stride + x;
        Span above = across(at - stride);
        Span here = across(at);
        for (int y = 0; y < out.height; ++y) {
            const Span below = across(at + stride);
            const auto centre = hn::LoadU(kCosts, at);
            const auto cost = hn::LoadU(kCosts, costs.data + y * costs.stride + x);
            // Nine in ten vectors or more have nothing but supported costs, which the extremes tell.
            const auto lowest = hn::Min(hn::Min(above.lowest, here.lowest), below.lowest);
            const auto highest = hn::Max(hn::Max(above.highest, here.highest), below.highest);
            const auto half = half_up(centre);
            const bool all = hn::AllTrue(kCosts, hn::And(hn::Gt(lowest, hn::Sub(centre, half)),
                                                         hn::Lt(highest, hn::Add(centre, half))));
            auto result = scaled<kSums>(cost);
            if (!all) result = hn::IfThenElse(lacks_support(at, stride, enough), cost, result);
            hn::StoreU(result, kCosts, out.data + y * out.stride + x);
            above = here;
            here = below;
            at += stride;
        }
    }
}

void rule_two(RuleTwo rule, bool sums, ConstCostRows looked_at, ConstCostRows costs, CostRows out) {
    // The centre supports itself.
    const int supporters = rule == RuleTwo::kSevenOfNine ? 6 : 7;
    if (rule == RuleTwo::kOff) {
        for (int y = 0; y < out.height; ++y)
            std::copy_n(costs.row(y), out.width, out.row(y));
    } else if (sums) {
        rule_two_as<true>(supporters, looked_at, costs, out);
    } else {
        rule_two_as<false>(supporters, looked_at, costs, out);
    }
    for (int y = 0; y < out.height; ++y)
        hn::StoreU(hn::Set(kCosts, kNoCost), kCosts, out.row(y) + out.width);
}

void select(const Group& costs, int index, const Winners& winners) {
    const int width = winners.best.width;
    for (int y = 0; y < winners.best.height; ++y)
        for (int x = 0; x < width; x += lanes()) {
            auto best = hn::LoadU(kCosts, winners.best.row(y) + x);
            auto at = hn::LoadU(kCosts, winners.index.row(y) + x);
            for (int i = 0; i < kGroup; ++i) {
                const auto cost = hn::LoadU(kCosts, costs[static_cast<std::size_t>(i)].row(y) + x);
                const auto wins = hn::Lt(cost, best);
                best = hn::Min(cost, best);
                at = hn::IfThenElse(wins, hn::Set(kCosts, static_cast<Cost>(index + i)), at);
            }
            hn::StoreU(best, kCosts, winners.best.row(y) + x);
            hn::StoreU(at, kCosts, winners.index.row(y) + x);
        }
}

void select_with_evidence(const Group& costs, ConstCostRows refined_before, const Group& refined, int index,
                          const Winners& winners) {
    const int width = winners.best.width;
    for (int y = 0; y < winners.best.height; ++y)
        for (int x = 0; x < width; x += lanes()) {
            auto best = hn::LoadU(kCosts, winners.best.row(y) + x);
            auto at = hn::LoadU(kCosts, winners.index.row(y) + x);
            auto before = hn::LoadU(kCosts, winners.before.row(y) + x);
            auto second = hn::LoadU(kCosts, winners.second.row(y) + x);
            auto lower = hn::LoadU(kCosts, winners.lower.row(y) + x);
            auto centre = hn::LoadU(kCosts, winners.centre.row(y) + x);
            auto upper = hn::LoadU(kCosts, winners.upper.row(y) + x);
            auto there = hn::LoadU(kCosts, refined_before.row(y) + x);
            auto won_before = hn::Eq(at, hn::Set(kCosts, static_cast<Cost>(index - 1)));
            for (int i = 0; i < kGroup; ++i) {
                const auto cost = hn::LoadU(kCosts, costs[static_cast<std::size_t>(i)].row(y) + x);
                const auto here = hn::LoadU(kCosts, refined[static_cast<std::size_t>(i)].row(y) + x);
                const auto wins = hn::Lt(cost, best);
                // Against a new winner stands the lowest cost of all disparities but the last two; against
                // the old one, this cost too unless it is the next.
                const auto challenger = hn::IfThenElse(won_before, second, hn::Min(second, cost));
                second = hn::IfThenElse(wins, before, challenger);
                before = best;
                best = hn::Min(cost, best);
                at = hn::IfThenElse(wins, hn::Set(kCosts, static_cast<Cost>(index + i)), at);
                lower = hn::IfThenElse(wins, there, lower);
                centre = hn::IfThenElse(wins, here, centre);
                upper = hn::IfThenElse(won_before, here, upper);
                won_before = wins;
                there = here;
            }
            hn::StoreU(best, kCosts, winners.best.row(y) + x);
            hn::StoreU(at, kCosts, winners.index.row(y) + x);
            hn::StoreU(before, kCosts, winners.before.row(y) + x);
            hn::StoreU(second, kCosts, winners.second.row(y) + x);
            hn::StoreU(lower, kCosts, winners.lower.row(y) + x);
            hn::StoreU(centre, kCosts, winners.centre.row(y) + x);
            hn::StoreU(upper, kCosts, winners.upper.row(y) + x);
        }
}

void select_right(const Group& costs, int index, int disparity, CostRows best,
                  ImageView<std::int16_t> best_index) {
    for (int y = 0; y < best.height; ++y)
        for (int x = 0; x < best.width; x += lanes()) {
            auto lowest = hn::LoadU(kCosts, best.row(y) + x);
            auto at = hn::LoadU(kCosts, best_index.row(y) + x);
            for (int i = 0; i < kGroup; ++i) {
                const Cost* const from = costs[static_cast<std::size_t>(i)].row(y) + x + disparity + i;
                const auto cost = hn::LoadU(kCosts, from);
                const auto wins = hn::Lt(cost, lowest);
                lowest = hn::Min(cost, lowest);
                at = hn::IfThenElse(wins, hn::Set(kCosts, static_cast<Cost>(index + i)), at);
            }
            hn::StoreU(lowest, kCosts, best.row(y) + x);
            hn::StoreU(at, kCosts, best_index.row(y) + x);
        }
}

}  // namespace
}  // namespace groundline::stereo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace groundline::stereo::kernels {

HWY_EXPORT(weigh_down);
HWY_EXPORT(weigh_across);
HWY_EXPORT(rule_one);
HWY_EXPORT(rule_two);
HWY_EXPORT(select);
HWY_EXPORT(select_with_evidence);
HWY_EXPORT(select_right);

CostRows cost_rows(Arena& arena, int width, int height, int left, int right) {
    const int front = kMargin + (left + kMargin - 1) / kMargin * kMargin;
    const CostRows whole = arena.image<Cost>(front + width + right + kMargin, height);
    return {whole.data + front, width, height, whole.stride};
}

void weigh_down(const Shifted& views, int truncation, const WindowTaps& taps, CostRows out) {
    assert(views.left.height == out.height + 2 * kWindowReach && views.right.height == views.left.height);
    HWY_DYNAMIC_DISPATCH(weigh_down)(views, truncation, taps, out);
}

void weigh_across(ConstCostRows in, const WindowTaps& taps, CostRows out) {
    assert(in.same_size(out.width, out.height));
    HWY_DYNAMIC_DISPATCH(weigh_across)(in, taps, out);
}

void rule_one(RuleOne rule, ConstCostRows costs, ConstCostRows farther, ConstCostRows nearer, CostRows out) {
    assert(costs.same_size(out.width, out.height + 2));
    assert(farther.stride == costs.stride && nearer.stride == costs.stride);
    HWY_DYNAMIC_DISPATCH(rule_one)(rule, costs, farther, nearer, out);
}

void rule_two(RuleTwo rule, bool sums, ConstCostRows looked_at, ConstCostRows costs, CostRows out) {
    assert(looked_at.same_size(out.width, out.height + 2) && costs.same_size(out.width, out.height));
    HWY_DYNAMIC_DISPATCH(rule_two)(rule, sums, looked_at, costs, out);
}

void select(const Group& costs, int index, const Winners& winners) {
    HWY_DYNAMIC_DISPATCH(select)(costs, index, winners);
}

void select_with_evidence(const Group& costs, ConstCostRows refined_before, const Group& refined, int index,
                          const Winners& winners) {
    HWY_DYNAMIC_DISPATCH(select_with_evidence)(costs, refined_before, refined, index, winners);
}

void select_right(const Group& costs, int index, int disparity, CostRows best,
                  ImageView<std::int16_t> best_index) {
    HWY_DYNAMIC_DISPATCH(select_right)(costs, index, disparity, best, best_index);
}

}  // namespace groundline::stereo::kernels
#endif
