#include "terrain/components.hpp"

#include <gtest/gtest.h>

#include <tuple>

#include "unit/terrain_scene.hpp"

namespace groundline::terrain {
namespace {

using test::Dice;

constexpr int kWidth = 97;
constexpr int kHeight = 61;
constexpr int kDisparities = 64;

struct Bench {
    Arena arena;
    Components components;
    DisparityMap map = DisparityMap::make(arena, kWidth, kHeight);
    ImageView<TerrainClass> mask = arena.image<TerrainClass>(kWidth, kHeight);
    ThingRules rules;
    FixedVector<Thing, kMaxObstacles> things;

    Bench() {
        components.take(arena, kWidth, kHeight, 0, kDisparities, 1);
        rules.min_pixels = 1;
        rules.min_area = 0.0;
        rules.range_edge_q4 = (kDisparities - 1) * 16;
    }
    void find() { components.find(map, rules, mask, things); }
};

// What the rules say, by flooding from pixel to pixel.
struct Flooded {
    TerrainClass kind;
    int left, top, right, bottom, pixels;
    auto key() const { return std::tuple(static_cast<int>(kind), left, top, right, bottom, pixels); }
    bool operator<(const Flooded& other) const { return key() < other.key(); }
    bool operator==(const Flooded& other) const { return key() == other.key(); }
};

int disparity_of(const Bench& bench, int u, int v) {
    return bench.map.invalid.at(u, v) == Invalid::kRangeEdge ? bench.rules.range_edge_q4
                                                             : bench.map.disparity_q4.at(u, v);
}

std::vector<Flooded> flood(const Bench& bench, const std::vector<TerrainClass>& mask) {
    std::vector<Flooded> found;
    std::vector<bool> seen(mask.size(), false);
    const auto at = [](int u, int v) { return static_cast<std::size_t>(v * kWidth + u); };
    for (int v = 0; v < kHeight; ++v)
        for (int u = 0; u < kWidth; ++u) {
            const TerrainClass kind = mask[at(u, v)];
            if (seen[at(u, v)] || (kind != TerrainClass::kObstacle && kind != TerrainClass::kDrop)) continue;
            Flooded thing{kind, u, v, u, v, 0};
            std::vector<std::pair<int, int>> open = {{u, v}};
            seen[at(u, v)] = true;
            while (!open.empty()) {
                const auto [x, y] = open.back();
                open.pop_back();
                ++thing.pixels;
                thing.left = std::min(thing.left, x);
                thing.right = std::max(thing.right, x);
                thing.bottom = std::max(thing.bottom, y);
                for (int dy = -1; dy <= 1; ++dy)
                    for (int dx = -1; dx <= 1; ++dx) {
                        const int a = x + dx;
                        const int b = y + dy;
                        if (a < 0 || b < 0 || a >= kWidth || b >= kHeight || seen[at(a, b)]) continue;
                        if (mask[at(a, b)] != kind) continue;
                        const double one = disparity_of(bench, x, y) / 16.0;
                        const double other = disparity_of(bench, a, b) / 16.0;
                        if (std::fabs(one - other) > 1.0 + 0.02 * std::max(one, other) + 1e-12) continue;
                        seen[at(a, b)] = true;
                        open.push_back({a, b});
                    }
            }
            found.push_back(thing);
        }
    std::sort(found.begin(), found.end());
    return found;
}

std::vector<TerrainClass> copy(const Bench& bench) {
    std::vector<TerrainClass> pixels;
    for (int v = 0; v < kHeight; ++v)
        for (int u = 0; u < kWidth; ++u)
            pixels.push_back(bench.mask.at(u, v));
    return pixels;
}

// A random mask of blobs and noise; `share` of 256 pixels are things.
void scatter(Bench& bench, std::uint32_t seed, std::uint32_t share, bool smooth) {
    Dice dice(seed);
    for (int v = 0; v < kHeight; ++v)
        for (int u = 0; u < kWidth; ++u) {
            const bool thing = dice.bits() % 256 < share;
            const bool drop = (u / 20 + v / 15) % 3 == 0;
            bench.mask.at(u, v) = !thing ? TerrainClass::kTraversable
                                  : drop ? TerrainClass::kDrop
                                         : TerrainClass::kObstacle;
            const std::uint32_t base = smooth ? static_cast<std::uint32_t>(300 + 2 * u + 5 * v) : 200U;
            bench.map.disparity_q4.at(u, v) =
                static_cast<std::int16_t>(base + dice.bits() % (smooth ? 24U : 700U));
            bench.map.invalid.at(u, v) = dice.bits() % 50 == 0 ? Invalid::kRangeEdge : Invalid::kNone;
        }
}

TEST(Components, AreThoseOfAPlainFlood) {
    Bench bench;
    for (std::uint32_t seed = 1; seed <= 30; ++seed)
        for (const std::uint32_t share : {20U, 90U, 140U, 256U})
            for (const bool smooth : {false, true}) {
                scatter(bench, seed, share, smooth);
                const std::vector<Flooded> truth = flood(bench, copy(bench));
                // The list is short: only things of a size that leaves fewer than its room are compared.
                int least = 1;
                const auto count = [&](int pixels) {
                    return std::count_if(truth.begin(), truth.end(),
                                         [&](const Flooded& thing) { return thing.pixels >= pixels; });
                };
                while (count(least) > static_cast<int>(kMaxObstacles))
                    ++least;
                bench.rules.min_pixels = least;
                bench.find();
                std::vector<Flooded> found;
                int kept_pixels = 0;
                for (const Thing& thing : bench.things) {
                    found.push_back(
                        {thing.kind, thing.left, thing.top, thing.right, thing.bottom, thing.pixels});
                    kept_pixels += thing.pixels;
                }
                std::sort(found.begin(), found.end());
                std::vector<Flooded> large;
                for (const Flooded& thing : truth)
                    if (thing.pixels >= least) large.push_back(thing);
                ASSERT_EQ(found.size(), large.size()) << seed << " " << share;
                EXPECT_TRUE(found == large) << seed << " " << share;
                int pixels = 0;
                for (const TerrainClass kind : copy(bench))
                    pixels += kind == TerrainClass::kObstacle || kind == TerrainClass::kDrop ? 1 : 0;
                EXPECT_EQ(pixels, kept_pixels);
            }
}

TEST(Components, TooSmallThingsBecomeUnknown) {
    Bench bench;
    fill_pixels(bench.mask, TerrainClass::kTraversable);
    fill_pixels(bench.map.disparity_q4, std::int16_t{20 * 16});
    for (int u = 10; u < 15; ++u)
        bench.mask.at(u, 10) = TerrainClass::kObstacle;  // 5 pixels
    for (int v = 30; v < 34; ++v)
        for (int u = 30; u < 34; ++u)
            bench.mask.at(u, v) = TerrainClass::kObstacle;  // 16
    bench.rules.min_pixels = 6;
    bench.find();
    ASSERT_EQ(bench.things.size(), 1U);
    EXPECT_EQ(bench.things[0].pixels, 16);
    EXPECT_EQ(bench.mask.at(12, 10), TerrainClass::kUnknown);
    EXPECT_EQ(bench.mask.at(31, 31), TerrainClass::kObstacle);
    EXPECT_EQ(bench.mask.at(50, 50), TerrainClass::kTraversable);
    // The same 16 pixels at 20 px and b = 0.12 m cover 16 (0.12 / 20)^2 = 5.76e-4 m^2.
    bench.rules.unit_px = 0.12;
    bench.rules.min_area = 5.7e-4;
    bench.find();
    EXPECT_EQ(bench.things.size(), 1U);
    bench.rules.min_area = 5.8e-4;
    bench.find();
    EXPECT_TRUE(bench.things.empty());
    EXPECT_EQ(bench.mask.at(31, 31), TerrainClass::kUnknown);
}

TEST(Components, MedianAndNearTenthAreOfThePixels) {
    Bench bench;
    fill_pixels(bench.mask, TerrainClass::kUnknown);
    // A slope of 0.5 px a column over 41 columns: 10 .. 30 px, median 20, nearest tenth from 28 px.
    for (int u = 0; u < 41; ++u)
        for (int v = 20; v < 30; ++v) {
            bench.mask.at(u, v) = TerrainClass::kObstacle;
            bench.map.disparity_q4.at(u, v) = static_cast<std::int16_t>(160 + 8 * u);
        }
    bench.rules.offset_px = 3.0;
    bench.find();
    ASSERT_EQ(bench.things.size(), 1U);
    EXPECT_NEAR(bench.things[0].median_px, 20.0, 0.13);
    EXPECT_NEAR(bench.things[0].near_px, 28.0 - 3.0, 0.13);
}

TEST(Components, WhatHangsWhollyAboveTheClearanceIsListedAndUnknown) {
    Bench bench;
    fill_pixels(bench.mask, TerrainClass::kTraversable);
    fill_pixels(bench.map.disparity_q4, std::int16_t{20 * 16});
    for (int v = 0; v < 10; ++v)
        for (int u = 5; u < 25; ++u) {
            bench.mask.at(u, v) = TerrainClass::kObstacle;           // H/h = 1 - (v - 30)/20 = 2.5 .. 2.05
            bench.mask.at(u + 40, v + 4) = TerrainClass::kObstacle;  // down to 1.85
        }
    bench.rules.ground = {0.0, 1.0, -30.0};
    bench.rules.clearance = 2.0;
    bench.find();
    ASSERT_EQ(bench.things.size(), 2U);
    EXPECT_FALSE(bench.things[0].overhang);
    EXPECT_TRUE(bench.things[1].overhang);
    EXPECT_EQ(bench.things[1].left, 5);
    EXPECT_NEAR(bench.things[1].ratio_high, 2.5, 1e-12);
    EXPECT_NEAR(bench.things[1].ratio_low, 2.05, 1e-12);
    EXPECT_EQ(bench.mask.at(10, 5), TerrainClass::kUnknown);
    // One row below the clearance makes the whole an obstacle.
    EXPECT_EQ(bench.mask.at(50, 4), TerrainClass::kObstacle);
    EXPECT_EQ(bench.mask.at(50, 13), TerrainClass::kObstacle);
}

TEST(Components, MoreThingsThanTheListHoldsStayInTheMask) {
    Bench bench;
    fill_pixels(bench.mask, TerrainClass::kTraversable);
    int number = 0;
    for (int v = 0; v < kHeight; v += 4)
        for (int u = 0; u < kWidth; u += 4, ++number) {
            bench.mask.at(u, v) = TerrainClass::kObstacle;
            bench.map.disparity_q4.at(u, v) = static_cast<std::int16_t>(16 + number);
        }
    ASSERT_GT(number, static_cast<int>(kMaxObstacles));
    bench.find();
    ASSERT_EQ(bench.things.size(), kMaxObstacles);
    int kept = 0;
    for (const TerrainClass kind : copy(bench))
        kept += kind == TerrainClass::kObstacle ? 1 : 0;
    EXPECT_EQ(kept, number);
    // The nearest are listed, nearest first.
    EXPECT_NEAR(bench.things[0].median_px, (16 + number - 1) / 16.0, 0.13);
    for (std::size_t i = 1; i < bench.things.size(); ++i)
        EXPECT_GE(bench.things[i - 1].near_px, bench.things[i].near_px);
}

}  // namespace
}  // namespace groundline::terrain
