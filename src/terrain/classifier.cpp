#include "terrain/classifier.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

#include "terrain/classify_kernels.hpp"
#include "terrain/obstacles.hpp"

namespace groundline::terrain {
namespace {

constexpr int kBits = 16;          // of the limits' fraction, beside sixteenths: a millionth of a pixel
constexpr double kFarShare = 0.5;  // of the certified range; beyond it a thing is far
// |ground disparity| anywhere in the picture; beyond 1000 px a step over 64 columns would overflow.
constexpr double kLargestPx = 1000.0;
constexpr double kOne = static_cast<double>(std::int32_t{1} << kBits) * kDisparityOne;
// Beyond the certified range nothing is level or a drop, at infinity or behind it nothing at all.
constexpr kernels::Limit kNothing = {std::numeric_limits<std::int32_t>::min(),
                                     std::numeric_limits<std::int32_t>::max() - 1};
constexpr double kLeastPx = 1.0;  // class 1 needs a disparity to speak of: as in the fit of the ground

// floor(value + 0.5) of what fits 32 bits, without a call of the library.
std::int32_t nearest(double value) {
    const auto towards_zero = static_cast<std::int32_t>(value + 0.5);
    return towards_zero - (towards_zero > value + 0.5 ? 1 : 0);
}

std::int32_t limit_q20(double px) {
    constexpr double kMost = 2147483000.0;
    return nearest(std::clamp(px * kOne, -kMost, kMost));
}

}  // namespace

// Everything about one frame's ground that the pixels need, with true disparities in 1/16 px.
struct Classifier::Wedge {
    bool usable = false;
    DisparityPlane ground;  // true, px
    std::array<double, 9> covariance{};
    double ratio_up = 0.0;  // tolerances over the camera's height
    double ratio_down = 0.0;
    double offset_px = 0.0;
    bool band = false;
    double band_px = 0.0;
};

Classifier::Classifier(const TerrainConfig& config, const RectifiedRig& rig, int min_disparity,
                       int disparities, Arena& arena)
    : config_(config),
      rig_(rig),
      last_disparity_(min_disparity + disparities - 1),
      disparities_(disparities),
      first_q4_(min_disparity * kDisparityOne),
      bands_((rig.width + kernels::kClassColumns - 1) / kernels::kClassColumns),
      table_(static_cast<std::size_t>(disparities) * kDisparityOne + 1),
      certified_q4_(arena.take<std::int32_t>(static_cast<std::size_t>(bands_) * kernels::kClassColumns)),
      limits_(arena.take<kernels::Limit>(static_cast<std::size_t>(bands_) * 2 * table_)),
      within_(arena.take<kernels::Limit>(table_)),
      even_(arena.take<kernels::EvenLimits>(static_cast<std::size_t>(bands_))),
      is_even_(arena.take<bool>(static_cast<std::size_t>(bands_))) {
    static_assert(kernels::kClassColumns == GroundSurface::kBandColumns);
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
    } else {
        wedge.ratio_up = wedge.ratio_down = config_.tolerance_ratio;
    }
    switch (config_.band) {
        case Band::kOff:
            break;
        case Band::k50Rows:
            wedge.band_px = 50.0 * wedge.ground.dv;
            break;
        case Band::k50Px:
            wedge.band_px = 50.0;
            break;
        case Band::k50Disparity8:
            wedge.band_px = 50.0 * disparities_ / 256.0;
            break;
    }
    wedge.band = config_.band != Band::kOff;
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

// The measured disparity at kFarShare of the farthest certified range.
int Classifier::far_q4() const {
    const auto columns = certified_q4_.first(static_cast<std::size_t>(rig_.width));
    const double offset_q4 = rig_.calibrated ? rig_.offset_px() * kDisparityOne : 0.0;
    const double least_q4 = *std::min_element(columns.begin(), columns.end()) - offset_q4;
    return static_cast<int>(std::clamp(offset_q4 + least_q4 / kFarShare, -1e6, 1e6));
}

// Whether a band's limits grow evenly with the disparity, and then these: above the plane itself, where all
// of the band's cells allow the same and nothing overflows.
bool Classifier::even_limits(const Wedge& wedge, GroundUse use, const GroundSurface& surface, int band,
                             double uncertain_px, kernels::EvenLimits& limits) const {
    constexpr double kMost = 2e9;
    constexpr double kFactorOne = 1 << kBits;
    const double up = 1.0 - wedge.ratio_up;
    const double down = 1.0 + wedge.ratio_down;
    const double most_px = std::max(std::fabs(last_disparity_ + 1.0), std::fabs(first_q4_ / 16.0));
    const bool flat = use == GroundUse::kHeld || surface.flat();
    if (!flat || wedge.band || use == GroundUse::kWeak) return false;
    if (most_px * kOne * std::max(std::fabs(up), down) > kMost) return false;
    if (std::fabs(wedge.offset_px) * kOne * std::max(std::fabs(up), down) > kMost ||
        uncertain_px * kOne > kMost)
        return false;
    for (int step = 0; step < surface.steps() && use == GroundUse::kOwn; ++step)
        if (surface.support(step, band) == CellSupport::kContradicted) return false;
    limits.up_q16 = nearest(up * kFactorOne);
    limits.down_q16 = nearest(down * kFactorOne);
    limits.up_off_q20 = nearest(wedge.offset_px * kOne * up);
    limits.down_off_q20 = nearest(wedge.offset_px * kOne * down);
    limits.offset_q20 = nearest(wedge.offset_px * kOne);
    limits.uncertain_q20 = nearest(uncertain_px * kOne);
    limits.level = use == GroundUse::kOwn;
    return true;
}

// Limits within the certified range: but for the level bit those of every band.
void Classifier::make_within(const Wedge& wedge, GroundUse use, const GroundSurface& surface) {
    for (std::size_t i = 0; i < table_; ++i) {
        const int measured_q4 = first_q4_ + static_cast<int>(i);
        const double px = measured_q4 * (1.0 / kDisparityOne) - wedge.offset_px;
        const double rise = use == GroundUse::kHeld ? 0.0 : surface.rise(measured_q4);
        within_[i] = kNothing;
        if (px <= 0.0) continue;
        if (wedge.band)
            within_[i] = {limit_q20(px - wedge.band_px), limit_q20(px + wedge.band_px)};
        else
            within_[i] = {limit_q20(px * (1.0 - wedge.ratio_up - rise)),
                          limit_q20(px * (1.0 + wedge.ratio_down - rise))};
        within_[i].down_q20 &= ~std::int32_t{1};
    }
}

// Limits on the ground's disparity by a pixel's own, for the columns of each band.
void Classifier::make_limits(const Wedge& wedge, GroundUse use, const GroundSurface& surface) {
    bool has_within = false;
    const double noise = config_.sigma_disparity_px * config_.sigma_disparity_px;
    for (int band = 0; band < bands_; ++band) {
        // The ground's disparity is least certain at one of the corners.
        double worst = 0.0;
        for (const double u : {1.0 * band * kernels::kClassColumns,
                               std::min(1.0 * rig_.width, (band + 1.0) * kernels::kClassColumns) - 1.0})
            for (const double v : {0.0, rig_.height - 1.0}) {
                const double x[3] = {u, v, 1.0};
                double variance = 0.0;
                for (std::size_t i = 0; i < 3; ++i)
                    for (std::size_t j = 0; j < 3; ++j)
                        variance += x[i] * wedge.covariance[3 * i + j] * x[j];
                worst = std::max(worst, variance);
            }
        const double uncertain_px = config_.sigmas * std::sqrt(noise + worst);
        if (even_limits(wedge, use, surface, band, uncertain_px, even_[static_cast<std::size_t>(band)])) {
            is_even_[static_cast<std::size_t>(band)] = true;
            continue;
        }
        is_even_[static_cast<std::size_t>(band)] = false;
        if (!has_within) make_within(wedge, use, surface);
        has_within = true;
        kernels::Limit* const within = &limits_[static_cast<std::size_t>(band) * 2 * table_];
        kernels::Limit* const beyond = within + table_;
        for (std::size_t i = 0; i < table_; ++i) {
            const int measured_q4 = first_q4_ + static_cast<int>(i);
            const double px = measured_q4 * (1.0 / kDisparityOne) - wedge.offset_px;
            within[i] = within_[i];
            beyond[i] = kNothing;
            if (px <= 0.0) continue;
            if (!wedge.band) {
                const double rise = use == GroundUse::kHeld ? 0.0 : surface.rise(measured_q4);
                beyond[i].up_q20 = limit_q20(px * (1.0 - std::max(wedge.ratio_up, uncertain_px / px) - rise));
            }
            if (use == GroundUse::kHeld || (wedge.band && px < kLeastPx)) continue;
            const CellSupport support = surface.support(surface.step_of(measured_q4), band);
            const bool level = use == GroundUse::kOwn ? support != CellSupport::kContradicted
                                                      : support == CellSupport::kSupported;
            within[i].down_q20 |= level ? 1 : 0;
        }
    }
}

void Classifier::classify_row(ConstDisparityMap map, const Wedge& wedge, int v, Mask out) const {
    kernels::ClassRow row{};
    row.first_q4 = first_q4_;
    row.ground_step_q20 = nearest(wedge.ground.du * kOne);
    row.last_q20 = static_cast<std::int32_t>((last_disparity_ - 1 - wedge.offset_px) * kOne);
    for (int band = 0; band < bands_; ++band) {
        const int u = band * kernels::kClassColumns;
        row.disparity_q4 = map.disparity_q4.row(v) + u;
        row.invalid = map.invalid.row(v) + u;
        row.certified_q4 = &certified_q4_[static_cast<std::size_t>(u)];
        // Anew for each band, so that the rounding of a step adds up over its columns alone.
        const double ground = std::clamp(wedge.ground.at(u, v), -kLargestPx, kLargestPx);
        row.ground_q20 = nearest(ground * kOne);
        row.count = std::min(kernels::kClassColumns, map.width() - u);
        if (is_even_[static_cast<std::size_t>(band)]) {
            kernels::classify_columns(row, even_[static_cast<std::size_t>(band)], out.row(v) + u);
            continue;
        }
        const std::size_t first = static_cast<std::size_t>(band) * 2 * table_;
        kernels::classify_columns(row, {&limits_[first], static_cast<std::int32_t>(table_)}, out.row(v) + u);
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
    make_limits(wedge, use, surface);
    if (use != GroundUse::kHeld) range_limit_m = farthest_m;

    constexpr int kRowsPerTask = 16;
    const int tasks = (map.height() + kRowsPerTask - 1) / kRowsPerTask;
    parallel.for_each(tasks, [&](int task, int) {
        for (int v = task * kRowsPerTask; v < std::min(map.height(), (task + 1) * kRowsPerTask); ++v) {
            classify_row(map, wedge, v, out);
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
    rules.min_pixels_far = config_.min_pixels_far;
    rules.far_q4 = far_q4();
    rules.range_edge_q4 = last_disparity_ * kDisparityOne;
    components_.find(map, rules, out, things_);
    outline_.apply(
        {config_.gap_px, config_.blur_px, config_.blur_beyond_px, config_.blur_px, config_.blur_px},
        map.invalid, out);
    obstacles_of(things_, rig_, ground, config_.sigma_disparity_px, obstacles);
}

}  // namespace groundline::terrain
