// A frame result whose every field differs from its default, for the tests of publishing.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/arena.hpp"
#include "core/result.hpp"

namespace groundline::publish::test {

// Owns the images of `result`. The mask is the upper half unknown, the lower half traversable with one
// obstacle pixel in the middle of its first row.
struct Frame {
    Arena arena;
    FrameResult result;

    Frame(int width, int height) {
        result.stamp.sequence = 41;
        result.stamp.position = 7;
        result.stamp.utime_us = 1'600'000'000'123'456;
        result.stamp.exposure_mono_ns = 77'000'000'123;
        result.stamp.skew_ns = 250'000;
        result.stamp.source = StampSource::kStartOfExposure;
        result.rig = {width, height, true, 500.0, 320.5, 240.25, 318.5, 0.125};
        result.tolerance_m = 0.2;
        result.tolerance_ratio = 0.15;
        result.left = arena.image<std::uint8_t>(width, height);
        result.mask = arena.image<TerrainClass>(width, height);
        for (int y = 0; y < height; ++y) {
            for (int x = 0; x < width; ++x) {
                result.left.at(x, y) = static_cast<std::uint8_t>(100 + x % 3);
                result.mask.at(x, y) = y < height / 2 ? TerrainClass::kUnknown : TerrainClass::kTraversable;
            }
        }
        result.mask.at(width / 2, height / 2) = TerrainClass::kObstacle;
        result.v_disparity.histogram = arena.image<std::uint16_t>(4 * 64, height);
        result.v_disparity.first_px = 2.0;
        for (int y = height / 2; y < height; ++y)
            result.v_disparity.histogram.at((y - height / 2) % (4 * 64), y) = 160;

        result.evidence.calibrated = true;
        result.evidence.photometric.gain = 1.03;
        result.evidence.photometric.offset = -1.5;
        GroundEvidence& fit = result.evidence.ground_fit;
        fit.line_found = fit.inside_gate = true;
        fit.density = 0.75;
        fit.inlier_share = 0.625;
        fit.line_run_share = 0.875;
        fit.second_peak_ratio = 0.25;
        fit.residual_rms_px = 0.375;
        fit.row_residual_px = 0.125;
        fit.blocked_share = 0.0625;
        result.ground.found = true;
        result.ground.metric = true;
        result.ground.plane = {0.001, 0.0625, -15.0};
        for (int i = 0; i < 9; ++i)
            result.ground.covariance.at(static_cast<std::size_t>(i)) = 0.5 * (i + 1);
        result.ground.pose = {0.2, -0.05, 1.5};
        result.ground.sigma = {0.002, 0.001, 0.01};
        result.verdict = Verdict::kTrusted;
        result.reasons.add(Reason::kNoMountPrior);
        result.share = {0.5, 0.25, 0.125, 0.125};
        result.range_limit_m = 11.5;
        result.sectors.push_back({0.25, 0.5, true, true, TerrainClass::kDrop, 3.5, 0.125, 2.5, 0.75});
        result.sectors.push_back({-0.25, 0.5, false, false, TerrainClass::kUnknown, 0.0, 0.0, 6.5, 1.0});
        result.obstacles.push_back({TerrainClass::kObstacle, false, 3, 1, 5, 2, 6, 12.5, 5.25, 0.0625, -0.125,
                                    0.0625, -0.25, 1.5, 0.75, -0.03125});
        result.obstacles.push_back(
            {TerrainClass::kDrop, true, 0, 0, 1, 3, 4, 2.5, 25.0, 0.5, 0.375, 0.5, 0.25, 3.0, 2.5, 2.25});
        result.grid.cells = arena.take<GridCell>(6);
        result.grid.rows = 2;
        result.grid.columns = 3;
        result.grid.cell_m = 0.25;
        result.grid.x_m = 0.5;
        result.grid.y_m = -0.375;
        std::fill(result.grid.cells.begin(), result.grid.cells.end(), GridCell{});
        result.grid.at(0, 1) = {
            TerrainClass::kTraversable, 17, 0.0131F, 0.0299F, 0.0312F, 0.0081F, 0.0249F, 0.5F};
        result.grid.at(1, 0) = {TerrainClass::kObstacle, 300,  0.75F, 40.0F, GridCell::kNotMeasured,
                                GridCell::kNotMeasured,  9.0F, 0.0F};
        result.grid.at(1, 2).kind = TerrainClass::kDrop;
        result.grid.at(1, 2).elevation_m = -0.3126F;
        result.grid.at(1, 2).index = 0.0F;
        result.times_ns = {1'000'000, 2'000'000, 3'000'000, 4'000'000, 5'000'000, 0, 0};
    }
};

}  // namespace groundline::publish::test
