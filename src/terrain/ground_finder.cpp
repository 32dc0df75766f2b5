#include "terrain/ground_finder.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/deterministic_math.hpp"
#include "core/error.hpp"
#include "terrain/v_disparity.hpp"

namespace groundline::terrain {
namespace {

constexpr int kUnitsPerPixel = 16;
constexpr double kNearPx = 1.0;
constexpr double kInlierPx = 1.5;
constexpr double kResidualPx = 3.0;
constexpr int kTallyStep = 4;  // columns
// Without calibration: focal length over width and baseline over height of real rigs.
constexpr double kFocalMin = 0.5, kFocalMax = 1.5;
constexpr double kSlopeMin = 0.015, kSlopeMax = 1.0;

}  // namespace

GroundFinder::GroundFinder(const TerrainConfig& config, const RectifiedRig& rig, int min_disparity,
                           int disparities, Arena& arena)
    : config_(config),
      rig_(rig),
      last_disparity_(min_disparity + disparities - 1),
      disparities_(disparities) {
    if (rig.width < 32 || rig.height < 32)
        throw Refusal(ExitStatus::kConfig, "pictures of " + std::to_string(rig.width) + " x " +
                                               std::to_string(rig.height) +
                                               " px are too small to find ground in; 32 x 32 is the least");
    if (disparities < 2)
        throw Refusal(ExitStatus::kConfig, "a search range of " + std::to_string(disparities) +
                                               " disparities shows no ground; 2 is the least");
    const Gate& gate = config.gate;
    if (!(gate.height_min_m > 0.0) || !(gate.height_min_m < gate.height_max_m) ||
        !(gate.pitch_min_deg < gate.pitch_max_deg) || !(gate.roll_max_deg > 0.0) ||
        !(gate.pitch_min_deg > -80.0) || !(gate.pitch_max_deg < 80.0) || !(gate.roll_max_deg < 45.0))
        throw Refusal(ExitStatus::kConfig,
                      "the gate for the ground's pose is empty or beyond 80 deg of pitch or 45 deg of roll; "
                      "check the mount's height, pitch and roll");
    offset_px_ = rig.calibrated ? rig.offset_px() : 0.0;
    centre_u_ = rig.calibrated ? rig.cx_px : 0.5 * rig.width;
    centre_v_ = rig.calibrated ? rig.cy_px : 0.5 * rig.height;

    row_step_ = 2 * std::max(1, (rig.height + 240) / 480);
    line_gate_.slope_min = arena.take<double>(Hough::kMaxHorizons);
    line_gate_.slope_max = arena.take<double>(Hough::kMaxHorizons);
    set_line_gate(config.gate);
    // From the highest horizon of any gate to the last row.
    hough_.take(arena,
                static_cast<int>((rig.height + std::max(0.0, -line_gate_.horizon_first)) / row_step_) + 2);
    plane_fit_.take(arena, rig.width, rig.height);
    surface_.take(arena, rig.width, rig.height, min_disparity, disparities);
    tally_ = arena.take<RowTally>(static_cast<std::size_t>(rig.height));
    column_mass_ = arena.take<std::uint32_t>(static_cast<std::size_t>(disparities) * 4 + 1);
}

Gate GroundFinder::gate_for(const GroundPose* prior) const {
    Gate gate = config_.gate;
    if (prior == nullptr || !rig_.calibrated) return gate;
    const double pitch_deg = det::degrees(prior->pitch_rad);
    gate.pitch_min_deg = std::max(gate.pitch_min_deg, pitch_deg - 8.0);
    gate.pitch_max_deg = std::min(gate.pitch_max_deg, pitch_deg + 8.0);
    gate.height_min_m = std::max(gate.height_min_m, 0.7 * prior->height_m);
    gate.height_max_m = std::min(gate.height_max_m, 1.3 * prior->height_m);
    const bool empty = !(gate.pitch_min_deg < gate.pitch_max_deg) || !(gate.height_min_m < gate.height_max_m);
    return empty ? config_.gate : gate;
}

void GroundFinder::set_line_gate(const Gate& gate) {
    const double bottom = rig_.height - 1.0;
    const double tan_steep = det::tan(det::radians(gate.pitch_max_deg));
    const double tan_flat = det::tan(det::radians(gate.pitch_min_deg));
    double highest = 0.0;
    double lowest = 0.0;
    if (rig_.calibrated) {
        highest = centre_v_ - rig_.focal_px * tan_steep;
        lowest = centre_v_ - rig_.focal_px * tan_flat;
    } else {
        const double longest = kFocalMax * rig_.width;
        const double shortest = kFocalMin * rig_.width;
        highest = centre_v_ - tan_steep * (tan_steep > 0.0 ? longest : shortest);
        lowest = centre_v_ - tan_flat * (tan_flat > 0.0 ? shortest : longest);
    }
    // A ground seen on less than a sixteenth of the rows is none.
    lowest = std::min(lowest, bottom - rig_.height / 16.0);
    highest = std::min(highest, lowest - 2.0 * row_step_);
    // Horizons lie on the rows of the histograms, so that row distances come from a table.
    LineGate& lines = line_gate_;
    lines.bottom_row = bottom;
    highest = row_step_ * std::floor(highest / row_step_);
    const int steps = static_cast<int>((lowest - highest) / row_step_) + 1;
    lines.rows_per_step = (steps + Hough::kMaxHorizons - 1) / Hough::kMaxHorizons;
    lines.horizon_first = highest;
    lines.horizon_step = 1.0 * row_step_ * lines.rows_per_step;
    lines.count = steps / lines.rows_per_step;
    for (int j = 0; j < lines.count; ++j) {
        const auto at = static_cast<std::size_t>(j);
        if (!rig_.calibrated) {
            lines.slope_min[at] = kSlopeMin;
            lines.slope_max[at] = kSlopeMax;
            continue;
        }
        // slope = b cos(pitch) / h for the pitch of this horizon
        const double tangent = (centre_v_ - (highest + j * lines.horizon_step)) / rig_.focal_px;
        const double scale = rig_.baseline_m / std::sqrt(1.0 + tangent * tangent);
        lines.slope_min[at] = scale / gate.height_max_m;
        lines.slope_max[at] = scale / gate.height_min_m;
    }
}

bool GroundFinder::fit(ConstDisparityMap map, const VDisparity& v_disparity, const Gate& gate,
                       Parallel& parallel, PlaneFitResult& best, double& second_ratio) {
    // Every row_step_-th row of the v-disparity image, in true disparity.
    const ImageView<std::uint16_t>& cells = v_disparity.histogram;
    RowHistogram histogram;
    histogram.cells = {cells.data, cells.width, (cells.height + row_step_ - 1) / row_step_,
                       cells.stride * row_step_};
    histogram.row_step = row_step_;
    histogram.first_px = v_disparity.first_px - offset_px_;
    histogram.bins_per_px = v_disparity.bins_per_px;
    const int cap = std::max(4, map.width() / 16) * kUnitsPerPixel;
    const HoughResult found = hough_.find(histogram, line_gate_, 2.0 * (disparities_ + 1), cap, config_.line);

    // Roll blurs the line, evenly to both sides of where it is in the middle column: each peak is turned by
    // some rolls about that column and brought to the plane next to it on a thin sample of pixels. The weight
    // of the pixels on a plane decides.
    plane_fit_.sample(map, offset_px_);
    constexpr int kRolls = 5;
    const int rolls = config_.line == LineMode::kVotes ? kRolls : 1;
    std::array<PlaneFitResult, static_cast<std::size_t>(HoughResult::kPeaks) * kRolls> planes{};
    // Without calibration the gate is so wide that facades fill it: of a drive's 26 frames 21 were found
    // among three peaks, all among five. With calibration three find as much.
    const int peaks = std::min(found.count, rig_.calibrated ? 3 : 5);
    std::array<Line, HoughResult::kPeaks> lines{};
    for (std::size_t i = 0; i < static_cast<std::size_t>(peaks); ++i)
        lines[i] = refine_line(histogram, found.lines[i], cap);
    parallel.for_each(peaks * rolls, [&](int index, int) {
        const Line line = lines[static_cast<std::size_t>(index / rolls)];
        constexpr int kMiddle = kRolls / 2;
        const double away = rolls == 1 ? 0.0 : gate.roll_max_deg * (index % rolls - kMiddle) / kMiddle;
        const double tangent = det::tan(det::radians(gate.roll_deg + away));
        DisparityPlane start;
        start.du = line.slope * tangent;
        start.dv = line.slope;
        start.d0 = -line.slope * (centre_u_ * tangent + line.horizon_row) + offset_px_;
        planes[static_cast<std::size_t>(index)] = plane_fit_.approach(start);
    });
    // Most starts end in one of a few planes; each of those is followed once.
    std::size_t count = 0;
    for (const PlaneFitResult& plane : planes) {
        const auto known = [&](const PlaneFitResult& other) { return nearly_same(plane.plane, other.plane); };
        if (plane.found &&
            std::none_of(planes.begin(), planes.begin() + static_cast<std::ptrdiff_t>(count), known))
            planes[count++] = plane;
    }
    std::fill(planes.begin() + static_cast<std::ptrdiff_t>(count), planes.end(), PlaneFitResult{});
    parallel.for_each(static_cast<int>(count), [&](int index, int) {
        PlaneFitResult& plane = planes[static_cast<std::size_t>(index)];
        plane = plane_fit_.converge(plane.plane);
    });
    // Nothing lies beneath the ground that the robot stands on.
    const auto worth = [](const PlaneFitResult& plane) { return plane.weight - plane.beneath; };
    const auto better = [&](const PlaneFitResult& a, const PlaneFitResult& b) {
        const bool a_inside = a.found && inside(a.plane, gate);
        const bool b_inside = b.found && inside(b.plane, gate);
        return a_inside != b_inside ? a_inside : a.found && (!b.found || worth(a) > worth(b));
    };
    PlaneFitResult strongest;
    for (const PlaneFitResult& plane : planes)
        if (better(plane, strongest)) strongest = plane;
    if (!strongest.found) return false;
    // A verge or a pavement beside the road makes planes through both that a fit settles on: look about,
    // a few degrees of roll and a few pixels away, for one that holds more.
    constexpr std::array<std::array<double, 2>, 6> kAbout = {
        {{0.03, 0.0}, {-0.03, 0.0}, {0.06, 0.0}, {-0.06, 0.0}, {0.0, 2.0}, {0.0, -2.0}}};
    constexpr int kRounds = 2;
    for (int round = 0; round < kRounds; ++round) {
        std::array<PlaneFitResult, kAbout.size()> about{};
        parallel.for_each(static_cast<int>(kAbout.size()), [&](int index, int) {
            const auto i = static_cast<std::size_t>(index);
            DisparityPlane start = strongest.plane;
            const double du = kAbout[i][0] * start.dv;
            start.du += du;
            start.d0 += kAbout[i][1] - du * centre_u_;
            about[i] = plane_fit_.converge(start);
        });
        const PlaneFitResult before = strongest;
        for (const PlaneFitResult& plane : about)
            if (better(plane, strongest)) strongest = plane;
        if (worth(strongest) <= worth(before) + 0.01 * before.weight) break;
    }
    // A rival counts by what it alone explains: a steeper plane through the same pixels is no second ground.
    second_ratio = 0.0;
    for (const PlaneFitResult& plane : planes)
        if (plane.found && inside(plane.plane, gate))
            second_ratio = std::max(second_ratio,
                                    plane_fit_.own_weight(plane.plane, strongest.plane) / strongest.weight);
    best = plane_fit_.fit(strongest.plane, parallel);
    return best.found;
}

// Ground with waves: the plane is levelled by the profile found about it, and the profile found anew.
void GroundFinder::shape(ConstDisparityMap map, DisparityPlane& plane, Parallel& parallel) {
    constexpr int kRounds = 3;
    const double focal = rig_.calibrated ? rig_.focal_px : 1.0 * rig_.width;
    for (int round = 0; round <= kRounds; ++round) {
        surface_.find(map, plane, offset_px_, focal, tolerance_share(plane), parallel);
        if (surface_.flat() || round == kRounds) break;
        plane = surface_.levelled(plane, offset_px_);
    }
    surface_.settle(plane.dv);
}

// The tolerance over the camera's height.
double GroundFinder::tolerance_share(const DisparityPlane& plane) const {
    if (!rig_.calibrated) return config_.tolerance_ratio;
    return std::min(config_.tolerance_up_m, config_.tolerance_down_m) / pose_of(plane, rig_).height_m;
}

void GroundFinder::tally(ConstDisparityMap map, const DisparityPlane& plane, Parallel& parallel) {
    constexpr int kRowsPerTask = 16;
    const int tasks = (map.height() + kRowsPerTask - 1) / kRowsPerTask;
    parallel.for_each(tasks, [&](int task, int) {
        for (int v = task * kRowsPerTask; v < std::min(map.height(), (task + 1) * kRowsPerTask); v += 2) {
            const std::int16_t* disparity = map.disparity_q4.row(v);
            const Invalid* invalid = map.invalid.row(v);
            const double at_row = plane.dv * v + plane.d0;
            RowTally row;
            for (int u = 0; u < map.width(); u += kTallyStep) {
                if (invalid[u] == Invalid::kBody) continue;  // the robot's own parts hide nothing
                const bool valid = invalid[u] == Invalid::kNone;
                row.blocked += valid ? 0 : 1;
                const double expected = plane.du * u + at_row;
                if (expected - offset_px_ < 1.0) continue;
                ++row.below;
                if (!valid) continue;
                ++row.valid;
                double residual = disparity[u] * (1.0 / kDisparityOne) - expected;
                if (!surface_.flat()) {
                    const double rise = surface_.rise(disparity[u]);
                    residual -= rise / (1.0 - rise) * (expected - offset_px_);
                }
                const double size = std::fabs(residual);
                const double most = kernels::reach_px(kResidualPx, expected - offset_px_);
                if (size >= most) {
                    row.standing += residual > 0.0 ? 1 : 0;
                    continue;
                }
                row.near += size <= kNearPx ? 1 : 0;
                const bool inlier = size <= kInlierPx;
                row.inliers += inlier ? 1 : 0;
                row.square += inlier ? residual * residual : 0.0;
                const double t = residual / most;
                const double weight = (1.0 - t * t) * (1.0 - t * t);
                row.weight += weight;
                row.residual += weight * residual;
            }
            // Each row looked at stands for the one below it too.
            tally_[static_cast<std::size_t>(v)] = row;
            if (v + 1 < map.height()) tally_[static_cast<std::size_t>(v + 1)] = row;
        }
    });
}

// Share of pixels spread evenly over the search range that lie within so many pixels of any plane.
double GroundFinder::chance(double within_px) const {
    return std::min(1.0, 2.0 * within_px / disparities_);
}

// Length of the longest run of rows that this frame's own pixels support, short gaps bridged.
int GroundFinder::supported_run(const DisparityPlane& plane) const {
    const int height = static_cast<int>(tally_.size());
    const double share = std::max(0.1, std::min(0.5, 3.0 * chance(kNearPx)));
    const int least = std::max(3, rig_.width / 320);
    const int gap = std::max(2, height / 40);
    int longest = 0;
    int run_start = -1;
    int last_supported = -1;
    for (int v = height - 1; v >= 0; --v) {
        const RowTally& row = tally_[static_cast<std::size_t>(v)];
        const double ground_px = plane.at(centre_u_, v);
        const bool possible = ground_px <= last_disparity_ + 2.0;
        const bool supported = possible && row.near >= least && row.near >= share * row.valid;
        if (!supported) continue;
        if (run_start < 0 || last_supported - v > gap + 1) run_start = v;
        last_supported = v;
        longest = std::max(longest, run_start - v + 1);
    }
    return longest;
}

// Whether two planes differ by less than a pixel at the picture's corners below its middle.
bool GroundFinder::nearly_same(const DisparityPlane& a, const DisparityPlane& b) const {
    for (const double u : {0.0, 1.0 * rig_.width})
        for (const double v : {0.5 * rig_.height, 1.0 * rig_.height})
            if (std::fabs(a.at(u, v) - b.at(u, v)) > 1.0) return false;
    return true;
}

bool GroundFinder::inside(const DisparityPlane& plane, const Gate& gate) const {
    if (!(plane.dv > 0.0)) return false;
    const double tangent = plane.du / plane.dv;
    const double roll_deg = det::degrees(det::atan(tangent));
    if (std::fabs(roll_deg - gate.roll_deg) > gate.roll_max_deg) return false;
    if (!rig_.calibrated) {
        const double horizon = -(plane.du * centre_u_ + plane.d0) / plane.dv;
        const double last = line_gate_.horizon_first + (line_gate_.count - 1) * line_gate_.horizon_step;
        return plane.dv >= kSlopeMin && plane.dv <= kSlopeMax && horizon >= line_gate_.horizon_first &&
               horizon <= last + line_gate_.horizon_step;
    }
    const GroundPose pose = pose_of(plane, rig_);
    const double pitch_deg = det::degrees(pose.pitch_rad);
    return pitch_deg >= gate.pitch_min_deg && pitch_deg <= gate.pitch_max_deg &&
           pose.height_m >= gate.height_min_m && pose.height_m <= gate.height_max_m;
}

// Whether a plane is nearer to upright than to level: its normal points less than half downward.
bool GroundFinder::leans(const DisparityPlane& plane) const {
    const double focal = rig_.calibrated ? rig_.focal_px : static_cast<double>(rig_.width);
    const double along = (plane.at(centre_u_, centre_v_) - offset_px_) / focal;
    const double square = plane.du * plane.du + plane.dv * plane.dv + along * along;
    return !(plane.dv > 0.0) || plane.dv * plane.dv < 0.25 * square;
}

// The largest mass, in pixels, that any 2 px of disparity hold in the rows from first_row down: what is
// upright and faces the camera has one disparity in all its rows.
double GroundFinder::upright_mass(const VDisparity& v_disparity, int first_row) {
    const int bins = v_disparity.histogram.width;
    std::fill(column_mass_.begin(), column_mass_.end(), 0U);
    for (int v = std::max(0, first_row); v < v_disparity.histogram.height; ++v) {
        const std::uint16_t* cells = v_disparity.histogram.row(v);
        for (int k = 0; k < bins; ++k)
            column_mass_[static_cast<std::size_t>(k)] += cells[k];
    }
    const int window = 2 * v_disparity.bins_per_px + 1;
    std::uint64_t mass = 0;
    std::uint64_t most = 0;
    for (int k = 0; k < bins; ++k) {
        mass += column_mass_[static_cast<std::size_t>(k)];
        if (k >= window) mass -= column_mass_[static_cast<std::size_t>(k - window)];
        most = std::max(most, mass);
    }
    return static_cast<double>(most) / kUnitsPerPixel;
}

void GroundFinder::find(ConstDisparityMap map, VDisparity& v_disparity, Parallel& parallel,
                        const GroundPose* prior, GroundEvidence& evidence, Ground& ground) {
    evidence = {};
    ground = {};
    surface_.flatten();
    build_v_disparity(map, v_disparity, parallel);
    const Gate gate = gate_for(prior);
    set_line_gate(gate);

    PlaneFitResult fitted;
    double second_ratio = 0.0;
    const bool has_plane = fit(map, v_disparity, gate, parallel, fitted, second_ratio);
    // Without a plane the tallies are of the lower half: a plane that is 1 px there and below.
    DisparityPlane plane = fitted.plane;
    if (!has_plane) plane = {0.0, 1.0, 1.0 + offset_px_ - 0.5 * rig_.height};
    if (has_plane) shape(map, plane, parallel);
    tally(map, plane, parallel);

    const int height = map.height();
    const int lower_third = height - height / 3;
    double below = 0, valid = 0, standing = 0, inliers = 0, blocked = 0, square = 0;
    double row_residuals = 0.0;
    int rows_with_residual = 0;
    int rows_below = 0;
    int first_below = height;
    for (int v = 0; v < height; ++v) {
        const RowTally& row = tally_[static_cast<std::size_t>(v)];
        below += row.below;
        valid += row.valid;
        standing += row.standing;
        inliers += row.inliers;
        if (v >= lower_third) blocked += row.blocked;
        square += row.square;
        if (row.weight >= std::max(3, rig_.width / 320)) {
            row_residuals += std::fabs(row.residual / row.weight);
            ++rows_with_residual;
        }
        if (2 * kTallyStep * row.below >= map.width()) {
            ++rows_below;
            first_below = std::min(first_below, v);
        }
    }
    evidence.density = below > 0 ? valid / below : 0.0;
    evidence.blocked_share = blocked * kTallyStep / (1.0 * map.width() * (height - lower_third));
    const double upright = upright_mass(v_disparity, first_below);
    if (!has_plane) {
        evidence.wall = valid > 0 && upright > 0.5 * kTallyStep * valid;
        return;
    }
    evidence.inlier_share = valid > standing ? inliers / (valid - standing) : 0.0;
    evidence.line_run_share =
        rows_below > 0 ? std::min(1.0, static_cast<double>(supported_run(plane)) / rows_below) : 0.0;
    evidence.second_peak_ratio = second_ratio;
    evidence.residual_rms_px = inliers > 0 ? std::sqrt(square / inliers) : 0.0;
    evidence.row_residual_px = rows_with_residual > 0 ? row_residuals / rows_with_residual : 0.0;
    evidence.inside_gate = inside(plane, gate);
    evidence.wall = leans(plane) || upright > kTallyStep * inliers;
    // Twice what pixels spread evenly over the search range would put on any plane.
    const double least_share = std::max(0.1, std::min(0.5, 2.0 * chance(kInlierPx)));
    evidence.line_found = inliers >= least_share * valid && evidence.line_run_share >= 0.1;
    ground.found = evidence.line_found && evidence.inside_gate && !evidence.wall;
    if (!ground.found) {
        surface_.flatten();
        return;
    }
    ground.plane = plane;
    ground.covariance = fitted.covariance;
    ground.metric = rig_.calibrated;
    if (!rig_.calibrated) return;
    ground.pose = pose_of(plane, rig_);
    ground.sigma = pose_sigma(plane, fitted.covariance, rig_);
}

}  // namespace groundline::terrain
