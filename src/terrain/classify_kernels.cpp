#include "terrain/classify_kernels.hpp"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "terrain/classify_kernels.cpp"
#include <hwy/foreach_target.h>  // NOLINT(misc-header-include-cycle): includes this file once per unit
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace groundline::terrain::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<std::int32_t, 16>;
using V = hn::Vec<D>;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(D()));
using D16 = hn::Rebind<std::int16_t, D>;
using D8 = hn::Rebind<std::uint8_t, D>;
using D64 = hn::Repartition<std::int64_t, D>;

HWY_INLINE V Class(TerrainClass kind) {
    return hn::Set(D(), static_cast<std::int32_t>(kind));
}

void ClassifyAny(const ClassRow& row, const ClassLimits& limits, std::uint8_t* out) {
    const D d;
    const D16 d16;
    const D8 d8;
    const D64 d64;
    const hn::Half<D> half;
    static_assert(sizeof(Limit) == sizeof(std::int64_t));
    const auto* const table = reinterpret_cast<const std::int64_t*>(limits.table);
    const auto* const invalid = reinterpret_cast<const std::uint8_t*>(row.invalid);
    const V step = hn::Set(d, row.ground_step_q20 * kLanes);
    V ground = hn::Add(hn::Set(d, row.ground_q20), hn::Mul(hn::Iota(d, 0), hn::Set(d, row.ground_step_q20)));
    const V first = hn::Set(d, row.first_q4);
    const V last_index = hn::Set(d, limits.size - 1);
    const V size = hn::Set(d, limits.size);
    const V one = hn::Set(d, 1);
    const V last = hn::Set(d, row.last_q20);
    const V edge = hn::Set(d, static_cast<std::int32_t>(Invalid::kRangeEdge));
    for (int u = 0; u < row.count; u += kLanes) {
        const V disparity = hn::PromoteTo(d, hn::LoadU(d16, row.disparity_q4 + u));
        const V reason = hn::PromoteTo(d, hn::LoadU(d8, invalid + u));
        const auto beyond = hn::Lt(disparity, hn::LoadU(d, row.certified_q4 + u));
        V index = hn::Min(hn::Max(hn::Sub(disparity, first), hn::Zero(d)), last_index);
        index = hn::Add(index, hn::IfThenElseZero(beyond, size));
        // Both limits in one look-up of 64 bits: a look-up costs by the element, not by its size.
        const auto first_half = hn::PromoteTo(d64, hn::LowerHalf(index));
        const auto second_half = hn::PromoteTo(d64, hn::UpperHalf(half, index));
        const V low = hn::BitCast(d, hn::GatherIndex(d64, table, first_half));
        const V high = hn::BitCast(d, hn::GatherIndex(d64, table, second_half));
        const V up = hn::ConcatEven(d, high, low);
        const V down = hn::ConcatOdd(d, high, low);
        V kind = hn::And(down, one);  // kTraversable is 1
        kind = hn::IfThenElseZero(hn::Gt(ground, hn::Zero(d)), kind);
        kind = hn::IfThenElse(hn::Gt(ground, down), Class(TerrainClass::kDrop), kind);
        kind = hn::IfThenElse(hn::Lt(ground, up), Class(TerrainClass::kObstacle), kind);
        const V nearer = hn::IfThenElseZero(hn::And(hn::Eq(reason, edge), hn::Lt(ground, last)),
                                            Class(TerrainClass::kObstacle));
        kind = hn::IfThenElse(hn::Eq(reason, hn::Zero(d)), kind, nearer);
        hn::StoreU(hn::DemoteTo(d8, kind), d8, out + u);
        ground = hn::Add(ground, step);
    }
}

void ClassifyEvenAny(const ClassRow& row, const EvenLimits& limits, std::uint8_t* out) {
    const D d;
    const D16 d16;
    const D8 d8;
    const auto* const invalid = reinterpret_cast<const std::uint8_t*>(row.invalid);
    const V step = hn::Set(d, row.ground_step_q20 * kLanes);
    V ground = hn::Add(hn::Set(d, row.ground_q20), hn::Mul(hn::Iota(d, 0), hn::Set(d, row.ground_step_q20)));
    const V up_factor = hn::Set(d, limits.up_q16);
    const V down_factor = hn::Set(d, limits.down_q16);
    const V up_off = hn::Set(d, limits.up_off_q20);
    const V down_off = hn::Set(d, limits.down_off_q20);
    const V offset = hn::Set(d, limits.offset_q20);
    const V uncertain = hn::Set(d, limits.uncertain_q20);
    const V level = hn::Set(d, limits.level ? 1 : 0);
    const V last = hn::Set(d, row.last_q20);
    const V edge = hn::Set(d, static_cast<std::int32_t>(Invalid::kRangeEdge));
    for (int u = 0; u < row.count; u += kLanes) {
        const V disparity = hn::PromoteTo(d, hn::LoadU(d16, row.disparity_q4 + u));
        const V reason = hn::PromoteTo(d, hn::LoadU(d8, invalid + u));
        const V certified = hn::LoadU(d, row.certified_q4 + u);
        const auto within = hn::Or(hn::Gt(disparity, certified), hn::Eq(disparity, certified));
        const V near = hn::Sub(hn::ShiftLeft<16>(disparity), offset);
        const V up = hn::Sub(hn::Mul(disparity, up_factor), up_off);
        const V down = hn::Sub(hn::Mul(disparity, down_factor), down_off);
        const V limit = hn::IfThenElse(within, up, hn::Min(up, hn::Sub(near, uncertain)));
        V kind = hn::IfThenElseZero(hn::And(within, hn::Gt(ground, hn::Zero(d))), level);
        kind = hn::IfThenElse(hn::And(within, hn::Gt(ground, down)), Class(TerrainClass::kDrop), kind);
        kind = hn::IfThenElse(hn::Lt(ground, limit), Class(TerrainClass::kObstacle), kind);
        kind = hn::IfThenElseZero(hn::Gt(near, hn::Zero(d)), kind);
        const V nearer = hn::IfThenElseZero(hn::And(hn::Eq(reason, edge), hn::Lt(ground, last)),
                                            Class(TerrainClass::kObstacle));
        kind = hn::IfThenElse(hn::Eq(reason, hn::Zero(d)), kind, nearer);
        hn::StoreU(hn::DemoteTo(d8, kind), d8, out + u);
        ground = hn::Add(ground, step);
    }
}

}  // namespace groundline::terrain::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace groundline::terrain::kernels {

HWY_EXPORT(ClassifyAny);
HWY_EXPORT(ClassifyEvenAny);

void classify_columns(const ClassRow& row, const ClassLimits& limits, TerrainClass* out) {
    HWY_DYNAMIC_DISPATCH(ClassifyAny)(row, limits, reinterpret_cast<std::uint8_t*>(out));
}

void classify_columns(const ClassRow& row, const EvenLimits& limits, TerrainClass* out) {
    HWY_DYNAMIC_DISPATCH(ClassifyEvenAny)(row, limits, reinterpret_cast<std::uint8_t*>(out));
}

void classify_columns_plain(const ClassRow& row, const EvenLimits& limits, TerrainClass* out) {
    for (int u = 0; u < row.count; ++u) {
        const std::int32_t ground = row.ground_q20 + u * row.ground_step_q20;
        const std::int32_t disparity = row.disparity_q4[u];
        const std::int32_t near = disparity * 65536 - limits.offset_q20;
        const bool within = disparity >= row.certified_q4[u];
        const std::int32_t up = disparity * limits.up_q16 - limits.up_off_q20;
        const std::int32_t down = disparity * limits.down_q16 - limits.down_off_q20;
        const std::int32_t limit = within ? up : std::min(up, near - limits.uncertain_q20);
        out[u] = TerrainClass::kUnknown;
        if (row.invalid[u] != Invalid::kNone) {
            if (row.invalid[u] == Invalid::kRangeEdge && ground < row.last_q20)
                out[u] = TerrainClass::kObstacle;
        } else if (near <= 0) {
            continue;
        } else if (ground < limit) {
            out[u] = TerrainClass::kObstacle;
        } else if (within && ground > down) {
            out[u] = TerrainClass::kDrop;
        } else if (within && ground > 0 && limits.level) {
            out[u] = TerrainClass::kTraversable;
        }
    }
}

void classify_columns_plain(const ClassRow& row, const ClassLimits& limits, TerrainClass* out) {
    for (int u = 0; u < row.count; ++u) {
        const std::int32_t ground = row.ground_q20 + u * row.ground_step_q20;
        if (row.invalid[u] != Invalid::kNone) {
            const bool nearer = row.invalid[u] == Invalid::kRangeEdge && ground < row.last_q20;
            out[u] = nearer ? TerrainClass::kObstacle : TerrainClass::kUnknown;
            continue;
        }
        const std::int32_t disparity = row.disparity_q4[u];
        const std::int32_t index = std::clamp(disparity - row.first_q4, 0, limits.size - 1) +
                                   (disparity < row.certified_q4[u] ? limits.size : 0);
        const Limit& limit = limits.table[index];
        const bool level = (limit.down_q20 & 1) != 0 && ground > 0;
        out[u] = ground < limit.up_q20     ? TerrainClass::kObstacle
                 : ground > limit.down_q20 ? TerrainClass::kDrop
                 : level                   ? TerrainClass::kTraversable
                                           : TerrainClass::kUnknown;
    }
}

}  // namespace groundline::terrain::kernels
#endif
