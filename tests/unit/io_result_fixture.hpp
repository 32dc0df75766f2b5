// A small hand-made result: known classes and disparities at known pixels.
#pragma once

#include "core/arena.hpp"
#include "core/deterministic_math.hpp"
#include "core/result.hpp"

namespace groundline::io::testing {

inline constexpr int kWidth = 200;
inline constexpr int kHeight = 120;
inline constexpr int kDisparities = 32;

// Grey 100 everywhere, all traversable with disparity 8, no ground yet.
struct HandMade {
    HandMade() {
        result.left = arena.image<std::uint8_t>(kWidth, kHeight);
        result.disparity = DisparityMap::make(arena, kWidth, kHeight);
        result.mask = arena.image<TerrainClass>(kWidth, kHeight);
        result.v_disparity.histogram = arena.image<std::uint16_t>(kDisparities * 4, kHeight);
        result.rig = {kWidth, kHeight, true, 150.0, 99.5, 59.5, 99.5, 0.1};
        result.tolerance_m = 0.2;
        fill_pixels(result.left, 100);
        fill_pixels(result.mask, TerrainClass::kTraversable);
        fill_pixels(result.disparity.disparity_q4, 8 * kDisparityOne);
        result.stamp.set_name("000007.png");
        result.stamp.position = 7;
        result.stamp.utime_us = 700'000;
    }

    void set_ground(double pitch_deg, double roll_deg, double height_m) {
        Ground& ground = result.ground;
        ground.found = ground.metric = true;
        ground.pose = {det::radians(pitch_deg), det::radians(roll_deg), height_m};
        ground.plane = plane_of(ground.pose, result.rig);
        ground.sigma = {det::radians(0.125), det::radians(0.25), 0.015625};
    }
    void set_pixel(int x, int y, TerrainClass kind, double disparity_px) {
        result.mask.at(x, y) = kind;
        result.disparity.disparity_q4.at(x, y) = static_cast<std::int16_t>(disparity_px * kDisparityOne);
    }
    void set_invalid(int x, int y, Invalid why) {
        result.disparity.disparity_q4.at(x, y) = 0;
        result.disparity.invalid.at(x, y) = why;
    }

    Arena arena;
    FrameResult result;
};

}  // namespace groundline::io::testing
