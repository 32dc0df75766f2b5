// What the validity tests and the sub-pixel fit say about scenes whose answer is known.
#include <gtest/gtest.h>

#include <cstdlib>
#include <vector>

#include "stereo/median.hpp"
#include "stereo/speckle.hpp"
#include "stereo/subpixel.hpp"
#include "unit/stereo_test_tools.hpp"

namespace groundline::stereo {
namespace {

using test::OwnedLuma;
using test::OwnedPair;

MatcherConfig checked(int disparities) {
    MatcherConfig config = paper();
    config.disparities = disparities;
    return config;
}

TEST(StereoChecks, SubpixelIsTheEquiangularFitRounded) {
    for (int centre = 0; centre <= 40; ++centre)
        for (int lower = 0; lower <= 120; ++lower)
            for (int upper = 0; upper <= 120; ++upper) {
                const int offset = equiangular_q4(lower, centre, upper);
                ASSERT_EQ(equiangular_q4(upper, centre, lower), -offset) << "not symmetric";
                if (lower < centre || upper < centre || (lower == centre && upper == centre)) {
                    ASSERT_EQ(offset, 0);
                    continue;
                }
                const double exact = 16.0 * (lower - upper) / (2.0 * (std::max(lower, upper) - centre));
                ASSERT_LE(std::abs(offset - exact), 0.5);
                ASSERT_LE(std::abs(offset), 8);
            }
    EXPECT_EQ(equiangular_q4(1, 0, 16), -8 * 15 / 16 - 1);  // -7.5 rounds away from zero
}

// A slanted surface seen by both views: disparity 10 + x / 40 by linear interpolation of the right view.
TEST(StereoChecks, SubpixelFollowsASlant) {
    const OwnedLuma texture = test::textured_image(400, 60, 200);
    OwnedPair pair{OwnedLuma(200, 60), OwnedLuma(200, 60)};
    pair.right.fill([&](int x, int y) { return (texture.at(x + 50, y) + texture.at(x + 51, y)) / 2; });
    pair.left.fill([&](int x, int y) {
        const int position_q6 = 64 * x - (640 + 64 * x / 40);  // in right view pixels, 1/64
        const int whole = (position_q6 + 64 * 50) / 64;
        const int part = (position_q6 + 64 * 50) % 64;
        const auto smooth = [&](int u) { return texture.at(u, y) + texture.at(u + 1, y); };
        return ((64 - part) * smooth(whole) + part * smooth(whole + 1)) / 128;
    });
    const OwnedResult result = match_fast(checked(32), pair.left.view(), pair.right.view());
    double error_sum = 0.0;
    double whole_sum = 0.0;
    int answered = 0;
    for (int y = 10; y < 50; ++y)
        for (int x = 50; x < 190; ++x) {
            if (result.reason(x, y) != Invalid::kNone) continue;
            const double truth = 10.0 + x / 40.0;
            const double found = result.map.disparity_q4.at(x, y) / 16.0;
            error_sum += std::abs(found - truth);
            whole_sum += std::abs(static_cast<int>(truth + 0.5) - truth);
            ++answered;
        }
    EXPECT_GT(answered, 40 * 140 * 9 / 10);
    EXPECT_LT(error_sum, 0.5 * whole_sum);  // at least twice as good as the best whole pixel
}

TEST(StereoChecks, FlatPatchIsTextureAndBrightPatchSaturation) {
    OwnedPair pair = test::shifted_pair(200, 100, 201, 8);
    for (OwnedLuma* view : {&pair.left, &pair.right})
        view->fill([&](int x, int y) {
            if (y >= 60 && x >= 60 && x < 100) return 90;
            if (y >= 60 && x >= 120 && x < 160) return 255;
            return static_cast<int>(view->at(x, y));
        });
    const OwnedResult result = match_fast(checked(32), pair.left.view(), pair.right.view());
    for (int y = 66; y < 100; ++y) {
        for (int x = 66; x < 94; ++x)
            ASSERT_EQ(result.reason(x, y), Invalid::kTexture) << x << ", " << y;
        for (int x = 126; x < 154; ++x)
            ASSERT_EQ(result.reason(x, y), Invalid::kSaturation) << x << ", " << y;
    }
    for (int y = 10; y < 50; ++y)
        for (int x = 45; x < 190; ++x)
            ASSERT_EQ(result.reason(x, y), Invalid::kNone) << x << ", " << y;
}

// Saturation is judged on the view as given: without its local mean, white is grey.
TEST(StereoChecks, SaturationIsSeenThroughTheLocalMean) {
    OwnedPair pair = test::shifted_pair(160, 80, 212, 8);
    for (OwnedLuma* view : {&pair.left, &pair.right})
        view->fill([&](int x, int y) {
            return x >= 80 && x < 120 && (x + y) % 3 != 0 ? 255 : static_cast<int>(view->at(x, y));
        });
    MatcherConfig config = checked(32);
    config.normalise_local_mean = true;
    const OwnedResult result = match_fast(config, pair.left.view(), pair.right.view());
    for (int y = 0; y < 80; ++y)
        for (int x = 86; x < 114; ++x)
            ASSERT_EQ(result.reason(x, y), Invalid::kSaturation) << x << ", " << y;
}

TEST(StereoChecks, BestAtTheLastDisparityIsNearerThanTheRange) {
    for (const int disparity : {14, 15}) {
        const OwnedPair pair = test::shifted_pair(120, 60, 202, disparity);
        const OwnedResult result = match_fast(checked(16), pair.left.view(), pair.right.view());
        for (int y = 8; y < 52; ++y)
            for (int x = 40; x < 110; ++x)
                ASSERT_EQ(result.reason(x, y), disparity == 15 ? Invalid::kRangeEdge : Invalid::kNone);
    }
}

TEST(StereoChecks, WhatTheRightViewDoesNotShowIsBorder) {
    const OwnedPair pair = test::shifted_pair(120, 60, 203, 20);
    const OwnedResult result = match_fast(checked(32), pair.left.view(), pair.right.view());
    // Left of x = 20 the match lies outside the right view: nothing there may be an answer.
    for (int y = 0; y < 60; ++y)
        for (int x = 0; x < 15; ++x)
            ASSERT_NE(result.reason(x, y), Invalid::kNone) << x << ", " << y;
    for (int y = 0; y < 60; ++y)
        ASSERT_EQ(result.reason(0, y), Invalid::kBorder);
}

TEST(StereoChecks, RepeatedTextureIsNotUnique) {
    const OwnedLuma texture = test::textured_image(10, 60, 204);
    OwnedLuma view(160, 60);
    view.fill([&](int x, int y) { return texture.at(x % 10, y); });  // period 10: d, d + 10, d + 20 alike
    const OwnedResult result = match_fast(checked(32), view.view(), view.view());
    for (int y = 0; y < 60; ++y)
        for (int x = 45; x < 150; ++x)
            ASSERT_EQ(result.reason(x, y), Invalid::kUniqueness);
}

TEST(StereoChecks, UnrelatedViewsAreHardlyEverAnswered) {
    const OwnedLuma left = test::textured_image(300, 150, 205);
    const OwnedLuma right = test::textured_image(300, 150, 206);
    const OwnedResult result = match_fast(checked(64), left.view(), right.view());
    EXPECT_LE(count_reason(result, Invalid::kNone), 300 * 150 / 100);
}

// A near square in front of a far wall hides a strip of the wall, left of it, from the right camera.
TEST(StereoChecks, LeftRightCheckFindsTheHiddenStrip) {
    const OwnedLuma far_texture = test::textured_image(260, 90, 207);
    const OwnedLuma near_texture = test::textured_image(260, 90, 208);
    OwnedPair pair{OwnedLuma(200, 90), OwnedLuma(200, 90)};
    const auto square = [](int x, int y) { return x >= 90 && x < 140 && y >= 20 && y < 70; };
    pair.left.fill([&](int x, int y) { return square(x, y) ? near_texture.at(x, y) : far_texture.at(x, y); });
    pair.right.fill([&](int x, int y) {
        return square(x + 24, y) ? near_texture.at(x + 24, y) : far_texture.at(x + 4, y);
    });
    MatcherConfig config = checked(32);
    config.limits = {true, 100, 0, 100, -1, 0, 1, 0};  // nothing but left-right
    const OwnedResult result = match_fast(config, pair.left.view(), pair.right.view());
    config.limits.left_right_px = -1;
    const OwnedResult without = match_fast(config, pair.left.view(), pair.right.view());
    int found = 0;
    int all = 0;
    for (int y = 28; y < 62; ++y)
        for (int x = 70 + 5; x < 90 - 5; ++x, ++all) {  // hidden: x - 4 in 66 .. 115 of the right view
            found += result.reason(x, y) == Invalid::kLeftRight ? 1 : 0;
            ASSERT_NE(without.reason(x, y), Invalid::kLeftRight);
        }
    EXPECT_GE(10 * found, 9 * all);
    for (int y = 28; y < 62; ++y)
        for (int x = 100; x < 130; ++x)
            ASSERT_EQ(result.reason(x, y), Invalid::kNone) << x << ", " << y;
}

// Patches by flood fill.
void remove_speckles_plainly(const DisparityMap& map, int smallest) {
    const int width = map.width();
    const int height = map.height();
    std::vector<bool> seen(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), false);
    for (int start = 0; start < width * height; ++start) {
        if (seen[static_cast<std::size_t>(start)] ||
            map.invalid.at(start % width, start / width) != Invalid::kNone)
            continue;
        std::vector<int> patch{start};
        seen[static_cast<std::size_t>(start)] = true;
        for (std::size_t i = 0; i < patch.size(); ++i) {
            const int x = patch[i] % width;
            const int y = patch[i] / width;
            for (const auto& [dx, dy] :
                 {std::pair{1, 0}, std::pair{-1, 0}, std::pair{0, 1}, std::pair{0, -1}}) {
                const int u = x + dx;
                const int v = y + dy;
                if (u < 0 || v < 0 || u >= width || v >= height) continue;
                const int next = v * width + u;
                if (seen[static_cast<std::size_t>(next)] || map.invalid.at(u, v) != Invalid::kNone) continue;
                if (std::abs(map.disparity_q4.at(u, v) - map.disparity_q4.at(x, y)) > kDisparityOne) continue;
                seen[static_cast<std::size_t>(next)] = true;
                patch.push_back(next);
            }
        }
        if (static_cast<int>(patch.size()) >= smallest) continue;
        for (const int pixel : patch) {
            map.invalid.at(pixel % width, pixel / width) = Invalid::kSpeckle;
            map.disparity_q4.at(pixel % width, pixel / width) = 0;
        }
    }
}

TEST(StereoChecks, SpecklesAreTheSmallPatchesOfAFloodFill) {
    for (const std::uint32_t seed : {1U, 2U, 3U, 4U})
        for (const int levels : {2, 3, 6, 40}) {
            const test::OwnedLuma blank = test::noise_image(73, 51, 1);
            OwnedResult fast(73, 51);
            OwnedResult plain(73, 51);
            std::mt19937 random(seed);
            for (int y = 0; y < 51; ++y)
                for (int x = 0; x < 73; ++x) {
                    const bool valid = random() % 5 != 0;
                    const auto disparity = static_cast<std::int16_t>(
                        valid ? 8 * static_cast<int>(random() % static_cast<std::uint32_t>(levels)) : 0);
                    for (OwnedResult* result : {&fast, &plain}) {
                        result->map.invalid.at(x, y) = valid ? Invalid::kNone : Invalid::kCost;
                        result->map.disparity_q4.at(x, y) = disparity;
                    }
                }
            Arena arena;
            SpeckleScratch scratch(73, arena);
            remove_speckles(fast.map, blank.view(), blank.view(), {9, 0}, scratch);
            remove_speckles_plainly(plain.map, 9);
            ASSERT_EQ(differing_pixels(fast, plain), 0) << "seed " << seed << " levels " << levels;
        }
}

// Textured ground under a sky that holds nothing but each camera's own noise.
TEST(StereoChecks, NoiseInThePlainSkyIsNoAnswer) {
    constexpr int kWidth = 320;
    constexpr int kHeight = 120;
    constexpr int kHorizon = 70;
    const test::OwnedLuma texture = test::textured_image(kWidth + 8, kHeight, 3);
    const test::OwnedLuma noise[2] = {test::noise_image(kWidth, kHeight, 4, 193, 207),
                                      test::noise_image(kWidth, kHeight, 5, 193, 207)};
    test::OwnedLuma left(kWidth, kHeight);
    test::OwnedLuma right(kWidth, kHeight);
    left.fill([&](int x, int y) { return y < kHorizon ? noise[0].at(x, y) : texture.at(x, y); });
    right.fill([&](int x, int y) { return y < kHorizon ? noise[1].at(x, y) : texture.at(x + 8, y); });
    for (const MatcherKind kind : {MatcherKind::kCensus, MatcherKind::kCensusPyramid}) {
        MatcherConfig config;
        config.kind = kind;
        config.disparities = 64;
        const auto answers = [&](int first, int last) {
            const OwnedResult result = match_fast(config, left.view(), right.view());
            int count = 0;
            for (int y = first; y < last; ++y)
                for (int x = 64; x < kWidth; ++x)
                    count += result.reason(x, y) == Invalid::kNone ? 1 : 0;
            return count;
        };
        EXPECT_EQ(answers(0, kHorizon - 8), 0);
        EXPECT_GT(answers(kHorizon + 8, kHeight), (kHeight - kHorizon - 8) * (kWidth - 64) * 9 / 10);
        config.limits.alike_percent = 0;
        EXPECT_GT(answers(0, kHorizon - 8), 1000);
    }
}

// Sorting all valid neighbours, from a copy of the map.
TEST(StereoChecks, TheMedianIsOfTheValidNeighboursAsTheyCame) {
    for (const std::uint32_t seed : {21U, 22U, 23U}) {
        OwnedResult smoothed(37, 23);
        OwnedResult given(37, 23);
        std::mt19937 random(seed);
        for (int y = 0; y < 23; ++y)
            for (int x = 0; x < 37; ++x)
                for (const bool valid = random() % 3 != 0; OwnedResult * result : {&smoothed, &given}) {
                    result->map.invalid.at(x, y) = valid ? Invalid::kNone : Invalid::kLeftRight;
                    result->map.disparity_q4.at(x, y) = static_cast<std::int16_t>(
                        valid ? static_cast<int>((x * 131U + y * 977U + seed * 53U) % 400U) - 100 : 0);
                }
        std::vector<std::int16_t> scratch(2 * 37, 77);
        median_3x3(smoothed.map, scratch);
        for (int y = 0; y < 23; ++y)
            for (int x = 0; x < 37; ++x) {
                ASSERT_EQ(smoothed.reason(x, y), given.reason(x, y));
                if (given.reason(x, y) != Invalid::kNone) {
                    ASSERT_EQ(smoothed.map.disparity_q4.at(x, y), 0);
                    continue;
                }
                std::vector<int> valid;
                for (int v = std::max(y - 1, 0); v <= std::min(y + 1, 22); ++v)
                    for (int u = std::max(x - 1, 0); u <= std::min(x + 1, 36); ++u)
                        if (given.reason(u, v) == Invalid::kNone)
                            valid.push_back(given.map.disparity_q4.at(u, v));
                std::sort(valid.begin(), valid.end());
                ASSERT_EQ(smoothed.map.disparity_q4.at(x, y), valid[(valid.size() - 1) / 2]) << x << "," << y;
            }
    }
}

TEST(StereoChecks, EveryLimitCanBeSwitchedOff) {
    const auto left = test::noise_image(150, 60, 209, 0, 255);
    const auto right = test::noise_image(150, 60, 210, 0, 255);
    MatcherConfig config = checked(32);
    config.limits = {false, 100, 0, 100, -1, 0, -1, 0, false};
    const OwnedResult result = match_fast(config, left.view(), right.view());
    EXPECT_EQ(count_reason(result, Invalid::kNone) + count_reason(result, Invalid::kBorder) +
                  count_reason(result, Invalid::kRangeEdge),
              150 * 60);
}

TEST(StereoChecks, InvalidPixelsHaveDisparityZero) {
    const OwnedPair pair = stepped_pair(130, 77, 211);
    const OwnedResult result = match_fast(checked(64), pair.left.view(), pair.right.view());
    int invalid = 0;
    for (int y = 0; y < 77; ++y)
        for (int x = 0; x < 130; ++x) {
            if (result.reason(x, y) == Invalid::kNone) continue;
            ++invalid;
            ASSERT_EQ(result.map.disparity_q4.at(x, y), 0);
        }
    EXPECT_GT(invalid, 0);
}

}  // namespace
}  // namespace groundline::stereo
