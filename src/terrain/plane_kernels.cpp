#include "terrain/plane_kernels.hpp"

// 32-bit NEON divides by an approximation and flushes small numbers to zero; there it is plain arithmetic.
#if defined(__arm__)
#define HWY_DISABLED_TARGETS HWY_NEON
#endif
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "terrain/plane_kernels.cpp"
#include <hwy/foreach_target.h>  // NOLINT(misc-header-include-cycle): includes this file once per unit
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace groundline::terrain::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kSampleLanes>;
using V = hn::Vec<D>;
constexpr std::size_t kLanes = hn::MaxLanes(D());
static_assert(kSampleLanes % kLanes == 0);

struct Plane {
    V du, dv, d0, offset, tolerance;
};
HWY_INLINE Plane Spread(const PlaneWeights& plane) {
    const D d;
    return {hn::Set(d, plane.du), hn::Set(d, plane.dv), hn::Set(d, plane.d0), hn::Set(d, plane.offset_px),
            hn::Set(d, plane.tolerance_px)};
}

struct Seen {
    V ground, residual, weight;
};
// reach_px() and Tukey's weight, operation by operation.
HWY_INLINE Seen Weigh(const Plane& plane, V u, V v, V d_px) {
    const D d;
    const V expected = hn::Add(hn::Add(hn::Mul(plane.du, u), hn::Mul(plane.dv, v)), plane.d0);
    const V ground = hn::Sub(expected, plane.offset);
    const V residual = hn::Sub(d_px, expected);
    const V most = hn::Min(hn::Set(d, kMostReachPx), hn::Mul(hn::Set(d, kReachShare), ground));
    const V far = hn::Add(hn::Set(d, kFarReachPx), hn::Mul(hn::Set(d, kFarReachShare), ground));
    const V reach = hn::Min(hn::Max(plane.tolerance, most), far);
    const V t = hn::Div(residual, reach);
    const V one = hn::Set(d, 1.0F);
    const V inside = hn::Max(hn::Zero(d), hn::Sub(one, hn::Mul(t, t)));
    const V weight = hn::IfThenElseZero(hn::Ge(ground, one), hn::Mul(inside, inside));
    return {ground, residual, weight};
}

HWY_INLINE double InOrder(const float* partial) {
    double sum = 0.0;
    for (std::size_t i = 0; i < kSampleLanes; ++i)
        sum += static_cast<double>(partial[i]);
    return sum;
}

PlaneMoments MomentsAny(const Samples& samples, const PlaneWeights& weights) {
    const D d;
    const Plane plane = Spread(weights);
    alignas(32) float partial[9][kSampleLanes];
    // Lane by lane of the eight, as many at once as the unit holds.
    for (std::size_t part = 0; part < kSampleLanes; part += kLanes) {
        V w = hn::Zero(d), wu = w, wv = w, wuu = w, wuv = w, wvv = w, wr = w, wur = w, wvr = w;
        for (std::size_t i = part; i < samples.count; i += kSampleLanes) {
            const V u = hn::LoadU(d, samples.u + i);
            const V v = hn::LoadU(d, samples.v + i);
            const Seen seen = Weigh(plane, u, v, hn::LoadU(d, samples.d_px + i));
            const V weight = seen.weight;
            const V by_u = hn::Mul(weight, u);
            const V by_v = hn::Mul(weight, v);
            // A weight of 0 times a residual far off is 0.
            const V by_r = hn::Mul(weight, seen.residual);
            w = hn::Add(w, weight);
            wu = hn::Add(wu, by_u);
            wv = hn::Add(wv, by_v);
            wuu = hn::Add(wuu, hn::Mul(by_u, u));
            wuv = hn::Add(wuv, hn::Mul(by_u, v));
            wvv = hn::Add(wvv, hn::Mul(by_v, v));
            wr = hn::Add(wr, by_r);
            wur = hn::Add(wur, hn::Mul(by_r, u));
            wvr = hn::Add(wvr, hn::Mul(by_r, v));
        }
        const V sums[9] = {w, wu, wv, wuu, wuv, wvv, wr, wur, wvr};
        for (int k = 0; k < 9; ++k)
            hn::StoreU(sums[k], d, partial[k] + part);
    }
    PlaneMoments moments{};
    for (std::size_t k = 0; k < moments.size(); ++k)
        moments[k] = InOrder(partial[k]);
    return moments;
}

double BeneathAny(const Samples& samples, const PlaneWeights& weights, float below_px, float ground_px) {
    const D d;
    const Plane plane = Spread(weights);
    const V below = hn::Set(d, -below_px);
    const V nearest = hn::Set(d, ground_px);
    const V absent = hn::Set(d, 0.5F * kNoSample);
    alignas(32) float partial[kSampleLanes];
    for (std::size_t part = 0; part < kSampleLanes; part += kLanes) {
        V count = hn::Zero(d);
        for (std::size_t i = part; i < samples.count; i += kSampleLanes) {
            const V d_px = hn::LoadU(d, samples.d_px + i);
            const Seen seen = Weigh(plane, hn::LoadU(d, samples.u + i), hn::LoadU(d, samples.v + i), d_px);
            const auto beneath = hn::And(hn::And(hn::Lt(seen.residual, below), hn::Ge(seen.ground, nearest)),
                                         hn::Gt(d_px, absent));
            count = hn::Add(count, hn::IfThenElseZero(beneath, hn::Set(d, 1.0F)));
        }
        hn::StoreU(count, d, partial + part);
    }
    return InOrder(partial);
}

double OwnAny(const Samples& samples, const PlaneWeights& weights, const PlaneWeights& others) {
    const D d;
    const Plane plane = Spread(weights);
    const Plane other = Spread(others);
    alignas(32) float partial[kSampleLanes];
    for (std::size_t part = 0; part < kSampleLanes; part += kLanes) {
        V sum = hn::Zero(d);
        for (std::size_t i = part; i < samples.count; i += kSampleLanes) {
            const V u = hn::LoadU(d, samples.u + i);
            const V v = hn::LoadU(d, samples.v + i);
            const V d_px = hn::LoadU(d, samples.d_px + i);
            const V own = Weigh(plane, u, v, d_px).weight;
            const V taken = Weigh(other, u, v, d_px).weight;
            sum = hn::Add(sum, hn::IfThenElseZero(hn::Eq(taken, hn::Zero(d)), own));
        }
        hn::StoreU(sum, d, partial + part);
    }
    return InOrder(partial);
}

}  // namespace groundline::terrain::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace groundline::terrain::kernels {

HWY_EXPORT(MomentsAny);
HWY_EXPORT(BeneathAny);
HWY_EXPORT(OwnAny);

PlaneMoments plane_moments(const Samples& samples, const PlaneWeights& plane) {
    return HWY_DYNAMIC_DISPATCH(MomentsAny)(samples, plane);
}
double count_beneath(const Samples& samples, const PlaneWeights& plane, float below_px, float ground_px) {
    return HWY_DYNAMIC_DISPATCH(BeneathAny)(samples, plane, below_px, ground_px);
}
double own_moment(const Samples& samples, const PlaneWeights& plane, const PlaneWeights& other) {
    return HWY_DYNAMIC_DISPATCH(OwnAny)(samples, plane, other);
}

}  // namespace groundline::terrain::kernels
#endif
