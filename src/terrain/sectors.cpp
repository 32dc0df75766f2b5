#include "terrain/sectors.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>

#include "core/deterministic_math.hpp"
#include "core/error.hpp"

namespace groundline::terrain {
namespace {

constexpr int kThingBinsPerPx = 4;   // of f b / range: a bin is a quarter of a pixel of disparity
constexpr int kGroundBinsPerPx = 2;  // wider, so that a sector's bin holds enough pixels to judge half of
constexpr int kEnough = 4;           // sampled pixels that make a thing
constexpr int kStep = 2;             // rows; for the ground also columns

}  // namespace

// One frame's geometry: along the ground, forward and left, of a pixel's ray per metre of depth, both linear
// in (u, v).
struct SectorFinder::View {
    double scale = 0.0;  // f b
    double offset_px = 0.0;
    DisparityPlane ground;  // of true disparity
    double forward_u, forward_v, forward_0;
    double left_u, left_v, left_0;
};

SectorFinder::SectorFinder(const TerrainConfig& config, const RectifiedRig& rig, int min_disparity,
                           int disparities, Arena& arena)
    : config_(config),
      rig_(rig),
      last_disparity_(min_disparity + disparities - 1),
      count_(config.sectors),
      thing_bins_((min_disparity + disparities) * kThingBinsPerPx + 1),
      ground_bins_((min_disparity + disparities) * kGroundBinsPerPx + 1) {
    if (config.sectors < 1 || config.sectors > static_cast<int>(kMaxSectors))
        throw Refusal(ExitStatus::kConfig, "there can be 1 to " + std::to_string(kMaxSectors) +
                                               " sectors, not " + std::to_string(config.sectors));
    const auto sectors = static_cast<std::size_t>(count_);
    edge_cos_ = arena.take<double>(sectors);
    edge_sin_ = arena.take<double>(sectors);
    things_ = arena.take<std::uint16_t>(2 * sectors * static_cast<std::size_t>(thing_bins_));
    ground_seen_ = arena.take<std::uint32_t>(sectors * static_cast<std::size_t>(ground_bins_));
    ground_likely_ = arena.take<std::uint32_t>(ground_seen_.size());
    known_ = arena.take<std::uint32_t>(sectors);
    below_ = arena.take<std::uint32_t>(sectors);
    if (!rig.calibrated) return;
    const double yaw = det::radians(config.mount_yaw_deg);
    cos_yaw_ = det::cos(yaw);
    sin_yaw_ = det::sin(yaw);
    first_bearing_rad_ = yaw + det::atan(rig.cx_px / rig.focal_px);
    const double last = yaw - det::atan((rig.width - 1 - rig.cx_px) / rig.focal_px);
    width_rad_ = (first_bearing_rad_ - last) / count_;
    for (std::size_t i = 0; i < sectors; ++i) {
        const double bearing = first_bearing_rad_ - static_cast<double>(i + 1) * width_rad_;
        edge_cos_[i] = det::cos(bearing);
        edge_sin_[i] = det::sin(bearing);
    }
}

// Sectors run from left to right; a point is beyond a sector when it lies right of its right edge.
int SectorFinder::sector_of(double x, double y, int guess) const {
    const auto beyond = [&](int sector) {
        const auto i = static_cast<std::size_t>(sector);
        return edge_cos_[i] * y - edge_sin_[i] * x < 0.0;
    };
    while (guess > 0 && !beyond(guess - 1))
        --guess;
    while (guess + 1 < count_ && beyond(guess))
        ++guess;
    return guess;
}

void SectorFinder::count_things(ConstDisparityMap map, const View& view, ConstMask mask) {
    std::fill(things_.begin(), things_.end(), std::uint16_t{0});
    for (int v = 0; v < mask.height; v += kStep) {
        const TerrainClass* kinds = mask.row(v);
        const std::int16_t* disparity = map.disparity_q4.row(v);
        const Invalid* invalid = map.invalid.row(v);
        int sector = 0;
        for (int u = 0; u < mask.width; ++u) {
            if (kinds[u] != TerrainClass::kObstacle && kinds[u] != TerrainClass::kDrop) continue;
            if (invalid[u] != Invalid::kNone && invalid[u] != Invalid::kRangeEdge) continue;
            const double measured_px =
                invalid[u] == Invalid::kRangeEdge ? last_disparity_ : disparity[u] * (1.0 / kDisparityOne);
            const double depth = view.scale / std::max(measured_px - view.offset_px, 1.0 / kDisparityOne);
            const double forward = depth * (view.forward_u * u + view.forward_v * v + view.forward_0);
            const double left = depth * (view.left_u * u + view.left_v * v + view.left_0);
            const double x = config_.mount_x_m + cos_yaw_ * forward - sin_yaw_ * left;
            const double y = config_.mount_y_m + sin_yaw_ * forward + cos_yaw_ * left;
            sector = sector_of(x, y, sector);
            const double inverse = kThingBinsPerPx * view.scale / std::sqrt(x * x + y * y);
            const int bin = inverse < thing_bins_ ? static_cast<int>(inverse) : thing_bins_ - 1;
            const int kind = kinds[u] == TerrainClass::kObstacle ? 0 : 1;
            std::uint16_t& cell =
                things_[static_cast<std::size_t>((kind * count_ + sector) * thing_bins_ + bin)];
            if (cell < 65535) ++cell;
        }
    }
}

void SectorFinder::count_ground(const View& view, ConstMask mask) {
    std::fill(ground_seen_.begin(), ground_seen_.end(), 0U);
    std::fill(ground_likely_.begin(), ground_likely_.end(), 0U);
    std::fill(known_.begin(), known_.end(), 0U);
    std::fill(below_.begin(), below_.end(), 0U);
    for (int v = 0; v < mask.height; v += kStep) {
        const TerrainClass* kinds = mask.row(v);
        int sector = 0;
        for (int u = 0; u < mask.width; u += kStep) {
            const double ground_px = view.ground.at(u, v);
            if (ground_px < 1.0) continue;
            const double depth = view.scale / ground_px;
            const double forward = depth * (view.forward_u * u + view.forward_v * v + view.forward_0);
            const double left = depth * (view.left_u * u + view.left_v * v + view.left_0);
            const double x = config_.mount_x_m + cos_yaw_ * forward - sin_yaw_ * left;
            const double y = config_.mount_y_m + sin_yaw_ * forward + cos_yaw_ * left;
            sector = sector_of(x, y, sector);
            ++below_[static_cast<std::size_t>(sector)];
            known_[static_cast<std::size_t>(sector)] += kinds[u] != TerrainClass::kUnknown ? 1U : 0U;
            // Ground nearer than the search range cannot be seen and is no gap: what is seen begins there.
            if (ground_px > last_disparity_) continue;
            const double inverse = kGroundBinsPerPx * view.scale / std::sqrt(x * x + y * y);
            const int bin = inverse < ground_bins_ ? static_cast<int>(inverse) : ground_bins_ - 1;
            const auto at = static_cast<std::size_t>(sector * ground_bins_ + bin);
            ++ground_likely_[at];
            ground_seen_[at] += kinds[u] == TerrainClass::kTraversable ? 1U : 0U;
        }
    }
}

// Range of the 4th-nearest sampled pixel (the last where there are fewer), 0 where there is none.
double SectorFinder::nearest(std::span<const std::uint16_t> bins, double scale, double& width_m) const {
    int seen = 0;
    int last = -1;
    for (int bin = thing_bins_ - 1; bin >= 0 && seen < kEnough; --bin) {
        if (bins[static_cast<std::size_t>(bin)] == 0) continue;
        seen += bins[static_cast<std::size_t>(bin)];
        last = bin;
    }
    if (last < 0) return 0.0;
    const double range = kThingBinsPerPx * scale / (last + 0.5);
    width_m = range / (last + 0.5);
    return range;
}

void SectorFinder::find(ConstDisparityMap map, const Ground& ground, ConstMask mask,
                        FixedVector<Sector, kMaxSectors>& sectors) {
    sectors.clear();
    if (!rig_.calibrated || !ground.found || !ground.metric) return;
    assert(mask.same_size(rig_.width, rig_.height));

    View view;
    view.scale = rig_.focal_px * rig_.baseline_m;
    view.offset_px = rig_.offset_px();
    view.ground = ground.plane;
    view.ground.d0 -= view.offset_px;
    // The ground's normal n, forward = z - (z n) n made unit, left = forward x n.
    const double cos_pitch = det::cos(ground.pose.pitch_rad);
    const double nx = det::sin(ground.pose.roll_rad) * cos_pitch;
    const double ny = det::cos(ground.pose.roll_rad) * cos_pitch;
    const double nz = det::sin(ground.pose.pitch_rad);
    const double fx = -nz * nx / cos_pitch;
    const double fy = -nz * ny / cos_pitch;
    const double fz = (1.0 - nz * nz) / cos_pitch;
    const double lx = fy * nz - fz * ny;
    const double ly = fz * nx - fx * nz;
    const double lz = fx * ny - fy * nx;
    const double per_px = 1.0 / rig_.focal_px;
    view.forward_u = fx * per_px;
    view.forward_v = fy * per_px;
    view.forward_0 = fz - (fx * rig_.cx_px + fy * rig_.cy_px) * per_px;
    view.left_u = lx * per_px;
    view.left_v = ly * per_px;
    view.left_0 = lz - (lx * rig_.cx_px + ly * rig_.cy_px) * per_px;

    count_things(map, view, mask);
    count_ground(view, mask);
    for (int i = 0; i < count_; ++i) {
        const auto at = static_cast<std::size_t>(i);
        Sector sector;
        sector.bearing_rad = first_bearing_rad_ - (i + 0.5) * width_rad_;
        sector.width_rad = width_rad_;
        for (const int kind : {0, 1}) {
            const auto first = static_cast<std::size_t>((kind * count_ + i) * thing_bins_);
            double width_m = 0.0;
            const double range =
                nearest(things_.subspan(first, static_cast<std::size_t>(thing_bins_)), view.scale, width_m);
            if (range <= 0.0 || (sector.blocked && range >= sector.nearest_m)) continue;
            sector.blocked = true;
            sector.kind = kind == 0 ? TerrainClass::kObstacle : TerrainClass::kDrop;
            sector.nearest_m = range;
            const double noise = range * range * config_.sigma_disparity_px / view.scale;
            sector.nearest_sigma_m = std::sqrt(noise * noise + width_m * width_m / 12.0);
        }
        const std::size_t first = at * static_cast<std::size_t>(ground_bins_);
        for (int bin = ground_bins_ - 1; bin > 0; --bin) {
            const std::uint32_t likely = ground_likely_[first + static_cast<std::size_t>(bin)];
            if (likely == 0) continue;
            if (2 * ground_seen_[first + static_cast<std::size_t>(bin)] < likely) break;
            sector.free_range_m = kGroundBinsPerPx * view.scale / (bin + 0.5);
        }
        if (sector.blocked) sector.free_range_m = std::min(sector.free_range_m, sector.nearest_m);
        sector.coverage = below_[at] > 0 ? static_cast<double>(known_[at]) / below_[at] : 0.0;
        sectors.push_back(sector);
    }
}

}  // namespace groundline::terrain
