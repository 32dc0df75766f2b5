// All that one frame becomes: what the sinks write, draw and publish.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/evidence.hpp"
#include "core/fixed_vector.hpp"
#include "core/frame.hpp"
#include "core/ground.hpp"
#include "core/rectified_rig.hpp"
#include "core/terrain_class.hpp"

namespace groundline {

// Row histogram of disparity: bin k of row v counts pixels with disparity about first_px + k / bins_per_px,
// in sixteenths of a pixel (a bilinear splat shares 16 units between two bins), saturating at 65535.
struct VDisparity {
    ImageView<std::uint16_t> histogram;
    int bins_per_px = 4;
    double first_px = 0.0;
};

// One connected thing on the ground. Metres only where the rig is calibrated, else 0.
struct Obstacle {
    TerrainClass kind = TerrainClass::kObstacle;
    bool overhang = false;  // wholly above the clearance height: class 0 in the mask, listed here
    std::int32_t left = 0, top = 0, right = 0, bottom = 0;  // bounding box in px, right and bottom included
    std::int32_t pixels = 0;
    double disparity_px = 0.0;  // median, measured
    double range_m = 0.0;       // along the optical axis, of its nearest tenth or 100 pixels
    double range_sigma_m = 0.0;
    // In the camera frame, positive to the left: of its middle and of the outer edges of its outermost
    // pixels.
    double bearing_rad = 0.0;
    double left_rad = 0.0;
    double right_rad = 0.0;
    double width_m =
        0.0;  // between those edges, across its bearing, at range_m; of its depth nothing is seen
    double height_m = 0.0;  // of its highest pixel above the ground
    double lowest_m = 0.0;  // of its lowest pixel above the ground
};
inline constexpr std::size_t kMaxObstacles = 128;

// What is known per bearing, in the body frame (x forward, y left). Ranges along the ground from the body
// origin. An empty sector is free only as far as ground was really seen: free_range_m.
struct Sector {
    double bearing_rad = 0.0;  // of its middle, positive to the left
    double width_rad = 0.0;
    // An obstacle or a drop was seen, or a gap inside the stopping distance: ground seen nearer, then none
    // (unseen, hidden, or a lip behind which it falls away). Ground never seen is no gap.
    bool blocked = false;
    bool held = false;  // blocked by what earlier frames saw: kind and nearest are theirs
    TerrainClass kind = TerrainClass::kUnknown;  // of the nearest such; a gap is unknown
    double nearest_m = 0.0;                      // to it, where blocked; of a gap its near edge
    double nearest_sigma_m = 0.0;
    // Ground seen from the near edge of the view on, the robot's own parts left out: it ends before the first
    // stretch of which less than three quarters were seen as traversable, and before a lip. 0 where nothing
    // is seen at the near edge (the left border of the view, say).
    double free_range_m = 0.0;
    double coverage = 0.0;  // share of its pixels below the horizon that are not unknown
};
inline constexpr std::size_t kMaxSectors = 64;

// One square of ground. Heights are above the ground found; NaN is not measured.
struct GridCell {
    static constexpr float kNotMeasured = std::numeric_limits<float>::quiet_NaN();

    TerrainClass kind = TerrainClass::kUnknown;
    std::int32_t points = 0;  // that made the class
    float elevation_m = kNotMeasured;
    float highest_m = kNotMeasured;
    float slope_rad = kNotMeasured;
    float roughness_m = kNotMeasured;
    float step_m = kNotMeasured;
    float index = kNotMeasured;  // of traversability, 0 (no) to 1
};

// The ground about the robot in the body frame (x forward, y left): cell (i, j) covers x in [x_m + i cell_m,
// x_m + (i + 1) cell_m), y in [y_m + j cell_m, y_m + (j + 1) cell_m). Row-major; empty where nobody asked.
struct TerrainGrid {
    std::span<GridCell> cells;
    int rows = 0;
    int columns = 0;
    double cell_m = 0.0;
    double x_m = 0.0;
    double y_m = 0.0;

    GridCell& at(int row, int column) const {
        return cells[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                     static_cast<std::size_t>(column)];
    }
};
// What one datagram holds, at ten bytes a cell.
inline constexpr std::size_t kMaxGridCells = 6500;

enum class Stage : std::uint8_t { kRead, kRectify, kMatch, kGround, kClassify, kWrite, kPublish, kCount };
inline constexpr std::array<std::string_view, static_cast<std::size_t>(Stage::kCount)> kStageNames = {
    "read", "rectify", "match", "ground", "classify", "write", "publish"};
using StageTimes = std::array<std::int64_t, static_cast<std::size_t>(Stage::kCount)>;  // ns

// Memory for one result, allocated once. Images are of the rectified left view.
struct FrameResult {
    FrameStamp stamp;
    RectifiedRig rig;
    double tolerance_m = 0.0;      // 0 without calibration
    double tolerance_ratio = 0.0;  // of the camera height; what was used without calibration

    Luma left;
    BgrView left_bgr;  // empty where the source has no colour
    DisparityMap disparity;
    ImageView<TerrainClass> mask;
    VDisparity v_disparity;

    Evidence evidence;
    Ground ground;
    Verdict verdict = Verdict::kBlind;
    Reasons reasons;
    std::array<double, kTerrainClasses> share{};  // of the mask, by class
    double range_limit_m = 0.0;                   // farthest range at which a pixel may be traversable
    FixedVector<Obstacle, kMaxObstacles> obstacles;
    FixedVector<Sector, kMaxSectors> sectors;
    TerrainGrid grid;
    StageTimes times_ns{};
};

}  // namespace groundline
