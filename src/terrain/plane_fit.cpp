#include "terrain/plane_fit.hpp"

#include <algorithm>
#include <cmath>

namespace groundline::terrain {
namespace {

constexpr std::size_t kThin = 4500;
constexpr std::size_t kDense = 60000;
constexpr std::size_t kPart = 8192;  // samples summed by one task
constexpr int kTile = 32;            // px, wider than any matching window's reach
// What matching windows and sub-pixel estimates have in common over a picture, and from its middle to its
// border: no statistic of one frame can see it. Chosen so that over 60 rendered frames (flat ground, boxes,
// poles, clutter, low texture) the paper's matcher errs by less than 2 sigma in pitch, height and roll in 98
// %; with 0.05 px common alone, 23 % were below 2 in height. Ground that is no plane errs by more: 4 sigma on
// a step, 5 on waves.
constexpr double kCommonErrorPx = 0.09;
constexpr double kTiltUErrorPx = 0.02;
constexpr double kTiltVErrorPx = 0.08;
// A pixel is near the camera where the ground has this share of its disparity in the middle of the last row.
constexpr double kNearShare = 0.4;
constexpr double kLastTolerancePx = 1.5;  // at which converge() and fit() end
constexpr std::array<double, 5> kRoughPx = {5.0, 5.0, 4.0, 4.0, 3.0};
constexpr std::array<double, 4> kThinPx = {3.0, 2.0, 1.5, 1.5};
constexpr std::array<double, 3> kDensePx = {2.0, 1.5, 1.5};

// Symmetric 3 x 3, row-major; false where it is singular for practical purposes.
bool invert(const std::array<double, 9>& m, std::array<double, 9>& out) {
    const double c00 = m[4] * m[8] - m[5] * m[7];
    const double c01 = m[5] * m[6] - m[3] * m[8];
    const double c02 = m[3] * m[7] - m[4] * m[6];
    const double determinant = m[0] * c00 + m[1] * c01 + m[2] * c02;
    if (!(determinant > 1e-12 * m[0] * m[4] * m[8])) return false;
    const double inverse = 1.0 / determinant;
    out = {c00 * inverse, (m[2] * m[7] - m[1] * m[8]) * inverse, (m[1] * m[5] - m[2] * m[4]) * inverse,
           c01 * inverse, (m[0] * m[8] - m[2] * m[6]) * inverse, (m[2] * m[3] - m[0] * m[5]) * inverse,
           c02 * inverse, (m[1] * m[6] - m[0] * m[7]) * inverse, (m[0] * m[4] - m[1] * m[3]) * inverse};
    return true;
}

}  // namespace

void PlaneFit::Set::take(Arena& arena, std::size_t most) {
    most += kernels::kSampleLanes;
    u = arena.take<float>(most);
    v = arena.take<float>(most);
    d_px = arena.take<float>(most);
}

// Written always, kept where valid: a branch on what the matching left out would be guessed wrongly too
// often.
class PlaneFit::Set::Writer {
  public:
    explicit Writer(Set& set) : set_(set), u_(set.u.data()), v_(set.v.data()), d_px_(set.d_px.data()) {}
    void add(int u_px, int v_px, float disparity_px, bool valid) {
        u_[used_] = static_cast<float>(u_px);
        v_[used_] = static_cast<float>(v_px);
        d_px_[used_] = disparity_px;
        used_ += valid ? 1U : 0U;
    }
    void fill_up() {
        while (used_ % kernels::kSampleLanes != 0)
            add(0, 0, kernels::kNoSample, true);
        set_.used = used_;
    }

  private:
    Set& set_;
    float* u_;
    float* v_;
    float* d_px_;
    std::size_t used_ = 0;
};

kernels::Samples PlaneFit::Set::samples(std::size_t first, std::size_t count) const {
    return {u.data() + first, v.data() + first, d_px.data() + first, count};
}

void PlaneFit::take(Arena& arena, int width, int height) {
    width_ = width;
    height_ = height;
    middle_u_ = width / 2;
    middle_v_ = height / 2;
    tile_columns_ = (width + kTile - 1) / kTile;
    tile_rows_ = (height + kTile - 1) / kTile;
    const auto count = [&](int step_u, int step_v) {
        return static_cast<std::size_t>((width + step_u - 1) / step_u) *
               static_cast<std::size_t>((height + step_v - 1) / step_v);
    };
    while (count(thin_step_, thin_step_) > kThin)
        ++thin_step_;
    while (count(step_u_, step_v_) > kDense) {
        step_u_ += 2;
        ++step_v_;
    }
    rough_.take(arena, count(2 * thin_step_, 2 * thin_step_));
    thin_.take(arena, count(thin_step_, thin_step_));
    dense_.take(arena, count(step_u_, step_v_));
    parts_ = arena.take<kernels::PlaneMoments>(count(step_u_, step_v_) / kPart + 1);
    tiles_ =
        arena.take<Score>(static_cast<std::size_t>(tile_columns_) * static_cast<std::size_t>(tile_rows_));
}

void PlaneFit::sample(ConstDisparityMap map, double offset_px) {
    offset_px_ = offset_px;
    // Coordinates from the middle, where floats of the sums lose least.
    const int middle_u = middle_u_;
    const int middle_v = middle_v_;
    const auto each = [&](int first, int step_u, int step_v, Set& set) {
        Set::Writer writer(set);
        for (int v = first; v < height_; v += step_v) {
            const std::int16_t* disparity = map.disparity_q4.row(v);
            const Invalid* invalid = map.invalid.row(v);
            for (int u = first; u < width_; u += step_u)
                writer.add(u - middle_u, v - middle_v,
                           static_cast<float>(disparity[u]) * (1.0F / kDisparityOne),
                           invalid[u] == Invalid::kNone);
        }
        writer.fill_up();
    };
    const int first = thin_step_ / 2;
    each(first, thin_step_, thin_step_, thin_);
    each(first, 2 * thin_step_, 2 * thin_step_, rough_);
    each(0, step_u_, step_v_, dense_);
}

DisparityPlane PlaneFit::centred(const DisparityPlane& plane) const {
    return {plane.du, plane.dv, plane.at(middle_u_, middle_v_)};
}
DisparityPlane PlaneFit::uncentred(const DisparityPlane& plane) const {
    return {plane.du, plane.dv, plane.at(-middle_u_, -middle_v_)};
}

kernels::PlaneWeights PlaneFit::weights_of(const DisparityPlane& plane, double tolerance_px) const {
    return {static_cast<float>(plane.du), static_cast<float>(plane.dv), static_cast<float>(plane.d0),
            static_cast<float>(offset_px_), static_cast<float>(tolerance_px)};
}

bool PlaneFit::improve(const kernels::PlaneMoments& moments, DisparityPlane& plane) {
    const auto [w, wu, wv, wuu, wuv, wvv, wr, wur, wvr] = moments;
    std::array<double, 9> inverse{};
    if (w < 20.0 || !invert({wuu, wuv, wu, wuv, wvv, wv, wu, wv, w}, inverse)) return false;
    plane.du += inverse[0] * wur + inverse[1] * wvr + inverse[2] * wr;
    plane.dv += inverse[3] * wur + inverse[4] * wvr + inverse[5] * wr;
    plane.d0 += inverse[6] * wur + inverse[7] * wvr + inverse[8] * wr;
    return true;
}

PlaneFitResult PlaneFit::descend(const Set& set, const DisparityPlane& start,
                                 std::span<const double> tolerances_px) const {
    PlaneFitResult result;
    DisparityPlane plane = centred(start);
    for (const double tolerance : tolerances_px) {
        const kernels::PlaneMoments moments = kernels::plane_moments(set.all(), weights_of(plane, tolerance));
        if (!improve(moments, plane)) return result;
        result.weight = moments[0];
    }
    result.plane = uncentred(plane);
    result.found = true;
    return result;
}

PlaneFitResult PlaneFit::approach(const DisparityPlane& start) const {
    return descend(rough_, start, kRoughPx);
}

PlaneFitResult PlaneFit::converge(const DisparityPlane& start) const {
    PlaneFitResult result = descend(thin_, start, kThinPx);
    if (!result.found) return result;
    const double near_px = kNearShare * (result.plane.at(0.5 * width_, height_ - 1.0) - offset_px_);
    result.beneath = kernels::count_beneath(thin_.all(), weights_of(centred(result.plane), kLastTolerancePx),
                                            static_cast<float>(kLastTolerancePx),
                                            static_cast<float>(std::max(1.0, near_px)));
    return result;
}

double PlaneFit::own_weight(const DisparityPlane& plane, const DisparityPlane& other) const {
    return kernels::own_moment(thin_.all(), weights_of(centred(plane), kLastTolerancePx),
                               weights_of(centred(other), kLastTolerancePx));
}

PlaneFitResult PlaneFit::fit(const DisparityPlane& start, Parallel& parallel) {
    PlaneFitResult result;
    DisparityPlane plane = centred(start);
    kernels::PlaneMoments moments{};
    const int parts = static_cast<int>((dense_.used + kPart - 1) / kPart);
    for (const double tolerance : kDensePx) {
        const kernels::PlaneWeights weights = weights_of(plane, tolerance);
        parallel.for_each(parts, [&](int part, int) {
            const std::size_t first = static_cast<std::size_t>(part) * kPart;
            parts_[static_cast<std::size_t>(part)] =
                kernels::plane_moments(dense_.samples(first, std::min(kPart, dense_.used - first)), weights);
        });
        moments = {};
        for (std::size_t part = 0; part < static_cast<std::size_t>(parts); ++part)
            for (std::size_t k = 0; k < moments.size(); ++k)
                moments[k] += parts_[part][k];
        if (!improve(moments, plane)) return result;
    }
    result.weight = moments[0];
    result.plane = plane;
    result.found = true;
    finish(result);
    result.plane = uncentred(result.plane);
    return result;
}

// The last step, in doubles, of a plane about the middle of the picture, and its covariance.
void PlaneFit::finish(PlaneFitResult& result) {
    const DisparityPlane plane = result.plane;
    kernels::PlaneMoments moments{};
    const double middle_u = middle_u_;
    const double middle_v = middle_v_;
    std::fill(tiles_.begin(), tiles_.end(), Score{});
    double slope_sum = 0.0;
    // Every second of them: doubles are slow.
    for (std::size_t i = 0; i < dense_.used; i += 2) {
        const double u = dense_.u[i];
        const double v = dense_.v[i];
        const double expected = plane.du * u + plane.dv * v + plane.d0;
        const double ground = expected - offset_px_;
        const double residual = dense_.d_px[i] - expected;
        const double reach = kernels::reach_px(kLastTolerancePx, ground);
        if (ground < 1.0 || !(residual < reach && residual > -reach)) continue;
        const double t2 = residual * residual / (reach * reach);
        const double weight = (1.0 - t2) * (1.0 - t2);
        const double score = weight * residual;
        const int column = (static_cast<int>(dense_.u[i]) + middle_u_) / kTile;
        const int row = (static_cast<int>(dense_.v[i]) + middle_v_) / kTile;
        Score& tile = tiles_[static_cast<std::size_t>(row * tile_columns_ + column)];
        tile.s += score;
        tile.su += score * u;
        tile.sv += score * v;
        const double by_u = weight * u;
        const double by_v = weight * v;
        const std::array<double, 9> terms = {weight,   by_u,  by_v,      by_u * u, by_u * v,
                                             by_v * v, score, score * u, score * v};
        for (std::size_t k = 0; k < terms.size(); ++k)
            moments[k] += terms[k];
        slope_sum += (1.0 - t2) * (1.0 - 5.0 * t2);
    }

    // The curvature of the objective is that of the weights times the mean slope of the score: Tukey's
    // falls with scatter. Below a fifth the fit means little, and the verdict has other reasons to say so.
    const double curvature = std::max(0.2, slope_sum / moments[0]);
    std::array<double, 9> inverse{};
    const auto [w, wu, wv, wuu, wuv, wvv, wr, wur, wvr] = moments;
    if (!improve(moments, result.plane) || !invert({wuu, wuv, wu, wuv, wvv, wv, wu, wv, w}, inverse)) {
        result.found = false;
        return;
    }

    std::array<double, 9> meat{};
    const auto add_outer = [&](const Score& score) {
        const std::array<double, 3> g = {score.su, score.sv, score.s};
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 3; ++j)
                meat[3 * i + j] += g[i] * g[j];
    };
    for (int tile_row = 0; tile_row < tile_rows_; ++tile_row) {
        Score strip{};
        for (int column = 0; column < tile_columns_; ++column) {
            const Score& tile = tiles_[static_cast<std::size_t>(tile_row * tile_columns_ + column)];
            add_outer(tile);
            strip.s += tile.s;
            strip.su += tile.su;
            strip.sv += tile.sv;
        }
        add_outer(strip);
    }
    const auto times = [](const std::array<double, 9>& a, const std::array<double, 9>& b) {
        std::array<double, 9> out{};
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 3; ++j)
                for (std::size_t k = 0; k < 3; ++k)
                    out[3 * i + j] += a[3 * i + k] * b[3 * k + j];
        return out;
    };
    std::array<double, 9> centred = times(times(inverse, meat), inverse);
    for (double& value : centred)
        value /= curvature * curvature;
    const double tilt_u = kTiltUErrorPx / middle_u;
    const double tilt_v = kTiltVErrorPx / middle_v;
    centred[0] += tilt_u * tilt_u;
    centred[4] += tilt_v * tilt_v;
    centred[8] += kCommonErrorPx * kCommonErrorPx;
    // From the plane about the middle of the picture to the plane about its origin.
    const std::array<double, 9> shift = {1, 0, 0, 0, 1, 0, -middle_u, -middle_v, 1};
    const std::array<double, 9> shift_t = {1, 0, -middle_u, 0, 1, -middle_v, 0, 0, 1};
    result.covariance = times(times(shift, centred), shift_t);
}

}  // namespace groundline::terrain
