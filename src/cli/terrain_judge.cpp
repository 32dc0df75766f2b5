#include "cli/terrain_judge.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "core/deterministic_math.hpp"

namespace groundline::cli {
namespace {

void add(const TerrainScore& from, TerrainScore& to) {
    to.obstacle += from.obstacle;
    to.obstacle_found += from.obstacle_found;
    to.obstacle_free += from.obstacle_free;
    to.ground += from.ground;
    to.ground_alarmed += from.ground_alarmed;
    to.ground_known += from.ground_known;
    to.drop += from.drop;
    to.drop_found += from.drop_found;
    to.drop_free += from.drop_free;
}

double milliseconds(std::int64_t ns) {
    return static_cast<double>(ns) * 1e-6;
}

// Where a point of the ground lies in the picture: forward and left of the camera's foot.
struct OnGround {
    OnGround(const GroundPose& pose, const RectifiedRig& rig) : rig_(rig), height_m_(pose.height_m) {
        const double cos_pitch = det::cos(pose.pitch_rad);
        const double sin_pitch = det::sin(pose.pitch_rad);
        const double cos_roll = det::cos(pose.roll_rad);
        const double sin_roll = det::sin(pose.roll_rad);
        down_ = {sin_roll * cos_pitch, cos_roll * cos_pitch, sin_pitch};
        forward_ = {-sin_roll * sin_pitch, -cos_roll * sin_pitch, cos_pitch};
        left_ = {-cos_roll, sin_roll, 0.0};
    }
    bool in_picture(double forward_m, double left_m) const {
        std::array<double, 3> point{};
        for (std::size_t i = 0; i < 3; ++i)
            point[i] = height_m_ * down_[i] + forward_m * forward_[i] + left_m * left_[i];
        if (point[2] <= 0.0) return false;
        const double u = rig_.cx_px + rig_.focal_px * point[0] / point[2];
        const double v = rig_.cy_px + rig_.focal_px * point[1] / point[2];
        return u >= 0.0 && u <= rig_.width - 1 && v >= 0.0 && v <= rig_.height - 1;
    }

  private:
    const RectifiedRig& rig_;
    double height_m_;
    std::array<double, 3> down_{}, forward_{}, left_{};  // in camera axes
};

}  // namespace

double judged_range(const RectifiedRig& rig, double camera_height_m, double tolerance_m) {
    return std::min(kJudgedRange,
                    rig.focal_px * rig.baseline_m * tolerance_m / (3.0 * camera_height_m * 0.25));
}

void label_rendered(const synth::Truth& truth, const synth::Truth* deep, const RectifiedRig& rig,
                    double range_m, Mask seen, Mask all) {
    const double least = rig.focal_px * rig.baseline_m / range_m + rig.offset_px();
    for (int y = 0; y < all.height; ++y)
        for (int x = 0; x < all.width; ++x) {
            const double height = truth.height_m.at(x, y);
            TerrainClass label = TerrainClass::kUnknown;
            if (truth.seen.at(x, y) != 0 && truth.disparity_px.at(x, y) >= least) {
                const TerrainClass is = truth.terrain.at(x, y);
                const bool judged = is == TerrainClass::kObstacle ? height >= kStandsOut
                                    : is == TerrainClass::kTraversable
                                        ? std::abs(height) <= kGroundWithin
                                        : deep != nullptr && deep->terrain.at(x, y) == is;
                if (judged) label = is;
            }
            all.at(x, y) = label;
            seen.at(x, y) = truth.occluded.at(x, y) == 0 ? label : TerrainClass::kUnknown;
        }
}

double beyond_lip(std::span<const Sector> sectors, double lip_m, const GroundPose& pose,
                  const RectifiedRig& rig) {
    const OnGround ground(pose, rig);
    double most = -lip_m;
    for (const Sector& sector : sectors) {
        if (!ground.in_picture(lip_m, lip_m * det::tan(sector.bearing_rad))) continue;
        const double straight = std::max(0.0, std::abs(sector.bearing_rad) - 0.5 * sector.width_rad);
        most = std::max(most, sector.free_range_m - lip_m / det::cos(straight));
    }
    return most;
}

FrameScore judge(const FrameTruth& truth, const FrameAnswer& answer) {
    FrameScore score;
    score.verdict = answer.verdict;
    score.reasons = answer.reasons;
    score_terrain(truth.seen, answer.mask, score.seen);
    score_terrain(truth.all, answer.mask, score.all);
    if (truth.pose && answer.pose)
        score.pose_error = GroundPose{std::abs(answer.pose->pitch_rad - truth.pose->pitch_rad),
                                      std::abs(answer.pose->roll_rad - truth.pose->roll_rad),
                                      std::abs(answer.pose->height_m / truth.pose->height_m - 1.0)};
    if (truth.empty)
        score.false_obstacles =
            static_cast<int>(std::count_if(answer.obstacle_ranges_m.begin(), answer.obstacle_ranges_m.end(),
                                           [&](double range) { return range <= truth.range_m; }));
    if (truth.ditch_lip_m && truth.pose && answer.sectors)
        score.beyond_lip_m = beyond_lip(*answer.sectors, *truth.ditch_lip_m, *truth.pose, truth.rig);
    return score;
}

void TerrainPool::add(const FrameScore& score) {
    ++verdicts[static_cast<std::size_t>(score.verdict)];
    cli::add(score.seen, seen);
    cli::add(score.all, all);
    if (score.pose_error) {
        pitch_deg.push_back(det::degrees(score.pose_error->pitch_rad));
        roll_deg.push_back(det::degrees(score.pose_error->roll_rad));
        height_share.push_back(score.pose_error->height_m);
    }
    if (score.false_obstacles) {
        ++empty_frames;
        alarmed_frames += *score.false_obstacles > 0 ? 1 : 0;
        false_obstacles += *score.false_obstacles;
    }
    if (score.seen.drop > 0) {
        ++ditches;
        ditches_shown += 100 * score.seen.drop_free <= score.seen.drop ? 1 : 0;
    }
    if (score.beyond_lip_m) {
        most_beyond_lip_m = ditches_with_sectors == 0 ? *score.beyond_lip_m
                                                      : std::max(most_beyond_lip_m, *score.beyond_lip_m);
        ++ditches_with_sectors;
        ditches_before_lip += *score.beyond_lip_m <= 0.0 ? 1 : 0;
    }
    match_ms.push_back(milliseconds(score.match_ns));
    terrain_ms.push_back(milliseconds(score.terrain_ns));
}

std::optional<double> median_of(std::vector<double> values) {
    if (values.empty()) return std::nullopt;
    std::sort(values.begin(), values.end());
    const std::size_t middle = values.size() / 2;
    return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

std::optional<double> most_of(const std::vector<double>& values) {
    if (values.empty()) return std::nullopt;
    return *std::max_element(values.begin(), values.end());
}

}  // namespace groundline::cli
