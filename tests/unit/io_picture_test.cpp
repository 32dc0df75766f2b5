#include "io/picture.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "io_result_fixture.hpp"

namespace groundline::io {
namespace {

using testing::HandMade;
using testing::kHeight;
using testing::kWidth;

Colour pixel(const Image8& image, int x, int y) {
    const std::size_t at = 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                                static_cast<std::size_t>(x));
    return {image.bytes[at], image.bytes[at + 1], image.bytes[at + 2]};
}

Colour over(int own, const Colour& tint) {
    Colour mixed{};
    for (std::size_t c = 0; c < 3; ++c)
        mixed[c] = static_cast<std::uint8_t>((own * (256 - kTintShare) + tint[c] * kTintShare) / 256);
    return mixed;
}

constexpr Colour kGrey = {100, 100, 100};

TEST(Picture, RangeColoursGoFromBlueOverGreenToRed) {
    EXPECT_EQ(range_colour(0.0, 32.0), (Colour{255, 0, 0}));
    EXPECT_EQ(range_colour(8.0, 32.0), (Colour{0, 255, 0}));  // the square root of a quarter is the middle
    EXPECT_EQ(range_colour(32.0, 32.0), (Colour{0, 0, 255}));
    EXPECT_EQ(range_colour(99.0, 32.0), (Colour{0, 0, 255}));
    EXPECT_EQ(range_colour(-1.0, 32.0), (Colour{255, 0, 0}));
    const Colour yellow = range_colour(18.0, 32.0);
    EXPECT_EQ(yellow, (Colour{0, 255, 255}));
    const Colour cyan = range_colour(2.0, 32.0);
    EXPECT_EQ(cyan, (Colour{255, 255, 0}));
}

TEST(Picture, OverlayTintsObstaclesByDisparityAndDropsViolet) {
    HandMade made;
    made.set_pixel(150, 90, TerrainClass::kObstacle, 8.0);
    made.set_pixel(151, 90, TerrainClass::kObstacle, 32.0);
    made.set_pixel(152, 90, TerrainClass::kDrop, 3.0);
    made.set_pixel(153, 90, TerrainClass::kUnknown, 3.0);
    // A hole in an obstacle takes the hue of the pixel on its left.
    made.set_pixel(160, 90, TerrainClass::kObstacle, 32.0);
    made.set_pixel(161, 90, TerrainClass::kObstacle, 0.0);
    made.set_invalid(161, 90, Invalid::kTexture);
    Image8 overlay;
    paint_overlay(made.result, overlay);
    ASSERT_EQ(overlay.width, kWidth);
    ASSERT_EQ(overlay.height, kHeight);
    ASSERT_EQ(overlay.channels, 3);
    EXPECT_EQ(pixel(overlay, 150, 90), over(100, {0, 255, 0}));
    EXPECT_EQ(pixel(overlay, 151, 90), over(100, {0, 0, 255}));
    EXPECT_EQ(pixel(overlay, 152, 90), over(100, kDropColour));
    EXPECT_EQ(pixel(overlay, 161, 90), over(100, {0, 0, 255}));
    EXPECT_EQ(pixel(overlay, 149, 90), kGrey) << "what may be driven on stays as it is";
    const int dimmed = 100 * kUnknownLight / 256;
    EXPECT_EQ(pixel(overlay, 153, 90)[0], dimmed) << "what is unknown must not look like what is free";
}

TEST(Picture, OverlayUsesTheColourImageWhereThereIsOne) {
    HandMade made;
    made.result.left_bgr = made.arena.bgr_image(kWidth, kHeight);
    std::uint8_t* at = made.result.left_bgr.row(100) + 3 * 180;
    at[0] = 1, at[1] = 2, at[2] = 3;
    Image8 overlay;
    paint_overlay(made.result, overlay);
    EXPECT_EQ(pixel(overlay, 180, 100), (Colour{1, 2, 3}));
}

TEST(Picture, HueIsOfTrueDisparityWithoutTheOffset) {
    HandMade made;
    made.result.rig.cx_right_px = made.result.rig.cx_px + 16.0;  // offset -16, search 0..32: true 16..48
    made.set_pixel(150, 90, TerrainClass::kObstacle, -4.0);      // true 12 of 48, a quarter
    Image8 overlay;
    paint_overlay(made.result, overlay);
    EXPECT_EQ(pixel(overlay, 150, 90), over(100, {0, 255, 0}));
}

// Rows in a column where the horizon's yellow is strongest.
int horizon_row(const Image8& overlay, int x) {
    int best = -1, strength = 60;
    for (int y = 0; y < overlay.height; ++y) {
        const Colour colour = pixel(overlay, x, y);
        if (colour[2] - colour[0] > strength) strength = colour[2] - colour[0], best = y;
    }
    return best;
}

TEST(Picture, HorizonIsDrawnWithItsRoll) {
    HandMade made;
    made.set_ground(2.0, 5.0, 0.5);
    Image8 overlay;
    paint_overlay(made.result, overlay);
    for (const int x : {10, 99, 190}) {
        // Rays (u - cx, v - cy, f) along the ground: n . ray = 0 with n of the pose, turned by the roll.
        const RectifiedRig& rig = made.result.rig;
        const double pitch = det::radians(2.0), roll = det::radians(5.0);
        const double row = rig.cy_px - (std::sin(roll) * std::cos(pitch) * (x - rig.cx_px) +
                                        std::sin(pitch) * rig.focal_px) /
                                           (std::cos(roll) * std::cos(pitch));
        EXPECT_NEAR(horizon_row(overlay, x), row, 1.0) << x;
    }
    EXPECT_GT(std::abs(horizon_row(overlay, 10) - horizon_row(overlay, 190)), 12);
    made.result.ground.found = false;
    paint_overlay(made.result, overlay);
    EXPECT_EQ(horizon_row(overlay, 190), -1);
}

TEST(Picture, AHorizonFarOutsideDoesNoHarm) {
    HandMade made;
    made.result.ground.found = true;
    made.result.ground.plane = {1e-3, 1e-12, 5.0};
    Image8 overlay, v;
    paint_overlay(made.result, overlay);
    paint_v_disparity(made.result, v);
    EXPECT_EQ(horizon_row(overlay, 190), -1);
}

TEST(Picture, TheVerdictIsInTheCorner) {
    HandMade made;
    made.result.verdict = Verdict::kBlind;
    made.result.reasons.add(Reason::kNoGround);
    Image8 blind, trusted;
    paint_overlay(made.result, blind);
    made.result.verdict = Verdict::kTrusted;
    made.result.reasons = {};
    paint_overlay(made.result, trusted);
    const auto strongest = [](const Image8& image, std::size_t channel, std::size_t other) {
        int most = 0;
        for (int y = 0; y < 20; ++y)
            for (int x = 0; x < 100; ++x)
                most = std::max(most, pixel(image, x, y)[channel] - pixel(image, x, y)[other]);
        return most;
    };
    EXPECT_GT(strongest(blind, 2, 1), 80) << "red words";
    EXPECT_LT(strongest(blind, 1, 2), 10);
    EXPECT_GT(strongest(trusted, 1, 2), 80) << "green words";
    EXPECT_EQ(pixel(trusted, kWidth - 1, kHeight - 1), kGrey) << "small: the far corner is untouched";
}

TEST(Picture, EveryReasonAtOnceStillFitsAnyPicture) {
    HandMade made;
    for (int i = 0; i < kReasons; ++i)
        made.result.reasons.add(static_cast<Reason>(i));
    Image8 overlay;
    paint_overlay(made.result, overlay);
    EXPECT_EQ(overlay.bytes.size(), 3U * kWidth * kHeight);
}

TEST(Picture, VDisparityShowsTheGroundLineRedInsideAPinkBand) {
    HandMade made;
    made.set_ground(5.0, 0.0, 0.5);
    Image8 v;
    paint_v_disparity(made.result, v);
    ASSERT_EQ(v.width, 128) << "quarter bins: no wider than the left image";
    ASSERT_EQ(v.height, kHeight);
    const int row = 100;
    const double ground_px = made.result.ground.plane.at(0.5 * (kWidth - 1), row);
    const auto near_column = [&](double disparity_px, const Colour& colour) {
        int least = 1000;
        for (int x = 0; x < v.width; ++x) {
            const Colour found = pixel(v, x, row);
            int away = std::abs(static_cast<int>(std::floor(disparity_px * 4 + 0.5)) - x) > 2 ? 1000 : 0;
            for (std::size_t c = 0; c < 3; ++c)
                away += std::abs(found[c] - colour[c]);
            least = std::min(least, away);
        }
        return least;
    };
    EXPECT_LT(near_column(ground_px, kGroundLineColour), 150);
    // H = h (1 - d_g / d) = +-0.2 at h = 0.5: d = d_g / 0.6 and d_g / 1.4.
    EXPECT_LT(near_column(ground_px / 0.6, kToleranceColour), 250);
    EXPECT_LT(near_column(ground_px / 1.4, kToleranceColour), 250);
    EXPECT_EQ(pixel(v, 5, 20), (Colour{0, 0, 0}));
}

TEST(Picture, VDisparityBandFollowsTheRatioWithoutMetres) {
    HandMade metric, ratio;
    metric.set_ground(5.0, 0.0, 0.5);
    ratio.set_ground(5.0, 0.0, 0.5);
    ratio.result.ground.metric = false;
    ratio.result.tolerance_m = 0.0;
    ratio.result.tolerance_ratio = 0.4;  // 0.2 m of 0.5 m
    Image8 a, b;
    paint_v_disparity(metric.result, a);
    paint_v_disparity(ratio.result, b);
    EXPECT_EQ(a.bytes, b.bytes);
    ratio.result.tolerance_ratio = 0.1;
    paint_v_disparity(ratio.result, b);
    EXPECT_NE(a.bytes, b.bytes);
}

TEST(Picture, VDisparityBrightnessGrowsWithTheCountAndWideHistogramsAreMerged) {
    HandMade made;
    for (int y = 0; y < kHeight; ++y)
        made.result.v_disparity.histogram.at(40, y) = static_cast<std::uint16_t>(16 * y);
    Image8 v;
    paint_v_disparity(made.result, v);
    EXPECT_EQ(pixel(v, 40, 0), (Colour{0, 0, 0}));
    for (int y = 1; y < kHeight; ++y)
        EXPECT_GE(pixel(v, 40, y)[0], pixel(v, 40, y - 1)[0]);
    EXPECT_EQ(pixel(v, 40, kHeight - 1)[0], 255);
    // A whole-pixel disparity fills its pixel, from half a pixel before it.
    for (const int x : {39, 41, 42})
        EXPECT_EQ(pixel(v, x, 60), pixel(v, 40, 60));
    for (const int x : {38, 43})
        EXPECT_EQ(pixel(v, x, 60), (Colour{0, 0, 0}));
    EXPECT_EQ(pixel(v, 50, 60), (Colour{0, 0, 0}));

    made.result.v_disparity.histogram = made.arena.image<std::uint16_t>(64 * 4, kHeight);
    made.result.v_disparity.histogram.at(43, 60) = 16 * 100;
    paint_v_disparity(made.result, v);
    ASSERT_EQ(v.width, 64);
    EXPECT_EQ(pixel(v, 10, 60)[0], 255);
    EXPECT_EQ(pixel(v, 11, 60)[0], 0);
}

}  // namespace
}  // namespace groundline::io
