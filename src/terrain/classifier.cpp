#include "terrain/classifier.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

#include "terrain/obstacles.hpp"

namespace groundline::terrain {
namespace {

// Disparities in the wedge test carry 20 fractional bits, its factors 20, their product 40: sixteenths of a
// pixel up to 2^12 stay below 2^53, and a factor's rounding moves a limit by less than 1e-6 of the height.
constexpr int kBits = 20;
constexpr double kLargestPx = 1e5;  // |ground disparity| anywhere in the picture; 2^40 times it fits 63 bits
constexpr double kLeastPx = 1.0;    // class 1 needs a disparity to speak of: as in the fit of the ground

std::int64_t fixed(double value, int bits) {
    return static_cast<std::int64_t>(std::floor(value * static_cast<double>(std::int64_t{1} << bits) + 0.5));
}

}  // namespace

// Everything about one frame's ground that the pixels need, with true disparities in 1/16 px.
struct Classifier::Wedge {
    bool usable = false;
    DisparityPlane ground;  // true, px
    std::array<double, 9> covariance{};
    double height_by[3] = {0.0, 0.0, 0.0};  // (1/h) dh / d(du, dv, d0)
    double ratio_up = 0.0;                  // tolerances over the camera's height
    double ratio_down = 0.0;
    double offset_px = 0.0;
    bool band = false;
    // H > up  <=>  factor_up d > d_g;  H < -down  <=>  factor_down d < d_g
    std::int64_t factor_up = 0;
    std::int64_t factor_down = 0;
    std::int64_t band_q40 = 0;
    std::int64_t offset_q20 = 0;
    std::int64_t du_q40 = 0, dv_q40 = 0, d0_q40 = 0;
};

Classifier::Classifier(const TerrainConfig& config, const RectifiedRig& rig, int min_disparity,
                       int disparities, Arena& arena)
    : config_(config),
      rig_(rig),
      last_disparity_(min_disparity + disparities - 1),
      disparities_(disparities),
      certified_q4_(arena.take<std::int32_t>(static_cast<std::size_t>(rig.width))) {
    components_.take(arena, rig.width, rig.height, min_disparity, disparities, config.min_pixels);
    outline_.take(arena, rig.width, rig.height);
}

Classifier::Wedge Classifier::wedge_of(const Ground& ground) const {
    Wedge wedge;
    const bool metric = rig_.calibrated && ground.metric;
    wedge.offset_px = rig_.calibrated ? rig_.offset_px() : 0.0;
    wedge.ground = ground.plane;
    wedge.ground.d0 -= wedge.offset_px;
    for (const double u : {0.0, 1.0 * rig_.width})
        for (const double v : {0.0, 1.0 * rig_.height})
            if (!(std::fabs(wedge.ground.at(u, v)) < kLargestPx)) return wedge;
    if (metric && !(ground.pose.height_m > 0.0)) return wedge;
    wedge.usable = true;
    wedge.covariance = ground.covariance;
    if (metric) {
        wedge.ratio_up = config_.tolerance_up_m / ground.pose.height_m;
        wedge.ratio_down = config_.tolerance_down_m / ground.pose.height_m;
        // h = b / N, N^2 = du^2 + dv^2 + g^2, g = d_g(centre) / f
        const double g = wedge.ground.at(rig_.cx_px, rig_.cy_px) / rig_.focal_px;
        const double square = wedge.ground.du * wedge.ground.du + wedge.ground.dv * wedge.ground.dv + g * g;
        wedge.height_by[0] = -(wedge.ground.du + g * rig_.cx_px / rig_.focal_px) / square;
        wedge.height_by[1] = -(wedge.ground.dv + g * rig_.cy_px / rig_.focal_px) / square;
        wedge.height_by[2] = -g / rig_.focal_px / square;
    } else {
        wedge.ratio_up = wedge.ratio_down = config_.tolerance_ratio;
    }
    wedge.factor_up = fixed(1.0 - wedge.ratio_up, kBits);
    wedge.factor_down = fixed(1.0 + wedge.ratio_down, kBits);
    wedge.offset_q20 = fixed(wedge.offset_px * kDisparityOne, kBits);
    wedge.du_q40 = fixed(wedge.ground.du * kDisparityOne, 2 * kBits);
    wedge.dv_q40 = fixed(wedge.ground.dv * kDisparityOne, 2 * kBits);
    wedge.d0_q40 = fixed(wedge.ground.d0 * kDisparityOne, 2 * kBits);
    double band_px = 0.0;
    switch (config_.band) {
        case Band::kOff:
            break;
        case Band::k50Rows:
            band_px = 50.0 * wedge.ground.dv;
            break;
        case Band::k50Px:
            band_px = 50.0;
            break;
        case Band::k50Disparity8:
            band_px = 50.0 * disparities_ / 256.0;
            break;
    }
    wedge.band = config_.band != Band::kOff;
    wedge.band_q40 = fixed(band_px * kDisparityOne, 2 * kBits);
    return wedge;
}

// Fills certified_q4_ and returns the farthest certified range (0 without metres or where there is none).
// On the ground sigma_H / h = sqrt(sigma_d^2 + x' C x) / d_g with x = (u, v, 1), so the limit
// sigmas sigma_H = tolerance is a quadratic in v for each column; nearer than its larger root all is
// certain enough.
double Classifier::certify_columns(const Wedge& wedge) {
    const std::array<double, 9>& c = wedge.covariance;
    const double ratio = std::min(wedge.ratio_up, wedge.ratio_down);
    const double accept = ratio * ratio / (config_.sigmas * config_.sigmas);
    const double variance = config_.sigma_disparity_px * config_.sigma_disparity_px;
    double farthest_px = std::numeric_limits<double>::max();
    for (int u = 0; u < rig_.width; ++u) {
        const double across = wedge.ground.du * u + wedge.ground.d0;
        const double a = accept * wedge.ground.dv * wedge.ground.dv - c[4];
        const double b = 2.0 * (accept * wedge.ground.dv * across - (c[1] * u + c[5]));
        const double rest = accept * across * across - (variance + c[0] * u * u + 2.0 * c[2] * u + c[8]);
        std::int32_t limit = std::numeric_limits<std::int32_t>::max();
        const double discriminant = b * b - 4.0 * a * rest;
        if (wedge.band) {
            limit = std::numeric_limits<std::int32_t>::min();
            farthest_px = kLeastPx;
        } else if (wedge.ground.dv > 0.0 && a > 0.0 && discriminant >= 0.0) {
            const double v = (-b + std::sqrt(discriminant)) / (2.0 * a);
            const double px = std::max(kLeastPx, wedge.ground.dv * v + across);
            farthest_px = std::min(farthest_px, px);
            const double measured_q4 = (px + wedge.offset_px) * kDisparityOne;
            if (measured_q4 < 1e6) limit = static_cast<std::int32_t>(std::ceil(measured_q4));
        }
        certified_q4_[static_cast<std::size_t>(u)] = limit;
    }
    if (!rig_.calibrated || farthest_px > last_disparity_ + 1.0) return 0.0;
    return rig_.focal_px * rig_.baseline_m / farthest_px;
}

// A pixel farther than its column is certified for: sigma_H^2 = ((h - H)/d)^2 sigma_d^2 + J C J' at the pixel
// itself, all over h^2.
TerrainClass Classifier::beyond_range(const Wedge& wedge, int u, int v, double d_px, double rise) const {
    const double ground_px = wedge.ground.at(u, v);
    const double inverse = 1.0 / d_px;
    const double ratio = 1.0 - ground_px * inverse - rise;
    if (!(ratio > wedge.ratio_up)) return TerrainClass::kUnknown;
    const double by[3] = {ratio * wedge.height_by[0] - u * inverse, ratio * wedge.height_by[1] - v * inverse,
                          ratio * wedge.height_by[2] - inverse};
    const double by_d = ground_px * inverse * inverse * config_.sigma_disparity_px;
    double variance = by_d * by_d;
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
            variance += by[i] * wedge.covariance[3 * i + j] * by[j];
    const bool stands = ratio * ratio > config_.sigmas * config_.sigmas * variance;
    return stands ? TerrainClass::kObstacle : TerrainClass::kUnknown;
}

void Classifier::classify_row(ConstDisparityMap map, const Wedge& wedge, GroundUse use,
                              const GroundSurface& surface, int v, Mask out) const {
    const std::int16_t* disparity = map.disparity_q4.row(v);
    const Invalid* invalid = map.invalid.row(v);
    TerrainClass* kinds = out.row(v);
    const std::int64_t last_q40 = fixed((last_disparity_ - 1 - wedge.offset_px) * kDisparityOne, 2 * kBits);
    std::int64_t ground_q40 = wedge.dv_q40 * v + wedge.d0_q40;
    for (int u = 0; u < map.width(); ++u, ground_q40 += wedge.du_q40) {
        if (invalid[u] != Invalid::kNone) {
            // Where the ground itself is nearer than the search range, a range-edge pixel is no news.
            const bool nearer = invalid[u] == Invalid::kRangeEdge && ground_q40 < last_q40;
            kinds[u] = nearer ? TerrainClass::kObstacle : TerrainClass::kUnknown;
            continue;
        }
        const std::int64_t d_q20 = (std::int64_t{disparity[u]} << kBits) - wedge.offset_q20;
        if (d_q20 <= 0) {  // at infinity or behind it
            kinds[u] = TerrainClass::kUnknown;
            continue;
        }
        TerrainClass level = TerrainClass::kUnknown;
        if (use == GroundUse::kOwn || use == GroundUse::kWeak) {
            const CellSupport support = surface.support(disparity[u], u);
            const bool enough = use == GroundUse::kOwn ? support != CellSupport::kContradicted
                                                       : support == CellSupport::kSupported;
            if (enough) level = TerrainClass::kTraversable;
        }
        if (wedge.band) {
            const std::int64_t above = (d_q20 << kBits) - ground_q40;
            const bool usable = ground_q40 > 0 && d_q20 >= (std::int64_t{kDisparityOne} << kBits);
            kinds[u] = above > wedge.band_q40    ? TerrainClass::kObstacle
                       : above < -wedge.band_q40 ? TerrainClass::kDrop
                       : usable                  ? level
                                                 : TerrainClass::kUnknown;
            continue;
        }
        const double rise = use == GroundUse::kHeld ? 0.0 : surface.rise_at(disparity[u], u);
        if (disparity[u] < certified_q4_[static_cast<std::size_t>(u)]) {
            const double d_px = disparity[u] * (1.0 / kDisparityOne) - wedge.offset_px;
            kinds[u] = beyond_range(wedge, u, v, d_px, rise);
        } else {
            const std::int64_t shift = fixed(rise, kBits);
            kinds[u] = (wedge.factor_up - shift) * d_q20 > ground_q40     ? TerrainClass::kObstacle
                       : (wedge.factor_down - shift) * d_q20 < ground_q40 ? TerrainClass::kDrop
                                                                          : level;
        }
    }
}

void Classifier::classify(ConstDisparityMap map, const Ground& ground, GroundUse use,
                          const GroundSurface& surface, Mask out,
                          FixedVector<Obstacle, kMaxObstacles>& obstacles, double& range_limit_m,
                          Parallel& parallel) {
    assert(map.width() == rig_.width && map.height() == rig_.height &&
           out.same_size(rig_.width, rig_.height));
    obstacles.clear();
    range_limit_m = 0.0;
    Wedge wedge;
    if (use != GroundUse::kNone && ground.found) wedge = wedge_of(ground);
    if (!wedge.usable) {
        fill_pixels(out, TerrainClass::kUnknown);
        return;
    }
    const double farthest_m = certify_columns(wedge);
    if (use != GroundUse::kHeld) range_limit_m = farthest_m;

    constexpr int kRowsPerTask = 16;
    const int tasks = (map.height() + kRowsPerTask - 1) / kRowsPerTask;
    parallel.for_each(tasks, [&](int task, int) {
        for (int v = task * kRowsPerTask; v < std::min(map.height(), (task + 1) * kRowsPerTask); ++v) {
            classify_row(map, wedge, use, surface, v, out);
        }
    });

    const bool metric = rig_.calibrated && ground.metric;
    ThingRules rules;
    rules.ground = wedge.ground;
    rules.offset_px = wedge.offset_px;
    // Without metres, areas are in squares of the camera height: b / h = N, nearly the slope.
    rules.unit_px = metric ? rig_.baseline_m
                           : std::sqrt(wedge.ground.du * wedge.ground.du + wedge.ground.dv * wedge.ground.dv);
    rules.min_area = config_.min_area_m2;
    rules.clearance = metric ? config_.clearance_m / ground.pose.height_m : 0.0;
    rules.min_pixels = config_.min_pixels;
    rules.range_edge_q4 = last_disparity_ * kDisparityOne;
    components_.find(map, rules, out, things_);
    outline_.apply(config_.gap_px, config_.blur_px, map.invalid, out);
    obstacles_of(things_, rig_, ground, config_.sigma_disparity_px, obstacles);
}

}  // namespace groundline::terrain
