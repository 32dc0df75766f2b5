// Scores of a result against the truth: pure functions over views that add up counts over frames.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/ground.hpp"
#include "core/image.hpp"
#include "core/rectified_rig.hpp"
#include "core/terrain_class.hpp"

namespace groundline::cli {

using DisparityQ8 = ConstImageView<std::uint16_t>;  // measured disparity x 256, 0 = none

// Counts of pixels, summed over frames. Everything a share is made of is kept, so shares of several frames
// weigh each pixel alike.
struct DisparityScore {
    std::int64_t occluded = 0;  // with truth, but not seen by the right camera: not scored
    std::int64_t scored = 0;    // with truth and seen by both cameras
    std::int64_t answered = 0;  // of the scored
    std::int64_t bad1 = 0;      // answered and off by more than 1 px
    std::int64_t bad3 = 0;      // answered and off by more than 3 px
    std::int64_t error_q8 = 0;  // sum of |answer - truth|, 1/256 px
};

// Adds one frame. `occluded` is not 0 where the right camera does not see the point; empty: nothing is. All
// of one size.
void score_disparity(DisparityQ8 truth, DisparityQ8 result, ConstLuma occluded, DisparityScore& score);

// Where `truth` itself shows that the right camera does not see a point: it falls outside the right image, or
// a point at least 1 px nearer falls on the same right pixel. 255 there, 0 elsewhere. Complete for a dense
// truth; for one that has points only here and there it finds what those hide.
void mark_occluded(DisparityQ8 truth, Luma occluded);

// Rules for what the truth is held to be, metres.
inline constexpr double kObstacleAbove = 0.30;
inline constexpr double kGroundWithin = 0.10;
inline constexpr double kJudgedRange = 30.0;

// Truth labels: class ids, kUnknown where nothing is judged.
//
// From class ids, and from heights (millimetres above the ground + 32768) where that view is not empty:
// obstacle = class 2 above kObstacleAbove, ground = class 1 within kGroundWithin, drop = class 3 at any
// height: who drew the scene knows its drops, and a ditch 0.20 m deep is one. Without heights the class alone
// decides.
void label_by_class(ConstLuma classes, ConstImageView<std::uint16_t> height_mm, Mask labels);
// From heights alone: the same limits, and drop below -kObstacleAbove.
void label_by_height(ConstImageView<std::uint16_t> height_mm, Mask labels);
// From disparities and the ground plane among them, for a calibrated rig: H = h (1 - d_g/d) with disparities
// without the offset and h from pose_of(plane). No drops: a truth so made is not exact enough below the
// ground.
void label_by_disparity(DisparityQ8 truth, const DisparityPlane& plane, const RectifiedRig& rig, Mask labels);
// Takes the label off every pixel farther than kJudgedRange or without true disparity; the rig is calibrated.
void limit_range(DisparityQ8 truth, const RectifiedRig& rig, Mask labels);

struct TerrainScore {
    std::int64_t obstacle = 0;        // labelled obstacle
    std::int64_t obstacle_found = 0;  // of them, class 2 in the mask
    std::int64_t obstacle_free = 0;   // of them, class 1: the worst error there is
    std::int64_t ground = 0;          // labelled ground
    std::int64_t ground_alarmed = 0;  // of them, class 2 or 3: false positives
    std::int64_t ground_known = 0;    // of them, any class but 0
    std::int64_t drop = 0;            // labelled drop
    std::int64_t drop_found = 0;      // of them, class 3
    std::int64_t drop_free = 0;       // of them, class 1
};
// Adds one frame; both of one size.
void score_terrain(ConstMask labels, ConstMask mask, TerrainScore& score);

// The ground plane among true disparities, for a calibrated rig: a deterministic search (planes through three
// points of a fixed pseudo-random choice; most points on it, points below it count against it), then
// Tukey-weighted least squares. Only planes a camera can stand on are considered: height 0.2 .. 2.5 m, pitch
// -5 .. 40 deg, roll within 12 deg. Nothing where fewer than a fifth of the points under the horizon lie on
// the plane found.
std::optional<DisparityPlane> fit_ground(DisparityQ8 truth, const RectifiedRig& rig);

// Differences of ground poses: the mean and the largest of |found - true|.
struct PoseScore {
    std::int64_t frames = 0;
    GroundPose sum;  // pitch and roll in rad; height as a share of the true height
    GroundPose most;
};
void score_pose(const GroundPose& found, const GroundPose& truth, PoseScore& score);

}  // namespace groundline::cli
