#include "stereo/census_kernels.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stereo/census_kernels.cpp"
#include <hwy/foreach_target.h>  // NOLINT(misc-header-include-cycle): includes this file once per unit
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace groundline::stereo::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Bytes16 = hn::Full128<std::uint8_t>;
using V16 = hn::Vec<Bytes16>;

// --- moving bytes across a whole vector; Highway 1.0 shifts only within 16-byte blocks

// The blocks of `v` one place up; `fill` comes in at the bottom.
template <class D, class V>
HWY_INLINE V BlocksUp([[maybe_unused]] D d, [[maybe_unused]] V v, V fill) {
    if constexpr (hn::MaxLanes(d) == 16)
        return fill;
    else
        return hn::ConcatLowerUpper(d, v, fill);
}

// The blocks of `v` one place down; `fill` comes in at the top.
template <class D, class V>
HWY_INLINE V BlocksDown([[maybe_unused]] D d, [[maybe_unused]] V v, V fill) {
    if constexpr (hn::MaxLanes(d) == 16)
        return fill;
    else
        return hn::ConcatLowerUpper(d, fill, v);
}

// out[i] = v[i - 1], out[0] = the last byte of `before`.
template <class D, class V>
HWY_INLINE V BytesUp(D d, V v, V before) {
    return hn::CombineShiftRightBytes<15>(d, v, BlocksUp(d, v, before));
}
// out[i] = v[i + 1], the last = the first byte of `behind`.
template <class D, class V>
HWY_INLINE V BytesDown(D d, V v, V behind) {
    return hn::CombineShiftRightBytes<1>(d, BlocksDown(d, v, behind), v);
}

// --- the lowest byte of a vector

template <class V>
HWY_INLINE V16 FoldToBlock(Bytes16 /*d*/, V v) {
    return v;
}
template <class D, class V>
HWY_INLINE V16 FoldToBlock([[maybe_unused]] D d, V v) {
    const hn::Half<D> half;
    return FoldToBlock(half, hn::Min(hn::LowerHalf(half, v), hn::UpperHalf(half, v)));
}

// In the lowest byte; the others are meaningless.
template <class D, class V>
HWY_INLINE V16 LowestByte(D d, V v) {
    const Bytes16 d8;
    const hn::Repartition<std::uint16_t, Bytes16> d16;
    const V16 block = FoldToBlock(d, v);
    const auto odd = hn::BitCast(d8, hn::ShiftRight<8>(hn::BitCast(d16, block)));
    const auto pairs = hn::BitCast(d16, hn::Min(block, odd));  // high bytes are 0
#if HWY_TARGET <= HWY_SSE4 && HWY_ARCH_X86
    return V16{_mm_minpos_epu16(pairs.raw)};
#else
    return hn::BitCast(d8, hn::MinOfLanes(d16, pairs));
#endif
}

HWY_INLINE std::uint8_t FirstByte(V16 v) {
    return hn::GetLane(v);
}

// Its lowest byte in every byte of a D.
template <class D>
HWY_INLINE hn::Vec<D> SpreadFirst([[maybe_unused]] D d, V16 v) {
    if constexpr (hn::MaxLanes(d) == 16) {
        return hn::TableLookupBytes(v, hn::Zero(d));
    } else {
#if HWY_TARGET <= HWY_AVX2 && HWY_ARCH_X86
        return hn::Vec<D>{_mm256_broadcastb_epi8(v.raw)};
#else
        return hn::Set(d, hn::GetLane(v));
#endif
    }
}

// --- census

template <bool kMirrored>
HWY_INLINE void CensusRowOf(const std::uint8_t* const* rows, int width, const CensusRow& out) {
    const hn::ScalableTag<std::uint8_t> d;
    const auto half = [&](std::size_t first, int x) HWY_ATTR {
        auto word = hn::Zero(d);
        for (std::size_t i = 0; i < 8; ++i) {
            const SamplePair pair = kCensusPairs[first + i];
            const int dx = kMirrored ? -pair.dx : pair.dx;
            const auto a = hn::LoadU(d, rows[kCensusReachY + pair.dy] + x + dx);
            const auto b = hn::LoadU(d, rows[kCensusReachY - pair.dy] + x - dx);
            const auto bit = hn::Set(d, static_cast<std::uint8_t>(1U << i));
            word = hn::Or(word, hn::IfThenElseZero(hn::Lt(a, b), bit));
        }
        return word;
    };
    for (int x = 0; x < width; x += static_cast<int>(hn::Lanes(d))) {
        hn::StoreU(half(0, x), d, out.low + x);
        if (out.high != nullptr) hn::StoreU(half(8, x), d, out.high + x);
    }
}

void CensusRowAny(const std::array<const std::uint8_t*, 2 * kCensusReachY + 1>& rows, int width,
                  bool mirrored, const CensusRow& out) {
    if (mirrored)
        CensusRowOf<true>(rows.data(), width, out);
    else
        CensusRowOf<false>(rows.data(), width, out);
}

void MirrorRow(const std::uint8_t* in, int width, std::uint8_t* out) {
    const hn::Full128<std::uint8_t> d;
    alignas(16) static constexpr std::uint8_t kBackwards[16] = {15, 14, 13, 12, 11, 10, 9, 8,
                                                                7,  6,  5,  4,  3,  2,  1, 0};
    const auto backwards = hn::Load(d, kBackwards);
    int i = 0;
    for (; i + 16 <= width; i += 16)
        hn::StoreU(hn::TableLookupBytes(hn::LoadU(d, in + width - 16 - i), backwards), d, out + i);
    for (; i < width; ++i)
        out[i] = in[width - 1 - i];
}

// --- paths

// The costs of one pixel: kCount vectors of tag D, disparities ascending.
template <class D, int kCount>
struct Costs {
    hn::Vec<D> v[kCount];
};

template <class D, int kCount>
class Row {
    static constexpr int kLanes = static_cast<int>(hn::MaxLanes(D()));
    using V = hn::Vec<D>;
    using C = Costs<D, kCount>;

  public:
    HWY_INLINE explicit Row(const CensusStep& step)
        : step_(step),
          stride_(cost_bytes(step.disparities)),
          infinite_(hn::Set(d_, 255)),
          small_step_(hn::Set(d_, kSmallStep)),
          large_step_(hn::Set(d_, kLargeStep)) {
        // Beyond the last disparity all costs are infinite.
        const auto lanes = static_cast<std::uint8_t>(step.disparities - (kCount - 1) * kLanes - 1);
        const V lane = hn::Iota(d_, 0);
        beyond_ = hn::VecFromMask(d_, hn::Gt(lane, hn::Set(d_, lanes)));
    }

    HWY_INLINE void AllCosts(std::uint8_t* out) const {
        for (int x = 0; x < step_.width; ++x)
            Store(Differences(x), At(out, x));
    }

    template <bool kStart, bool kAnswer>
    HWY_INLINE void Rightwards() const {
        C before, here, behind, path;
        V16 path_best = hn::Zero(Bytes16());
        here = Downwards(0);
        before = here;
        path = here;  // set at x = 0
        const int last = step_.width - 1;
        for (int x = 0; x <= last; ++x) {
            behind = x < last ? Downwards(x + 1) : here;
            C cost;
            HWY_UNROLL(16)
            for (int i = 0; i < kCount; ++i)
                cost.v[i] = hn::AverageRound(hn::AverageRound(before.v[i], behind.v[i]), here.v[i]);
            cost.v[kCount - 1] = hn::Or(cost.v[kCount - 1], beyond_);
            before = here;
            here = behind;

            std::uint8_t* const down_at = At(step_.down, x);
            C down = cost;
            if (!kStart) down = Step(cost, Load(down_at), hn::Set(d_, step_.down_best[x]));
            Store(down, down_at);
            step_.down_best[x] = FirstByte(Lowest(down));
            if (!kAnswer) continue;

            path = x == 0 ? cost : Step(cost, path, SpreadFirst(d_, path_best));
            path_best = Lowest(path);
            Store(cost, At(step_.smoothed, x));
            HWY_UNROLL(16)
            for (int i = 0; i < kCount; ++i)
                down.v[i] = hn::SaturatedAdd(down.v[i], path.v[i]);
            Store(down, At(step_.sums, x));
        }
    }

    template <bool kSecond>
    HWY_INLINE void Leftwards(CensusWinners winners) const {
        alignas(64) std::uint8_t sum_of[kCount * kLanes + 2 * kWidestVector];
        std::uint8_t* const sums = sum_of + kWidestVector;
        std::fill_n(winners.at_right, step_.width + step_.disparities - 1, std::uint16_t{0xFFFF});
        const int last = step_.width - 1;
        C path;
        V16 path_best = hn::Zero(Bytes16());
        for (int x = last; x >= 0; --x) {
            const C cost = Load(At(step_.smoothed, x));
            path = x == last ? cost : Step(cost, path, SpreadFirst(d_, path_best));
            path_best = Lowest(path);
            C sum = Load(At(step_.sums, x));
            HWY_UNROLL(16)
            for (int i = 0; i < kCount; ++i)
                sum.v[i] = hn::SaturatedAdd(sum.v[i], path.v[i]);
            Store(sum, sums);
            const V16 lowest = Lowest(sum);
            const std::uint8_t best = FirstByte(lowest);
            const int index = FirstEqual(sum, SpreadFirst(d_, lowest));
            winners.index[x] = static_cast<std::uint8_t>(index);
            winners.best[x] = best;
            winners.lower[x] = sums[index - 1];
            winners.upper[x] = sums[index + 1];
            if (kSecond) winners.second[x] = Second(sum, index);
            std::uint16_t& at_right = winners.at_right[x - index + step_.disparities - 1];
            at_right = std::min(at_right, static_cast<std::uint16_t>(best << 8 | (255 - index)));
        }
    }

  private:
    template <class Byte>
    HWY_INLINE Byte* At(Byte* costs, int x) const {
        return costs + static_cast<std::ptrdiff_t>(x) * stride_;
    }
    HWY_INLINE C Load(const std::uint8_t* from) const {
        C costs;
        HWY_UNROLL(16)
        for (int i = 0; i < kCount; ++i)
            costs.v[i] = hn::Load(d_, from + i * kLanes);
        return costs;
    }
    HWY_INLINE void Store(const C& costs, std::uint8_t* to) const {
        HWY_UNROLL(16)
        for (int i = 0; i < kCount; ++i)
            hn::Store(costs.v[i], d_, to + i * kLanes);
    }

    // Twice the differing bits between left pixel x and the right pixels it may match.
    HWY_INLINE C Differences(int x) const {
        const V low = hn::Set(d_, step_.left.low[x]);
        const V high = hn::Set(d_, step_.left.high[x]);
        const std::ptrdiff_t first = step_.width - 1 - x;
        C costs;
        HWY_UNROLL(16)
        for (int i = 0; i < kCount; ++i) {
            const V a = hn::Xor(low, hn::LoadU(d_, step_.right.low + first + i * kLanes));
            const V b = hn::Xor(high, hn::LoadU(d_, step_.right.high + first + i * kLanes));
            const V bits = hn::Add(hn::PopulationCount(a), hn::PopulationCount(b));
            costs.v[i] = hn::Add(bits, bits);
        }
        return costs;
    }

    // The smoothing over rows at x; the row below takes the place of the row above.
    HWY_INLINE C Downwards(int x) const {
        const C below = Differences(x);
        std::uint8_t* const above = At(step_.above, x);
        const C up = Load(above);
        const C here = Load(At(step_.here, x));
        Store(below, above);
        C result;
        HWY_UNROLL(16)
        for (int i = 0; i < kCount; ++i)
            result.v[i] = hn::AverageRound(hn::AverageRound(up.v[i], below.v[i]), here.v[i]);
        return result;
    }

    HWY_INLINE V16 Lowest(const C& costs) const {
        V lowest = costs.v[0];
        HWY_UNROLL(16)
        for (int i = 1; i < kCount; ++i)
            lowest = hn::Min(lowest, costs.v[i]);
        return LowestByte(d_, lowest);
    }

    // The path cost behind `path`, whose lowest is `best`.
    HWY_INLINE C Step(const C& cost, const C& path, V best) const {
        const V jump = hn::Add(best, large_step_);
        C next;
        HWY_UNROLL(16)
        for (int i = 0; i < kCount; ++i) {
            const V here = path.v[i];
            const V below = BytesUp(d_, here, i > 0 ? path.v[i > 0 ? i - 1 : 0] : infinite_);
            const V above =
                BytesDown(d_, here, i + 1 < kCount ? path.v[i + 1 < kCount ? i + 1 : i] : infinite_);
            const V beside = hn::SaturatedAdd(hn::Min(below, above), small_step_);
            const V from = hn::Min(hn::Min(here, jump), beside);
            next.v[i] = hn::SaturatedAdd(hn::Sub(from, best), cost.v[i]);
        }
        return next;
    }

    // The first disparity whose cost equals `value`; there is one.
    HWY_INLINE int FirstEqual(const C& costs, V value) const {
        if constexpr (kCount == 1) {
            return static_cast<int>(hn::FindFirstTrue(d_, hn::Eq(costs.v[0], value)));
        } else {
            V first = infinite_;
            V index = hn::Iota(d_, 0);
            const V lanes = hn::Set(d_, static_cast<std::uint8_t>(kLanes));
            HWY_UNROLL(16)
            for (int i = 0; i < kCount; ++i) {
                first = hn::Min(first, hn::IfThenElse(hn::Eq(costs.v[i], value), index, infinite_));
                index = hn::Add(index, lanes);
            }
            return FirstByte(LowestByte(d_, first));
        }
    }

    HWY_INLINE std::uint8_t Second(const C& costs, int winner) const {
        const V at = hn::Set(d_, static_cast<std::uint8_t>(winner));
        const V one = hn::Set(d_, 1);
        const V lanes = hn::Set(d_, static_cast<std::uint8_t>(kLanes));
        V index = hn::Iota(d_, 0);
        V lowest = infinite_;
        HWY_UNROLL(16)
        for (int i = 0; i < kCount; ++i) {
            const V distance = hn::Or(hn::SaturatedSub(index, at), hn::SaturatedSub(at, index));
            const auto beside = hn::Eq(hn::Min(distance, one), distance);
            lowest = hn::Min(lowest, hn::IfThenElse(beside, infinite_, costs.v[i]));
            index = hn::Add(index, lanes);
        }
        return FirstByte(LowestByte(d_, lowest));
    }

    D d_;
    CensusStep step_;  // a copy: stores of bytes could change the caller's
    std::ptrdiff_t stride_;
    V infinite_;
    V small_step_;
    V large_step_;
    V beyond_;
};

template <class D, int kCount>
HWY_NOINLINE void StepOf(const CensusStep& step, const CensusWinners& winners) {
    const Row<D, kCount> row(step);
    if (!step.answer) {
        step.start ? row.template Rightwards<true, false>() : row.template Rightwards<false, false>();
        return;
    }
    step.start ? row.template Rightwards<true, true>() : row.template Rightwards<false, true>();
    winners.second != nullptr ? row.template Leftwards<true>(winners)
                              : row.template Leftwards<false>(winners);
}

template <class D, int kCount>
HWY_NOINLINE void CostsOf(const CensusStep& step, std::uint8_t* out) {
    Row<D, kCount>(step).AllCosts(out);
}

// Calls what.template operator()<D, kCount>() with the vectors that `disparities` need.
template <class What>
HWY_INLINE void WithVectors(int disparities, const What& what) {
    constexpr int kMost = 256;
    constexpr int kWidest =
        HWY_MIN(kCostVector, static_cast<int>(hn::MaxLanes(hn::ScalableTag<std::uint8_t>())));
    if constexpr (kWidest > 16) {
        if (disparities <= 16) return what.template Call<hn::CappedTag<std::uint8_t, 16>, 1>();
    }
    using D = hn::CappedTag<std::uint8_t, kWidest>;
    const int count = (disparities + kWidest - 1) / kWidest;
    const auto pick = [&]<int... kCounts>(std::integer_sequence<int, kCounts...>) {
        ((count == kCounts + 1 ? what.template Call<D, kCounts + 1>() : void()), ...);
    };
    pick(std::make_integer_sequence<int, kMost / kWidest>());
}

struct StepCall {
    const CensusStep& step;
    const CensusWinners& winners;
    template <class D, int kCount>
    void Call() const {
        StepOf<D, kCount>(step, winners);
    }
};
struct CostsCall {
    const CensusStep& step;
    std::uint8_t* out;
    template <class D, int kCount>
    void Call() const {
        CostsOf<D, kCount>(step, out);
    }
};

void Step(const CensusStep& step, const CensusWinners& winners) {
    WithVectors(step.disparities, StepCall{step, winners});
}
void CostsRow(const CensusStep& step, std::uint8_t* out) {
    WithVectors(step.disparities, CostsCall{step, out});
}

// --- answers

using D16 = hn::ScalableTag<std::int16_t>;
using V16s = hn::Vec<D16>;

// equiangular_q4() by counting: floor((16 m + depth) / (2 depth)) is how many of depth, 3 depth, 5 depth ..
// 15 depth are at most 16 m, as m <= depth where the centre is lowest.
HWY_INLINE V16s EquiangularQ4(V16s lower, V16s centre, V16s upper) {
    const D16 d;
    const V16s depth = hn::Sub(hn::Max(lower, upper), centre);
    const V16s difference = hn::Sub(lower, upper);
    const V16s reach = hn::ShiftLeft<4>(hn::Abs(difference));
    const V16s step = hn::Add(depth, depth);
    V16s odd = depth;
    V16s count = hn::Zero(d);
    HWY_UNROLL(8)
    for (int i = 0; i < 8; ++i) {
        count = hn::Add(count, hn::VecFromMask(d, hn::Gt(odd, reach)));  // -1 where too far
        odd = hn::Add(odd, step);
    }
    const auto fits = hn::AndNot(hn::Lt(hn::Min(lower, upper), centre), hn::Gt(depth, hn::Zero(d)));
    count = hn::IfThenElseZero(fits, hn::Add(count, hn::Set(d, 8)));
    return hn::IfThenElse(hn::Lt(difference, hn::Zero(d)), hn::Neg(count), count);
}

template <bool kChecks>
HWY_INLINE void AnswerRowOf(const CensusAnswer& how, const CensusWinners& winners, std::int16_t* disparity_q4,
                            std::uint8_t* invalid) {
    const D16 d;
    const hn::RebindToUnsigned<D16> du;
    const hn::Rebind<std::uint8_t, D16> d8;
    const auto reason = [&](Invalid which) HWY_ATTR { return hn::Set(d, static_cast<std::int16_t>(which)); };
    const auto load = [&](const std::uint8_t* row, int x)
                          HWY_ATTR { return hn::PromoteTo(d, hn::LoadU(d8, row + x)); };
    const int last = how.disparities - 1;
    if (kChecks && how.left_right_px >= 0) {
        // Local: stores of bytes could change `how` and `winners`.
        const std::uint8_t* const index = winners.index;
        const std::uint16_t* const voted = winners.at_right + last;
        std::uint8_t* const at_right = how.at_right;
        const int count = how.width;
        HWY_UNROLL(4)
        for (std::ptrdiff_t x = 0; x < count; ++x)
            at_right[x] = static_cast<std::uint8_t>(255 - (voted[x - index[x]] & 255));
    }
    const V16s last_index = hn::Set(d, static_cast<std::int16_t>(last));
    const V16s first_disparity = hn::Set(d, static_cast<std::int16_t>(how.min_disparity));
    const V16s width = hn::Set(d, static_cast<std::int16_t>(how.width));
    const auto most = hn::Set(du, static_cast<std::uint16_t>(100 + how.uniqueness_percent));
    for (int x = 0; x < how.width; x += static_cast<int>(hn::Lanes(d))) {
        const V16s index = load(winners.index, x);
        const V16s best = load(winners.best, x);
        const V16s disparity = hn::Add(index, first_disparity);
        V16s answer = hn::ShiftLeft<4>(disparity);
        if (how.subpixel) {
            const V16s offset = EquiangularQ4(load(winners.lower, x), best, load(winners.upper, x));
            const auto inside = hn::And(hn::Gt(index, hn::Zero(d)), hn::Lt(index, last_index));
            answer = hn::Add(answer, hn::IfThenElseZero(inside, offset));
        }
        V16s why = hn::Zero(d);
        if (kChecks) {
            if (how.left_right_px >= 0) {
                const V16s apart = hn::Abs(hn::Sub(load(how.at_right, x), index));
                const auto fails = hn::Gt(apart, hn::Set(d, static_cast<std::int16_t>(how.left_right_px)));
                why = hn::IfThenElseZero(fails, reason(Invalid::kLeftRight));
            }
            if (how.uniqueness_percent >= 0) {
                const V16s second = load(winners.second, x);
                const auto ratio = hn::Lt(hn::Mul(hn::BitCast(du, second), hn::Set(du, 100)),
                                          hn::Mul(hn::BitCast(du, best), most));
                const auto fails = hn::Or(hn::VecFromMask(d, hn::Eq(second, best)),
                                          hn::BitCast(d, hn::VecFromMask(du, ratio)));
                why = hn::IfThenElse(hn::MaskFromVec(fails), reason(Invalid::kUniqueness), why);
            }
            why = hn::IfThenElse(hn::Eq(index, last_index), reason(Invalid::kRangeEdge), why);
            const V16s match = hn::Sub(hn::Iota(d, static_cast<std::int16_t>(x)), disparity);
            const auto within = hn::And(hn::Gt(match, hn::Zero(d)), hn::Lt(match, width));
            why = hn::IfThenElse(within, why, reason(Invalid::kBorder));
            const V16s known = load(invalid, x);
            why = hn::IfThenElse(hn::Eq(known, hn::Zero(d)), why, known);
            if (!how.keep) answer = hn::IfThenElseZero(hn::Eq(why, hn::Zero(d)), answer);
        }
        hn::StoreU(hn::DemoteTo(d8, why), d8, invalid + x);
        hn::StoreU(answer, d, disparity_q4 + x);
    }
}

void AnswerRow(const CensusAnswer& how, const CensusWinners& winners, std::int16_t* disparity_q4,
               std::uint8_t* invalid) {
    if (how.checks)
        AnswerRowOf<true>(how, winners, disparity_q4, invalid);
    else
        AnswerRowOf<false>(how, winners, disparity_q4, invalid);
}

}  // namespace groundline::stereo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace groundline::stereo::kernels {

HWY_EXPORT(CensusRowAny);
HWY_EXPORT(MirrorRow);
HWY_EXPORT(CostsRow);
HWY_EXPORT(Step);
HWY_EXPORT(AnswerRow);

void census_row(const std::array<const std::uint8_t*, 2 * kCensusReachY + 1>& rows, int width, bool mirrored,
                const CensusRow& out) {
    HWY_DYNAMIC_DISPATCH(CensusRowAny)(rows, width, mirrored, out);
}
void mirror_row(const std::uint8_t* in, int width, std::uint8_t* out) {
    HWY_DYNAMIC_DISPATCH(MirrorRow)(in, width, out);
}
void census_costs_row(const CensusStep& step, std::uint8_t* out) {
    HWY_DYNAMIC_DISPATCH(CostsRow)(step, out);
}
void census_step(const CensusStep& step, const CensusWinners& winners) {
    HWY_DYNAMIC_DISPATCH(Step)(step, winners);
}
void census_answer_row(const CensusAnswer& how, const CensusWinners& winners, std::int16_t* disparity_q4,
                       Invalid* invalid) {
    HWY_DYNAMIC_DISPATCH(AnswerRow)(how, winners, disparity_q4, reinterpret_cast<std::uint8_t*>(invalid));
}

}  // namespace groundline::stereo::kernels
#endif
