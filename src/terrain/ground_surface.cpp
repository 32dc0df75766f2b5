#include "terrain/ground_surface.hpp"

#include <algorithm>
#include <cmath>

namespace groundline::terrain {
namespace {

constexpr int kRowStep = 2;
constexpr int kColumnStep = 4;
constexpr int kStepsPerPx = 2;    // up to kFinePx
constexpr int kFinePx = 32;       // beyond, one step a pixel
constexpr double kLeastPx = 1.0;  // of ground that is seen
constexpr double kBinsPerTolerance = 6.0;
constexpr double kSlopeCost = 0.5;    // of the cap, for a step at the greatest slope
constexpr double kBeneathCost = 0.2;  // of what lies beneath
constexpr int kMostSteps = 8;         // height bins from one range to the next
constexpr double kGapBins = 0.5 * kBinsPerTolerance;
constexpr double kLipBins = 0.6 * kBinsPerTolerance;
constexpr double kLipRows = 6.0;
constexpr double kRampBins = 0.6 * kBinsPerTolerance;
// The profile is taken where it holds this much more than the plane does.
constexpr double kWorthwhile = 1.10;

}  // namespace

void GroundSurface::take(Arena& arena, int width, int /*height*/, int min_disparity, int disparities) {
    width_ = width;
    bands_ = (width + kBandColumns - 1) / kBandColumns;
    const auto bands = static_cast<std::size_t>(bands_);
    first_q4_ = min_disparity * kDisparityOne;
    step_of_q4_ = arena.take<std::uint16_t>(static_cast<std::size_t>(disparities) * kDisparityOne + 1);
    inverse_px_ = arena.take<double>(step_of_q4_.size());
    const int fine = std::min(disparities, kFinePx);
    fine_px_ = fine;
    steps_ = fine * kStepsPerPx + (disparities - fine) + 1;
    const auto steps = static_cast<std::size_t>(steps_);
    range_ = arena.take<double>(steps);
    counts_ = arena.take<std::uint16_t>(steps * bands * kCounts);
    pooled_ = arena.take<std::int32_t>(steps * kHeights);
    best_ = arena.take<std::int32_t>(steps * kHeights);
    from_ = arena.take<std::int8_t>(steps * kHeights);
    profile_ = arena.take<double>(steps);
    profile_seen_ = arena.take<bool>(steps);
    rise_ = arena.take<float>(step_of_q4_.size());
    support_ = arena.take<CellSupport>(steps * bands);
    for (std::size_t i = 0; i < step_of_q4_.size(); ++i) {
        const int q4 = static_cast<int>(i);
        const int fine_q4 = fine * kDisparityOne;
        step_of_q4_[i] =
            static_cast<std::uint16_t>(q4 < fine_q4 ? q4 * kStepsPerPx / kDisparityOne
                                                    : fine * kStepsPerPx + (q4 - fine_q4) / kDisparityOne);
    }
    flatten();
}

void GroundSurface::flatten(CellSupport support) {
    flat_ = true;
    std::fill(rise_.begin(), rise_.end(), 0.0F);
    std::fill(support_.begin(), support_.end(), support);
}

void GroundSurface::count(ConstDisparityMap map, const DisparityPlane& plane, double offset_px,
                          double tolerance) {
    height_bin_ = tolerance / kBinsPerTolerance;
    std::fill(counts_.begin(), counts_.end(), std::uint16_t{0});
    for (std::size_t i = 0; i < inverse_px_.size(); ++i) {
        const double true_px = (first_q4_ + static_cast<double>(i)) * (1.0 / kDisparityOne) - offset_px;
        inverse_px_[i] = 1.0 / std::max(true_px, 1.0 / kDisparityOne);
    }
    const double per_bin = 1.0 / height_bin_;
    const double zero = kZero + 0.5;
    for (int v = 0; v < map.height(); v += kRowStep) {
        const std::int16_t* disparity = map.disparity_q4.row(v);
        const Invalid* invalid = map.invalid.row(v);
        const double at_row = plane.dv * v + plane.d0 - offset_px;
        if (std::max(at_row, at_row + plane.du * map.width()) < kLeastPx) continue;
        for (int u = 0; u < map.width(); u += kColumnStep) {
            if (invalid[u] != Invalid::kNone) continue;
            const double ground = plane.du * u + at_row;
            if (ground < kLeastPx) continue;
            const std::size_t index = index_of(disparity[u]);
            const std::size_t at = cell(step_of_q4_[index], u / kBandColumns);
            const double bin = (1.0 - ground * inverse_px_[index]) * per_bin + zero;
            const int height = bin >= 0.0 && bin < kHeights ? static_cast<int>(bin) : kBeyond;
            ++counts_[at * kCounts + static_cast<std::size_t>(height)];
        }
    }
}

// The path of one height per step, from the nearest to the farthest. Returns whether it holds enough more
// than the plane does.
bool GroundSurface::trace_profile(double per_row_px) {
    // Ground across the whole view would put so many pixels into half a pixel of disparity.
    const int columns = width_ / kColumnStep;
    const double full = 0.5 / per_row_px / kRowStep * columns;
    const auto cap = static_cast<std::int32_t>(std::max(16.0, 0.5 * full));
    for (std::size_t step = 0; step < static_cast<std::size_t>(steps_); ++step)
        for (std::size_t j = 0; j < kHeights; ++j) {
            std::int32_t sum = 0;
            for (std::size_t band = 0; band < static_cast<std::size_t>(bands_); ++band)
                sum += counts_[(step * static_cast<std::size_t>(bands_) + band) * kCounts + j];
            pooled_[step * kHeights + j] = sum;
        }
    std::int64_t on_plane = 0;
    std::int32_t scores[kHeights];
    bool held[kHeights];  // enough pixels to step onto
    int last_seen = -1;   // step nearer by that shows anything level
    for (int step = steps_ - 1; step >= 0; --step) {
        const std::int32_t* pooled = &pooled_[static_cast<std::size_t>(step) * kHeights];
        std::int32_t beneath = 0;  // in bins below j - 2
        bool any = false;
        for (int j = 0; j < kHeights; ++j) {
            if (j >= 3) beneath += pooled[j - 3];
            const std::int32_t near =
                pooled[j] + (j > 0 ? pooled[j - 1] : 0) + (j + 1 < kHeights ? pooled[j + 1] : 0);
            held[j] = 4 * near >= cap;
            any = any || held[j];
            scores[j] = std::min(near, cap) -
                        static_cast<std::int32_t>(kBeneathCost * static_cast<double>(std::min(beneath, cap)));
        }
        on_plane += scores[kZero];
        std::int32_t* best = &best_[static_cast<std::size_t>(step) * kHeights];
        std::int8_t* from = &from_[static_cast<std::size_t>(step) * kHeights];
        if (step == steps_ - 1) {
            // The robot stands on the plane.
            for (int j = 0; j < kHeights; ++j) {
                best[j] = scores[j] - cap / 2 * std::abs(j - kZero);
                from[j] = 0;
            }
        } else {
            const std::int32_t* before = best + kHeights;
            const auto from_step = static_cast<std::size_t>(std::max(step + 1, last_seen));
            const double away = range_[static_cast<std::size_t>(step)] - range_[from_step];
            // Across a gap it may have risen or fallen by less than the robot may.
            const double limit = from_step == static_cast<std::size_t>(step + 1) ? kMostSteps : kGapBins;
            const double bins_at_most = std::min(kMaxSlope * away / height_bin_, limit);
            const int reach = std::max(static_cast<int>(bins_at_most + 0.5), 1);
            const double cost = kSlopeCost * cap / std::max(bins_at_most, 0.125);
            for (int j = 0; j < kHeights; ++j) {
                std::int32_t most = before[j];
                int came = 0;
                for (int move = -reach; move <= reach && held[j]; ++move) {
                    const int i = j + move;
                    if (i < 0 || i >= kHeights) continue;
                    const std::int32_t value = before[i] - static_cast<std::int32_t>(cost * std::abs(move));
                    if (value <= most) continue;
                    most = value;
                    came = move;
                }
                best[j] = most + scores[j];
                from[j] = static_cast<std::int8_t>(came);
            }
        }
        if (any) last_seen = step;
    }
    int at = 0;
    for (int j = 1; j < kHeights; ++j)
        if (best_[static_cast<std::size_t>(j)] > best_[static_cast<std::size_t>(at)]) at = j;
    const std::int64_t on_profile = best_[static_cast<std::size_t>(at)];
    for (int step = 0; step < steps_; ++step) {
        // The middle of what lies about the path.
        const std::int32_t* pooled = &pooled_[static_cast<std::size_t>(step) * kHeights];
        std::int64_t sum = 0;
        std::int64_t moment = 0;
        for (int j = std::max(0, at - 2); j <= std::min(kHeights - 1, at + 2); ++j) {
            sum += pooled[j];
            moment += static_cast<std::int64_t>(j - kZero) * pooled[j];
        }
        profile_seen_[static_cast<std::size_t>(step)] = 8 * sum >= cap;
        profile_[static_cast<std::size_t>(step)] =
            8 * sum >= cap ? static_cast<double>(moment) / static_cast<double>(sum) : at - kZero;
        at += from_[static_cast<std::size_t>(step) * kHeights + static_cast<std::size_t>(at)];
    }
    return static_cast<double>(on_profile) > kWorthwhile * static_cast<double>(on_plane);
}

DisparityPlane GroundSurface::levelled(const DisparityPlane& plane, double offset_px) const {
    // Least squares of rise = a + c range, every metre of seen ground counting alike.
    double w = 0.0, wx = 0.0, wxx = 0.0, wy = 0.0, wxy = 0.0;
    for (int step = 1; step + 1 < steps_; ++step) {
        const auto at = static_cast<std::size_t>(step);
        if (!profile_seen_[at]) continue;
        const double x = range_[at];
        const double y = height_bin_ * profile_[at];
        const double weight = std::min(0.5 * (range_[at - 1] - range_[at + 1]), 1.0);
        w += weight;
        wx += weight * x;
        wxx += weight * x * x;
        wy += weight * y;
        wxy += weight * x * y;
    }
    const double determinant = w * wxx - wx * wx;
    if (!(determinant > 0.01 * w * w)) return plane;
    const double c = (w * wxy - wx * wy) / determinant;
    const double a = (wy - c * wx) / w;
    if (!(a < 0.5)) return plane;
    // 1 - d_g / d = a + c f N / d  <=>  d = (d_g + c f N) / (1 - a)
    const double scale = 1.0 / (1.0 - a);
    return {plane.du * scale, plane.dv * scale,
            (plane.d0 - offset_px + c * focal_times_normal_) * scale + offset_px};
}

// Where the ground falls away behind a lip: beyond, the profile stays at the lip's height and is not seen.
// There is a lip where the profile is lower by most of the tolerance within so few picture rows that what
// lies between is hidden: a slope that the camera sees takes up more of them. Half of it is enough where
// cells are missing between.
void GroundSurface::cut_behind_lip(double per_row_px) {
    const auto ground_px = [&](int step) {
        const auto at = static_cast<std::size_t>(step);
        return (1.0 - height_bin_ * profile_[at]) * focal_times_normal_ / range_[at];
    };
    for (int lip = steps_ - 1; lip > 0; --lip) {
        if (!profile_seen_[static_cast<std::size_t>(lip)]) continue;
        const double height = profile_[static_cast<std::size_t>(lip)];
        const double last_px = ground_px(lip) - kLipRows * per_row_px - 1.0 / kStepsPerPx;
        bool falls = false;
        bool first = true;
        for (int step = lip - 1; step >= 0 && (first || ground_px(step) > last_px) && !falls; --step) {
            if (!profile_seen_[static_cast<std::size_t>(step)]) continue;
            const double most = first && step + 1 < lip ? kGapBins : kLipBins;
            falls = profile_[static_cast<std::size_t>(step)] < height - most;
            first = false;
        }
        if (!falls) continue;
        for (std::size_t step = 0; step < static_cast<std::size_t>(lip); ++step) {
            profile_[step] = height;
        }
        return;
    }
}

void GroundSurface::judge_cells() {
    for (int step = 0; step < steps_; ++step) {
        const double height = flat_ ? 0.0 : profile_[static_cast<std::size_t>(step)];
        const int level = kZero + static_cast<int>(std::floor(height + 0.5));
        for (int band = 0; band < bands_; ++band) {
            const std::size_t at = cell(step, band);
            const std::uint16_t* counts = &counts_[at * kCounts];
            int near = 0;
            int about = 0;
            for (int j = 0; j < kHeights; ++j) {
                about += counts[j];
                near += std::abs(j - level) <= 3 ? counts[j] : 0;
            }
            const bool supported = near >= 3 && 10 * near >= about + counts[kBeyond];
            const bool elsewhere = about >= 12 && 10 * near < about;
            support_[at] = supported   ? CellSupport::kSupported
                           : elsewhere ? CellSupport::kContradicted
                                       : CellSupport::kNone;
        }
    }
}

void GroundSurface::find(ConstDisparityMap map, const DisparityPlane& plane, double offset_px,
                         double focal_px, double tolerance, Parallel& /*parallel*/) {
    flatten();
    count(map, plane, offset_px, tolerance);
    // Z / h = f N / d with N = b / h, the length of the plane's normal in disparity.
    const double along = (plane.at(0.5 * map.width(), 0.5 * map.height()) - offset_px) / focal_px;
    focal_times_normal_ = focal_px * std::sqrt(plane.du * plane.du + plane.dv * plane.dv + along * along);
    std::size_t index = 0;
    for (int step = 0; step < steps_; ++step) {
        const std::size_t first = index;
        while (index + 1 < step_of_q4_.size() && step_of_q4_[index + 1] == step)
            ++index;
        range_[static_cast<std::size_t>(step)] = focal_times_normal_ * inverse_px_[(first + index) / 2];
        ++index;
    }
    const bool wavy = trace_profile(plane.dv);
    flat_ = !wavy;
}

// A step up across the whole view comes out as a ramp of nearly the greatest slope. What rises by most of the
// tolerance within four times it is as likely such a step: nothing there is called level.
void GroundSurface::doubt_ramps() {
    const double reach = 4.0 * kBinsPerTolerance * height_bin_;
    for (int near = steps_ - 1; near > 0; --near) {
        int far = near;
        while (far > 0 &&
               range_[static_cast<std::size_t>(far - 1)] <= range_[static_cast<std::size_t>(near)] + reach)
            --far;
        if (profile_[static_cast<std::size_t>(far)] - profile_[static_cast<std::size_t>(near)] < kRampBins)
            continue;
        for (int step = far; step <= near; ++step)
            for (int band = 0; band < bands_; ++band)
                support_[cell(step, band)] = CellSupport::kContradicted;
    }
}

void GroundSurface::settle(double per_row_px) {
    if (!flat_) cut_behind_lip(per_row_px);
    // Steps are known in their middle; between them the surface is straight.
    for (std::size_t i = 0; i < rise_.size() && !flat_; ++i) {
        const int step = step_of_q4_[i];
        const double px = static_cast<double>(i) / kDisparityOne;
        const double wide = px < fine_px_ ? 1.0 / kStepsPerPx : 1.0;
        const double from_middle = (px - wide * std::floor(px / wide)) / wide - 0.5;
        const int other = std::clamp(from_middle < 0.0 ? step - 1 : step + 1, 0, steps_ - 1);
        const double share = std::fabs(from_middle);
        rise_[i] =
            static_cast<float>(height_bin_ * ((1.0 - share) * profile_[static_cast<std::size_t>(step)] +
                                              share * profile_[static_cast<std::size_t>(other)]));
    }
    judge_cells();
    if (!flat_) doubt_ramps();
}

}  // namespace groundline::terrain
