#include "terrain/v_disparity.hpp"

#include <gtest/gtest.h>

#include "unit/terrain_scene.hpp"

namespace groundline::terrain {
namespace {

using test::Dice;

struct Fixture {
    Arena arena;
    DisparityMap map;
    VDisparity v_disparity;
    Serial serial;
    Fixture(int width, int height, int min_disparity, int disparities)
        : map(DisparityMap::make(arena, width, height)),
          v_disparity(make_v_disparity(arena, height, min_disparity, disparities)) {}
    int at(int bin, int row) const { return v_disparity.histogram.at(bin, row); }
};

TEST(VDisparity, SplatsThirtyTwoUnitsBetweenTheTwoNearestBins) {
    Fixture f(8, 4, 0, 16);
    for (int v = 0; v < 4; ++v)
        for (int u = 0; u < 8; ++u)
            f.map.invalid.at(u, v) = Invalid::kTexture;
    f.map.invalid.at(2, 1) = Invalid::kNone;
    f.map.disparity_q4.at(2, 1) = 5 * 16 + 7;  // bin 21 holds 84..88: 84 + 3
    f.map.invalid.at(4, 2) = Invalid::kNone;   // disparity 0 is a value like any other
    build_v_disparity(f.map, f.v_disparity, f.serial);
    EXPECT_EQ(f.at(21, 1), 8);
    EXPECT_EQ(f.at(22, 1), 24);
    EXPECT_EQ(f.at(0, 2), 32);
    int total = 0;
    for (int v = 0; v < 4; ++v)
        for (int k = 0; k < f.v_disparity.histogram.width; ++k)
            total += f.at(k, v);
    EXPECT_EQ(total, 64);
}

TEST(VDisparity, EveryRowHoldsItsValidPixelsInRange) {
    constexpr int kMin = 8;
    constexpr int kCount = 24;
    Fixture f(61, 37, kMin, kCount);
    Dice dice(5);
    std::vector<int> expected(37, 0);
    for (int v = 0; v < 37; ++v)
        for (int u = 0; u < 61; ++u) {
            const int d_q4 = static_cast<int>(dice.bits() % (40 * 16));
            const bool valid = dice.bits() % 4 != 0;
            f.map.disparity_q4.at(u, v) = static_cast<std::int16_t>(d_q4);
            f.map.invalid.at(u, v) = valid ? Invalid::kNone : Invalid::kLeftRight;
            const bool inside = d_q4 >= kMin * 16 && d_q4 <= (kMin + kCount) * 16;
            expected[static_cast<std::size_t>(v)] += valid && inside && u % 2 == 0 ? 32 : 0;
        }
    // What an earlier frame left must go.
    fill_pixels(f.v_disparity.histogram, 77);
    build_v_disparity(f.map, f.v_disparity, f.serial);
    for (int v = 0; v < 37; ++v) {
        int total = 0;
        double moment = 0.0;
        double truth = 0.0;
        for (int k = 0; k < f.v_disparity.histogram.width; ++k) {
            total += f.at(k, v);
            moment += f.at(k, v) / 16.0 * (kMin + 0.25 * k);
        }
        for (int u = 0; u < 61; u += 2) {
            const int d_q4 = f.map.disparity_q4.at(u, v);
            if (f.map.invalid.at(u, v) == Invalid::kNone && d_q4 >= kMin * 16 && d_q4 <= (kMin + kCount) * 16)
                truth += 2.0 * d_q4 / 16.0;
        }
        EXPECT_EQ(total, expected[static_cast<std::size_t>(v)]);
        // A bilinear splat keeps the mean: the sum of disparities is exact.
        EXPECT_EQ(moment, truth);
    }
}

TEST(VDisparity, SaturatesInsteadOfWrapping) {
    Fixture f(5000, 1, 0, 16);
    for (int u = 0; u < 5000; ++u)
        f.map.disparity_q4.at(u, 0) = 3 * 16;
    build_v_disparity(f.map, f.v_disparity, f.serial);
    EXPECT_EQ(f.at(12, 0), 65535);
    EXPECT_EQ(f.at(13, 0), 0);
}

TEST(VDisparity, IsTheSameForAnyNumberOfLanes) {
    Fixture f(200, 90, 0, 64);
    Dice dice(9);
    for (int v = 0; v < 90; ++v)
        for (int u = 0; u < 200; ++u)
            f.map.disparity_q4.at(u, v) = static_cast<std::int16_t>(dice.bits() % 1024);
    build_v_disparity(f.map, f.v_disparity, f.serial);
    for (const int lanes : {2, 3}) {
        VDisparity other = make_v_disparity(f.arena, 90, 0, 64);
        test::Threads threads(lanes);
        build_v_disparity(f.map, other, threads);
        EXPECT_TRUE(test::same_pixels<std::uint16_t>(f.v_disparity.histogram, other.histogram));
    }
}

}  // namespace
}  // namespace groundline::terrain
