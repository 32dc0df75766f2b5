// Sums over sampled pixels for the robust plane fit, on the processor's best vector unit.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

namespace groundline::terrain::kernels {

// Pixels as structures of arrays; coordinates and disparities in px, any origin. `count` is a multiple of
// kSampleLanes, filled up with pixels at disparity kNoSample, which lie on no plane.
inline constexpr std::size_t kSampleLanes = 8;
inline constexpr float kNoSample = -1e6F;
struct Samples {
    const float* u;
    const float* v;
    const float* d_px;
    std::size_t count;
};

// How far from the ground a pixel may lie to take part, where the ground's true disparity is ground_px: the
// tolerance, near the camera 8 percent of the ground's disparity but at most 4 px, so that a road's crown or
// its kerb does not tilt the plane; and never more than half a pixel and a quarter of that disparity, so that
// far away a thing of a few decimetres is not taken for ground.
inline constexpr float kReachShare = 0.08F;
inline constexpr float kMostReachPx = 4.0F;
inline constexpr float kFarReachPx = 0.5F;
inline constexpr float kFarReachShare = 0.25F;
template <typename Real>
Real reach_px(Real tolerance_px, Real ground_px) {
    const Real most = std::min(Real{kMostReachPx}, Real{kReachShare} * ground_px);
    return std::min(std::max(tolerance_px, most), Real{kFarReachPx} + Real{kFarReachShare} * ground_px);
}

// A plane of measured disparity and which pixels take part: those within reach_px(tolerance, ground) where
// the ground has 1 px of true disparity or more, with Tukey's weight.
struct PlaneWeights {
    float du, dv, d0;
    float offset_px;  // measured minus true disparity
    float tolerance_px;
};

// Sums of w, wu, wv, wuu, wuv, wvv, wr, wur, wvr over the samples, r the residual, in eight interleaved
// partial sums of floats that are then added in order: the same bits on every vector unit.
using PlaneMoments = std::array<double, 9>;
PlaneMoments plane_moments(const Samples& samples, const PlaneWeights& plane);

// Pixels whose residual is below -below_px where the ground has ground_px of true disparity or more.
double count_beneath(const Samples& samples, const PlaneWeights& plane, float below_px, float ground_px);

// Sum of the weights on `plane` of pixels that have none on `other`.
double own_moment(const Samples& samples, const PlaneWeights& plane, const PlaneWeights& other);

}  // namespace groundline::terrain::kernels
