#include "terrain/sectors.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include "core/deterministic_math.hpp"
#include "core/error.hpp"

namespace groundline::terrain {
namespace {

constexpr int kRows = 3;        // of the picture make a stretch
constexpr int kThingStep = 2;   // rows and columns
constexpr int kGroundStep = 2;  // columns
constexpr int kRowStep = 2;
constexpr int kPerOctave = 32;
constexpr int kSpan = 8;              // bins: a fifth of the range
constexpr std::uint32_t kEnough = 4;  // samples that make a thing
constexpr int kFraction = 16;         // bits of a stretch's number while walking along a row
// What is well seen, and what is a gap. Ground of little texture has holes, so not all of it need be seen;
// half of a stretch over a thin ditch is ground before or behind it.
constexpr double kWell = 0.75;
constexpr double kHalf = 0.5;
constexpr double kReached = 0.25;
constexpr double kLeastGap = 0.1;    // m; what is shorter bears any wheel, and near by it is a few pixels
constexpr double kLeastJump = 0.25;  // m
constexpr double kJumpSigmas = 6.0;  // of disparity; disparities scatter, and gather near whole pixels
// Rows that a matched window shows ground beyond a lip, after the classifier has taken off those next to a
// drop.
constexpr double kMarginRows = 4.0;
constexpr double kMarginSigmas = 1.0;  // of disparity: how well one pixel's row of ground is known

// By true disparity in 1/16 px, linear within an octave; below one pixel all is bin 0.
constexpr int bin_of(int disparity_q4) {
    const auto value = static_cast<std::uint32_t>(disparity_q4);
    const int octave = std::bit_width(value) - 1;
    if (octave < 4) return 0;
    const auto part = static_cast<int>((value << 5U) >> static_cast<unsigned>(octave)) - kPerOctave;
    return (octave - 4) * kPerOctave + part;
}
constexpr double pixels_of(int bin) {
    return static_cast<double>(1 << (bin / kPerOctave)) *
           (1.0 + static_cast<double>(bin % kPerOctave) / kPerOctave);
}

}  // namespace

// One frame's geometry. With g the ground's true disparity at a pixel, the ground seen there lies at (x, y) /
// g.
struct SectorFinder::View {
    double scale = 0.0;  // f b
    double offset_px = 0.0;
    Linear ground;  // true disparity
    Linear x, y;
    BodyFrame body;
    double rows = 0.0;  // f h: over a range, rows below the horizon
};

SectorFinder::SectorFinder(const TerrainConfig& config, const RectifiedRig& rig, int min_disparity,
                           int disparities, Arena& arena, const RectifiedRig& shared)
    : config_(config),
      rig_(rig),
      last_disparity_(min_disparity + disparities - 1),
      count_(config.sectors),
      stretches_(2 * rig.height / kRows + 1),
      bins_(bin_of(std::max(1, last_disparity_ + 1) * 2 * kDisparityOne) + 1) {
    if (config.sectors < 1 || config.sectors > static_cast<int>(kMaxSectors))
        throw Refusal(ExitStatus::kConfig, "there can be 1 to " + std::to_string(kMaxSectors) +
                                               " sectors, not " + std::to_string(config.sectors));
    const auto sectors = static_cast<std::size_t>(count_);
    edges_ = arena.take<Edge>(sectors);
    middles_ = arena.take<Edge>(sectors);
    things_ = arena.take<Depth>(2 * sectors * static_cast<std::size_t>(bins_));
    ground_ = arena.take<Stretch>(sectors * static_cast<std::size_t>(stretches_));
    known_ = arena.take<std::uint32_t>(sectors);
    below_ = arena.take<std::uint32_t>(sectors);
    if (!rig.calibrated) return;
    const double yaw = det::radians(config.mount_yaw_deg);
    first_bearing_rad_ = yaw + det::atan(shared.cx_px / shared.focal_px);
    const double last = yaw - det::atan((shared.width - 1 - shared.cx_px) / shared.focal_px);
    width_rad_ = (first_bearing_rad_ - last) / count_;
    for (std::size_t i = 0; i < sectors; ++i) {
        const double right = first_bearing_rad_ - static_cast<double>(i + 1) * width_rad_;
        const double middle = right + 0.5 * width_rad_;
        edges_[i] = {{}, det::cos(right), det::sin(right)};
        middles_[i] = {{}, det::cos(middle), det::sin(middle)};
    }
}

SectorFinder::View SectorFinder::view_of(const Ground& ground) const {
    View view;
    view.scale = rig_.focal_px * rig_.baseline_m;
    view.offset_px = rig_.offset_px();
    view.ground = {ground.plane.du, ground.plane.dv, ground.plane.d0 - view.offset_px};
    view.body = body_frame(ground.pose, rig_, config_);
    const auto along = [&](double origin_m, double u, double v, double c) -> Linear {
        return {view.scale * u + origin_m * view.ground.u, view.scale * v + origin_m * view.ground.v,
                view.scale * c + origin_m * view.ground.c};
    };
    view.x = along(view.body.x_m, view.body.x_u, view.body.x_v, view.body.x_0);
    view.y = along(view.body.y_m, view.body.y_u, view.body.y_v, view.body.y_0);
    view.rows = rig_.focal_px * ground.pose.height_m;
    return view;
}

// Sectors run from left to right; a point is beyond a sector when it lies right of its right edge.
int SectorFinder::sector_of(double x, double y, int guess) const {
    const auto beyond = [&](int sector) {
        const Edge& edge = edges_[static_cast<std::size_t>(sector)];
        return edge.cosine * y - edge.sine * x < 0.0;
    };
    while (guess > 0 && !beyond(guess - 1))
        --guess;
    while (guess + 1 < count_ && beyond(guess))
        ++guess;
    return guess;
}

std::span<SectorFinder::Depth> SectorFinder::things_of(TerrainClass kind, int sector) const {
    const int row = kind == TerrainClass::kObstacle ? sector : count_ + sector;
    return things_.subspan(static_cast<std::size_t>(row) * static_cast<std::size_t>(bins_),
                           static_cast<std::size_t>(bins_));
}

// False where there is none.
bool SectorFinder::nearest(TerrainClass kind, int sector, const View& view, double& range_m,
                           double& sigma_m) const {
    const std::span<const Depth> depths = things_of(kind, sector);
    // The metres of a pixel are b / d.
    const double per_area = 1.0 / (kThingStep * kThingStep * rig_.baseline_m * rig_.baseline_m);
    const double least = 0.25 * config_.min_area_m2 * per_area;
    std::uint32_t within = 0;
    std::uint32_t most = 0;
    int found = -1;
    for (int bin = bins_ - 1; bin >= 0; --bin) {
        within += depths[static_cast<std::size_t>(bin)].count;
        if (bin + kSpan < bins_) within -= depths[static_cast<std::size_t>(bin + kSpan)].count;
        const bool large = within >= kEnough && within >= least * pixels_of(bin) * pixels_of(bin);
        if (large || within > most) {
            most = within;
            found = bin;
        }
        if (large) break;
    }
    if (found < 0) return false;
    // Of those, the 4th-nearest.
    int bin = std::min(found + kSpan, bins_) - 1;
    for (std::uint32_t passed = 0;; --bin) {
        passed += depths[static_cast<std::size_t>(bin)].count;
        if (passed >= std::min(kEnough, most)) break;
    }
    const float square = depths[static_cast<std::size_t>(bin)].nearest_square;
    range_m = std::sqrt(static_cast<double>(square));
    sigma_m = range_m * range_m * config_.sigma_disparity_px / view.scale;
    return true;
}

void SectorFinder::collect_things(ConstDisparityMap map, const View& view, ConstMask mask) {
    std::fill(things_.begin(), things_.end(), Depth{0, std::numeric_limits<float>::max()});
    // Obstacle and drop are the classes with the second bit set.
    constexpr std::uint64_t kThing = 0x0202020202020202U;
    const BodyFrame& body = view.body;
    const double offset_q4 = view.offset_px * kDisparityOne;
    for (int v = 0; v < mask.height; v += kThingStep) {
        const TerrainClass* kinds = mask.row(v);
        const std::int16_t* disparity = map.disparity_q4.row(v);
        const Invalid* invalid = map.invalid.row(v);
        int sector = 0;
        for (int from = 0; from < mask.width; from += 8) {
            const int to = std::min(from + 8, mask.width);
            std::uint64_t eight = kThing;
            if (to == from + 8) std::memcpy(&eight, kinds + from, 8);
            if ((eight & kThing) == 0) continue;
            for (int u = from; u < to; u += kThingStep) {
                if (kinds[u] != TerrainClass::kObstacle && kinds[u] != TerrainClass::kDrop) continue;
                if (invalid[u] != Invalid::kNone && invalid[u] != Invalid::kRangeEdge) continue;
                const int measured_q4 =
                    invalid[u] == Invalid::kRangeEdge ? last_disparity_ * kDisparityOne : disparity[u];
                const double true_q4 = std::max(measured_q4 - offset_q4, 1.0);
                const double depth = view.scale * kDisparityOne / true_q4;
                const double x = body.x_m + depth * body.along_x(u, v);
                const double y = body.y_m + depth * body.along_y(u, v);
                sector = sector_of(x, y, sector);
                const int bin = std::min(bin_of(static_cast<int>(true_q4)), bins_ - 1);
                Depth& cell = things_of(kinds[u], sector)[static_cast<std::size_t>(bin)];
                ++cell.count;
                cell.nearest_square = std::min(cell.nearest_square, static_cast<float>(x * x + y * y));
            }
        }
    }
}

// In the picture a bearing is a straight line through the body's foot point, so a row crosses the edges of
// the sectors from left to right, and between two of them a stretch's number is nearly linear in the column:
// f h / range, range measured along the sector's middle (at most 1 - cos of half its width too short).
void SectorFinder::count_ground(ConstDisparityMap map, const View& view, ConstMask mask) {
    std::fill(ground_.begin(), ground_.end(), Stretch{});
    std::fill(known_.begin(), known_.end(), 0U);
    std::fill(below_.begin(), below_.end(), 0U);
    const auto mix = [](const Linear& x, double a, const Linear& y, double b) -> Linear {
        return {a * x.u + b * y.u, a * x.v + b * y.v, a * x.c + b * y.c};
    };
    for (Edge& edge : edges_)
        edge.beyond = mix(view.x, -edge.sine, view.y, edge.cosine);
    for (Edge& middle : middles_)
        middle.beyond = mix(view.x, middle.cosine, view.y, middle.sine);
    const double per_row = view.rows / kRows;
    const double most = stretches_ - 1;
    for (int v = 0; v < mask.height; v += kRowStep) {
        if (view.ground.at(0, v) < 1.0 && view.ground.at(mask.width - 1, v) < 1.0) continue;
        const TerrainClass* kinds = mask.row(v);
        const Invalid* invalid = map.invalid.row(v);
        const std::int16_t* disparity = map.disparity_q4.row(v);
        int begin = 0;
        for (int i = 0; i < count_; ++i) {
            const auto at = static_cast<std::size_t>(i);
            const int first = begin;
            int end = mask.width;
            if (const Linear& line = edges_[at].beyond; i + 1 < count_) {
                const double crossing = line.u < 0.0 ? (line.v * v + line.c) / -line.u : mask.width;
                end = crossing < mask.width ? std::max(begin, static_cast<int>(crossing) + 1) : mask.width;
            }
            begin = end;
            const int start = (first + kGroundStep - 1) / kGroundStep * kGroundStep;
            if (start >= end) continue;
            const double left_px = view.ground.at(start, v);
            const double right_px = view.ground.at(end - 1, v);
            const double left_range = middles_[at].beyond.at(start, v);
            const double right_range = middles_[at].beyond.at(end - 1, v);
            if (left_px < 1.0 || right_px < 1.0 || left_range <= 0.0 || right_range <= 0.0) continue;
            const double left = std::min(per_row * left_px / left_range, most);
            const double right = std::min(per_row * right_px / right_range, most);
            constexpr double kOne = 1 << kFraction;
            auto number = static_cast<std::int32_t>(left * kOne);
            const auto step =
                end - 1 > start
                    ? static_cast<std::int32_t>((right - left) * (kOne * kGroundStep) / (end - 1 - start))
                    : 0;
            // Over a measured disparity, the same by what was measured.
            const double per_px = per_row / (left_range + right_range) * (2.0 / kDisparityOne);
            const double offset_q4 = view.offset_px * kDisparityOne;
            std::uint32_t below = 0;
            std::uint32_t known = 0;
            // Ground nearer than the search range cannot be seen and is no gap: what is seen begins there.
            const bool searched = left_px + right_px <= 2.0 * (last_disparity_ - 2);
            Stretch* const stretch = &ground_[at * static_cast<std::size_t>(stretches_)];
            for (int u = start; u < end; u += kGroundStep, number += step) {
                const bool outside = invalid[u] == Invalid::kBody || invalid[u] == Invalid::kNoImage;
                const auto counts = static_cast<std::uint16_t>(!outside);
                below += counts;
                known += kinds[u] != TerrainClass::kUnknown ? 1U : 0U;
                if (!searched) continue;
                Stretch& cell = stretch[number >> kFraction];
                cell.likely = static_cast<std::uint16_t>(cell.likely + counts);
                if (kinds[u] != TerrainClass::kTraversable) continue;
                ++cell.seen;
                const double measured = (disparity[u] - offset_q4) * per_px;
                ++stretch[measured < most ? static_cast<int>(measured) : stretches_ - 1].reached;
            }
            below_[at] += below;
            known_[at] += known;
        }
    }
}

// The first stretch, from the near edge of the view or from `from` on, that begins a gap; 0 where none does.
// A gap is at least kLeastGap long: there, less than `least_seen` of the samples are class 1, or nearly no
// disparity of class 1 lies there (the ground jumps away behind a lip, though by less than the tolerance).
int SectorFinder::first_gap(std::span<const Stretch> stretches, double rows, int from, double least_seen,
                            double least_jump) const {
    for (int number = from; number > 0; --number) {
        const Stretch& first = stretches[static_cast<std::size_t>(number)];
        if (first.likely == 0) continue;
        const bool unseen = first.seen < least_seen * first.likely;
        const bool unreached = first.reached < kReached * first.likely;
        if (!unseen && !unreached) continue;
        const double begin = rows / (kRows * (number + 1));
        int likely = 0;
        int seen = 0;
        int reached = 0;
        double length = 0.0;
        for (int n = number; n > 0 && (length < kLeastJump || kRows * (number - n) < least_jump); --n) {
            const Stretch& stretch = stretches[static_cast<std::size_t>(n)];
            likely += stretch.likely;
            seen += stretch.seen;
            reached += stretch.reached;
            const bool enough = length < kLeastGap;
            length = rows / (kRows * n) - begin;
            if (unseen && enough && length >= kLeastGap && seen < least_seen * likely) return number;
        }
        if (unseen && length < kLeastGap && seen < least_seen * likely) return number;
        if (unreached && reached < kReached * likely) return number;
    }
    return 0;
}

void SectorFinder::judge_ground(const View& view, int index, double range_limit_m, Sector& sector) const {
    const std::span<const Stretch> stretches =
        ground_.subspan(static_cast<std::size_t>(index * stretches_), static_cast<std::size_t>(stretches_));
    const double rows_per_px = view.rows / view.scale;  // 1 / dv, nearly
    const double jump = kJumpSigmas * config_.sigma_disparity_px * rows_per_px;
    int first = stretches_ - 1;
    while (first > 0 && stretches[static_cast<std::size_t>(first)].likely == 0)
        --first;
    int end = first_gap(stretches, view.rows, first, kWell, jump);
    if (first == 0 || end == first) return;
    const auto range = [&](double rows) { return view.rows / rows; };
    if (end == 0) {
        while (stretches[static_cast<std::size_t>(end + 1)].likely == 0)
            ++end;
        sector.free_range_m = range(kRows * (end + 1));
        return;
    }
    // Beyond the certified range nothing is seen as free, which is no lip.
    const Edge& middle = middles_[static_cast<std::size_t>(index)];
    const double certain_px = view.scale / std::max(range_limit_m, 1e-3) + 2.0 * config_.sigma_disparity_px;
    const double far = range(kRows * end);
    const double depth = view.body.depth_m(far * middle.cosine, far * middle.sine);
    const double margin = depth * certain_px < view.scale
                              ? kMarginRows + kMarginSigmas * config_.sigma_disparity_px * rows_per_px
                              : 0.0;
    sector.free_range_m = range(kRows * (end + 1) + margin);

    end = first_gap(stretches, view.rows, end, kHalf, jump);
    const double gap = range(kRows * (end + 1));
    if (end == 0 || gap >= config_.stopping_distance_m) return;
    // The outline of a thing is unknown, and so is the ground that it hides: that is the thing's gap.
    const double shadow = range(std::max(kRows * (end + 1) - (config_.blur_px + 2.0 * kRows), 1e-3));
    if (sector.blocked && sector.nearest_m <= shadow) return;
    sector.blocked = true;
    sector.kind = TerrainClass::kUnknown;
    sector.nearest_m = gap;
    sector.nearest_sigma_m = gap * gap * config_.sigma_disparity_px / view.scale;
}

void SectorFinder::find(ConstDisparityMap map, const Ground& ground, ConstMask mask, double range_limit_m,
                        FixedVector<Sector, kMaxSectors>& sectors) {
    sectors.clear();
    if (!rig_.calibrated || !ground.found || !ground.metric) return;
    assert(mask.same_size(rig_.width, rig_.height));
    const View view = view_of(ground);
    collect_things(map, view, mask);
    count_ground(map, view, mask);
    for (int i = 0; i < count_; ++i) {
        const auto at = static_cast<std::size_t>(i);
        Sector sector;
        sector.bearing_rad = first_bearing_rad_ - (i + 0.5) * width_rad_;
        sector.width_rad = width_rad_;
        for (const TerrainClass kind : {TerrainClass::kObstacle, TerrainClass::kDrop}) {
            double range = 0.0;
            double sigma = 0.0;
            if (!nearest(kind, i, view, range, sigma)) continue;
            if (sector.blocked && range >= sector.nearest_m) continue;
            sector.blocked = true;
            sector.kind = kind;
            sector.nearest_m = range;
            sector.nearest_sigma_m = sigma;
        }
        judge_ground(view, i, range_limit_m, sector);
        if (sector.blocked) sector.free_range_m = std::min(sector.free_range_m, sector.nearest_m);
        sector.coverage = below_[at] > 0 ? static_cast<double>(known_[at]) / below_[at] : 0.0;
        sectors.push_back(sector);
    }
}

}  // namespace groundline::terrain
