// What a terrain stage's answer to one frame is worth, ours or another's, and the figures of many frames.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cli/evaluation.hpp"
#include "core/evidence.hpp"
#include "core/ground.hpp"
#include "core/image.hpp"
#include "core/rectified_rig.hpp"
#include "core/result.hpp"
#include "core/terrain_class.hpp"
#include "synth/renderer.hpp"

namespace groundline::cli {

// Rules for rendered scenes, metres. On folders those of evaluation.hpp hold.
inline constexpr double kStandsOut = 0.25;       // obstacles at least this high are judged
inline constexpr double kDeeperThanDrop = 0.05;  // drops deeper than the tolerance by this

// Out to where three deviations of a quarter pixel are the tolerance, at most kJudgedRange:
// min(30, f b tolerance / (3 h 0.25 px)).
double judged_range(const RectifiedRig& rig, double camera_height_m, double tolerance_m);

// Labels of a rendered frame: obstacle = class 2 at least kStandsOut above the mean ground, ground = class 1
// within kGroundWithin of it, drop = class 3 in `deep`, the truth rendered at tolerance + kDeeperThanDrop
// (without one, no drops); nothing beyond range_m by true depth. `seen` holds only pixels that both cameras
// see, `all` the others too.
void label_rendered(const synth::Truth& truth, const synth::Truth* deep, const RectifiedRig& rig,
                    double range_m, Mask seen, Mask all);

// What is true of one frame.
struct FrameTruth {
    RectifiedRig rig;
    ConstMask seen;
    ConstMask all;
    std::optional<GroundPose> pose;
    double range_m = kJudgedRange;
    bool empty = false;                 // nothing stands in view: every obstacle is false
    std::optional<double> ditch_lip_m;  // along the ground from the camera's foot
};

// What a method says about it.
struct FrameAnswer {
    Verdict verdict = Verdict::kBlind;
    Reasons reasons;
    ConstMask mask;
    std::optional<GroundPose> pose;
    std::vector<double> obstacle_ranges_m;  // of each component of obstacles
    std::optional<std::span<const Sector>> sectors;
};

struct FrameScore {
    Verdict verdict = Verdict::kBlind;
    Reasons reasons;
    TerrainScore seen;
    TerrainScore all;
    std::optional<GroundPose> pose_error;  // |found - true|; height as a share of the true height
    std::optional<int> false_obstacles;    // components within the judged range; only where nothing stands
    // The farthest that a sector's free range reaches beyond the nearest point of the lip in that sector;
    // negative: it ends before. Only with a ditch and sectors.
    std::optional<double> beyond_lip_m;
    std::int64_t match_ns = 0;
    std::int64_t terrain_ns = 0;
};

FrameScore judge(const FrameTruth& truth, const FrameAnswer& answer);

// See FrameScore::beyond_lip_m. The lip crosses the view at lip_m straight ahead; a sector counts where the
// lip in its middle lies inside the picture. Sectors are about the camera's foot. No sectors: -lip_m, nothing
// is called free.
double beyond_lip(std::span<const Sector> sectors, double lip_m, const GroundPose& pose,
                  const RectifiedRig& rig);

// Frames taken together, each pixel weighing alike.
struct TerrainPool {
    std::array<int, 3> verdicts{};
    TerrainScore seen;
    TerrainScore all;
    std::vector<double> pitch_deg, roll_deg, height_share;  // errors of the frames with a ground
    int empty_frames = 0;
    int alarmed_frames = 0;  // of those, with a false obstacle
    int false_obstacles = 0;
    int ditches = 0;        // with judged pixels
    int ditches_shown = 0;  // at most 1 % of their pixels called free
    int ditches_with_sectors = 0;
    int ditches_before_lip = 0;  // every free range ends before the lip
    double most_beyond_lip_m = 0.0;
    std::vector<double> match_ms, terrain_ms;

    void add(const FrameScore& score);
};

std::optional<double> median_of(std::vector<double> values);
std::optional<double> most_of(const std::vector<double>& values);

}  // namespace groundline::cli
