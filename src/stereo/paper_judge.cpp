#include "stereo/paper_judge.hpp"

#include <algorithm>
#include <cstddef>

#include "core/image.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stereo/paper_judge.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace groundline::stereo::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

const hn::CappedTag<std::int32_t, kRowPadding / sizeof(std::int32_t)> kWide;
const hn::Rebind<std::int16_t, decltype(kWide)> kHalf;
const hn::Rebind<std::uint8_t, decltype(kWide)> kQuarter;
using Wide = hn::Vec<decltype(kWide)>;

HWY_INLINE Wide load(const std::int16_t* from) {
    return hn::PromoteTo(kWide, hn::LoadU(kHalf, from));
}

HWY_INLINE Wide set(int value) {
    return hn::Set(kWide, value);
}

// equiangular_q4() of subpixel.hpp. The magnitude floor((16 m + depth) / (2 depth)) is 0 .. 8: as many as
// there are n from 1 on with 16 m >= (2 n - 1) depth.
HWY_INLINE Wide equiangular(Wide lower, Wide centre, Wide upper) {
    const auto depth = hn::Sub(hn::Max(lower, upper), centre);
    const auto difference = hn::Sub(lower, upper);
    const auto twice = hn::Add(depth, depth);
    auto left = hn::Sub(hn::ShiftLeft<4>(hn::Abs(difference)), depth);
    auto minus_magnitude = hn::Zero(kWide);
    for (int n = 0; n < 8; ++n) {
        minus_magnitude = hn::Add(minus_magnitude, hn::VecFromMask(kWide, hn::Gt(left, set(-1))));
        left = hn::Sub(left, twice);
    }
    const auto sign = hn::ShiftRight<31>(difference);  // -1 or 0
    const auto offset = hn::Sub(sign, hn::Xor(minus_magnitude, sign));
    const auto lowest =
        hn::And(hn::Gt(depth, hn::Zero(kWide)), hn::Eq(hn::Min(hn::Min(lower, upper), centre), centre));
    return hn::IfThenElseZero(lowest, offset);
}

void judge_winners(const WinnerRow& winners, const SearchRange& range, const CheckLimits& limits,
                   std::int16_t* scratch, Invalid* invalid, std::int16_t* disparity_q4) {
    const int last = range.disparities - 1;
    const bool left_right = limits.left_right_px >= 0;
    if (left_right)
        for (int x = 0; x < range.width; ++x) {
            const int match = x - range.min_disparity - winners.index[x];
            scratch[x] = winners.index_right[std::clamp(match, 0, range.width - 1)];
        }
    // 100 cost > percent * 256 * truncation
    const int highest_cost =
        limits.cost_percent < 100 ? limits.cost_percent * 256 * range.truncation / 100 : 32767;
    auto* const reason = reinterpret_cast<std::uint8_t*>(invalid);
    const auto as = [](Invalid why) { return static_cast<int>(why); };
    for (int x = 0; x < range.width; x += static_cast<int>(hn::Lanes(kWide))) {
        const auto index = load(winners.index + x);
        const auto centre = load(winners.centre + x);
        auto why = hn::Zero(kWide);  // kNone
        const auto unless = [&](auto fails, Invalid new_reason)
                                HWY_ATTR { why = hn::IfThenElse(fails, set(as(new_reason)), why); };
        // The first test that fails comes last, over the others.
        if (left_right)
            unless(hn::Gt(hn::Abs(hn::Sub(load(scratch + x), index)), set(limits.left_right_px)),
                   Invalid::kLeftRight);
        if (limits.uniqueness_percent >= 0) {
            const auto best = load(winners.best + x);
            const auto second = load(winners.second + x);
            const auto margin = hn::Mul(hn::Sub(second, set(limits.uniqueness_floor)), set(100));
            const auto needed = hn::Mul(best, set(100 + limits.uniqueness_percent));
            unless(hn::Or(hn::Eq(second, best), hn::Lt(margin, needed)), Invalid::kUniqueness);
        }
        unless(hn::Gt(centre, set(highest_cost)), Invalid::kCost);
        unless(hn::Eq(index, set(last)), Invalid::kRangeEdge);
        const auto match = hn::Sub(hn::Iota(kWide, x - range.min_disparity), index);
        unless(hn::Or(hn::Lt(match, set(1)), hn::Gt(match, set(range.width - 1))), Invalid::kBorder);
        const auto window = hn::PromoteTo(kWide, hn::LoadU(kQuarter, reason + x));
        const auto holds = hn::Eq(window, hn::Zero(kWide));
        why = hn::IfThenElse(holds, why, window);

        auto disparity = hn::ShiftLeft<4>(hn::Add(index, set(range.min_disparity)));
        static_assert(kDisparityOne == 16);
        if (limits.subpixel) {
            const auto inside = hn::And(hn::Gt(index, hn::Zero(kWide)), hn::Lt(index, set(last)));
            const auto offset = equiangular(load(winners.lower + x), centre, load(winners.upper + x));
            disparity = hn::Add(disparity, hn::IfThenElseZero(inside, offset));
        }
        disparity = hn::IfThenElseZero(hn::Eq(why, hn::Zero(kWide)), disparity);
        hn::StoreU(hn::DemoteTo(kHalf, disparity), kHalf, disparity_q4 + x);
        hn::StoreU(hn::DemoteTo(kQuarter, why), kQuarter, reason + x);
    }
}

}  // namespace
}  // namespace groundline::stereo::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace groundline::stereo {

HWY_EXPORT(judge_winners);

void judge_winners(const WinnerRow& winners, const SearchRange& range, const CheckLimits& limits,
                   std::int16_t* scratch, Invalid* invalid, std::int16_t* disparity_q4) {
    HWY_DYNAMIC_DISPATCH(judge_winners)(winners, range, limits, scratch, invalid, disparity_q4);
}

}  // namespace groundline::stereo
#endif
