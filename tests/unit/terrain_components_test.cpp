#include "terrain/components.hpp"

#include <gtest/gtest.h>

#include <string>
#include <tuple>

#include "unit/terrain_plain_components.hpp"
#include "unit/terrain_scene.hpp"

namespace groundline::terrain {
namespace {

using groundline::test::Dice;

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

// Finds the things twice and compares all of it, bit for bit. Returns how many there were.
std::size_t expect_like_plain(Components& components, const test::PlainSearch& search,
                              const DisparityMap& map, const ThingRules& rules, Mask mask,
                              const std::string& what) {
    Arena arena;
    const Mask plain = arena.image<TerrainClass>(mask.width, mask.height);
    copy_pixels<TerrainClass>(mask, plain);
    const std::vector<Thing> truth = test::plain_things(search, map, rules, plain);
    FixedVector<Thing, kMaxObstacles> found;
    components.find(map, rules, mask, found);
    EXPECT_TRUE(groundline::test::same_pixels<TerrainClass>(plain, mask)) << what;
    EXPECT_EQ(found.size(), truth.size()) << what;
    if (found.size() != truth.size()) return 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
        const auto all_of = [](const Thing& t) {
            return std::tuple(t.kind, t.overhang, t.left, t.top, t.right, t.bottom, t.pixels, t.median_px,
                              t.near_px, t.ratio_high, t.ratio_low);
        };
        EXPECT_TRUE(all_of(found[i]) == all_of(truth[i])) << what << ": thing " << i;
    }
    return truth.size();
}

TEST(Components, AreThoseOfAPlainFlood) {
    for (std::uint32_t seed = 1; seed <= 12; ++seed)
        for (const std::uint32_t share : {20U, 90U, 140U, 256U})
            for (const bool smooth : {false, true})
                for (const bool picky : {false, true}) {
                    Bench bench;
                    scatter(bench, seed, share, smooth);
                    if (picky) {
                        bench.rules.min_pixels = 4;
                        bench.rules.min_pixels_far = 9;
                        bench.rules.far_q4 = 22 * 16;
                        bench.rules.unit_px = 0.12;
                        bench.rules.min_area = 2e-4;
                        bench.rules.ground = {0.01, 0.5, -8.0 + seed % 5};
                        bench.rules.offset_px = 1.5;
                        bench.rules.clearance = 1.2;
                    }
                    expect_like_plain(bench.components, {0, kDisparities}, bench.map, bench.rules, bench.mask,
                                      std::to_string(seed) + " " + std::to_string(share));
                }
}

// Runs that begin, end and go on where blocks of 64 pixels meet, and widths about that.
TEST(Components, AreThoseOfAPlainFloodAtAnyWidth) {
    Dice dice(3);
    for (const int width : {1, 2, 7, 8, 63, 64, 65, 127, 128, 129, 200})
        for (int round = 0; round < 12; ++round) {
            const int height = 1 + static_cast<int>(dice.bits() % 9);
            Arena arena;
            Components components;
            components.take(arena, width, height, -8, 40, 1);
            const DisparityMap map = DisparityMap::make(arena, width, height);
            const Mask mask = arena.image<TerrainClass>(width, height);
            // What lies behind the rows must not matter.
            for (int v = 0; v < height; ++v)
                for (int u = width; u < width + 32; ++u) {
                    mask.row(v)[u] = TerrainClass::kObstacle;
                    map.disparity_q4.row(v)[u] = 300;
                }
            for (int v = 0; v < height; ++v) {
                auto kind = TerrainClass::kTraversable;
                int d = 300;
                for (int u = 0; u < width; ++u) {
                    if (dice.bits() % 24 == 0) kind = static_cast<TerrainClass>(dice.bits() % 4);
                    if (dice.bits() % 24 == 0) d = static_cast<int>(dice.bits() % 640) - 128;
                    mask.at(u, v) = kind;
                    map.disparity_q4.at(u, v) =
                        static_cast<std::int16_t>(d + static_cast<int>(dice.bits() % 20));
                    map.invalid.at(u, v) = dice.bits() % 40 == 0 ? Invalid::kRangeEdge : Invalid::kNone;
                }
            }
            ThingRules rules;
            rules.min_pixels = 1 + round % 3;
            rules.min_area = 0.0;
            rules.range_edge_q4 = 31 * 16;
            rules.offset_px = -9.0;
            expect_like_plain(components, {-8, 40}, map, rules, mask, std::to_string(width));
        }
}

// Two pixels are connected up to exactly |delta d| = 1 + 0.02 d of the nearer one, beside and below each
// other.
TEST(Components, ConnectUpToExactlyTheStep) {
    constexpr int kWide = 2040;
    Arena arena;
    Components components;
    components.take(arena, 2, 2, -50, kWide + 50, 1);
    const DisparityMap map = DisparityMap::make(arena, 2, 2);
    const Mask mask = arena.image<TerrainClass>(2, 2);
    for (int near_q4 = -16; near_q4 < 16 * kWide; near_q4 += near_q4 < 200 ? 1 : 97) {
        int farthest = near_q4;  // by the rule in doubles, away from its limit
        while ((near_q4 - (farthest - 1)) / 16.0 <= 1.0 + 0.02 * near_q4 / 16.0 + 1e-9)
            --farthest;
        for (const bool upright : {false, true})
            for (const int step : {0, 1}) {
                fill_pixels(mask, TerrainClass::kTraversable);
                mask.at(0, 0) = TerrainClass::kObstacle;
                map.disparity_q4.at(0, 0) = static_cast<std::int16_t>(near_q4);
                mask.at(upright ? 0 : 1, upright ? 1 : 0) = TerrainClass::kObstacle;
                map.disparity_q4.at(upright ? 0 : 1, upright ? 1 : 0) =
                    static_cast<std::int16_t>(farthest - step);
                ThingRules rules;
                rules.min_pixels = 1;
                rules.min_area = 0.0;
                FixedVector<Thing, kMaxObstacles> things;
                components.find(map, rules, mask, things);
                ASSERT_EQ(things.size(), step == 0 ? 1U : 2U) << near_q4 << ' ' << upright;
            }
    }
}

// Boxes on the ground with noise, outliers and holes, classified by height alone.
TEST(Components, OfRenderedWorldsAreThoseOfAPlainFlood) {
    const RectifiedRig rig = groundline::test::rig_of(320, 240, 250.0, 0.24);
    std::size_t most = 0;
    for (std::uint32_t seed = 1; seed <= 6; ++seed) {
        Arena arena;
        Components components;
        components.take(arena, rig.width, rig.height, 0, kDisparities, 12);
        groundline::test::World world{rig, groundline::test::pose_deg(10.0, 3.0, 1.0), {}};
        Dice dice(seed);
        for (int i = 0; i < 8; ++i)
            world.boxes.push_back({dice.between(1.2, 9.0), dice.between(-2.0, 2.0), dice.between(0.05, 1.0),
                                   0.4, dice.between(1.0, 2.5), dice.between(0.0, 2.2) - 0.8});
        world.ditch_from_m = 4.0;
        world.ditch_to_m = 5.0;
        world.ditch_depth_m = 1.0;
        DisparityMap map = DisparityMap::make(arena, rig.width, rig.height);
        groundline::test::render(world, 0, kDisparities, {0.25, 0.05, 0.1, seed}, map);
        const Mask mask = arena.image<TerrainClass>(rig.width, rig.height);
        ThingRules rules;
        rules.ground = plane_of(world.pose, rig);
        for (int v = 0; v < rig.height; ++v)
            for (int u = 0; u < rig.width; ++u) {
                const double d = map.disparity_q4.at(u, v) / 16.0;
                const double height = 1.0 - rules.ground.at(u, v) / std::max(d, 0.5);
                mask.at(u, v) = map.invalid.at(u, v) == Invalid::kRangeEdge ? TerrainClass::kObstacle
                                : map.invalid.at(u, v) != Invalid::kNone    ? TerrainClass::kUnknown
                                : height > 0.2                              ? TerrainClass::kObstacle
                                : height < -0.2                             ? TerrainClass::kDrop
                                                                            : TerrainClass::kTraversable;
            }
        rules.unit_px = rig.baseline_m;
        rules.clearance = 2.0;
        rules.range_edge_q4 = (kDisparities - 1) * 16;
        most = std::max(
            most, expect_like_plain(components, {0, kDisparities}, map, rules, mask, std::to_string(seed)));
    }
    EXPECT_GE(most, 8U);
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

TEST(Components, FarThingsNeedMorePixels) {
    Bench bench;
    bench.rules.unit_px = 1.0;
    bench.rules.min_area = 1e-3;  // two pixels at 20 px have it
    bench.rules.min_pixels = 2;
    bench.rules.min_pixels_far = 40;
    const auto things_of = [&](int pixels, int far_q4) {
        fill_pixels(bench.mask, TerrainClass::kTraversable);
        fill_pixels(bench.map.disparity_q4, std::int16_t{20 * 16});
        for (int i = 0; i < pixels; ++i)
            bench.mask.at(10 + i % 10, 10 + i / 10) = TerrainClass::kObstacle;
        bench.rules.far_q4 = far_q4;
        bench.find();
        EXPECT_EQ(bench.mask.at(10, 10),
                  bench.things.empty() ? TerrainClass::kUnknown : TerrainClass::kObstacle);
        return bench.things.size();
    };
    EXPECT_EQ(things_of(2, 20 * 16), 1U);
    EXPECT_EQ(things_of(39, 20 * 16 + 1), 0U);
    EXPECT_EQ(things_of(40, 20 * 16 + 1), 1U);
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

// 120 pixels at 30 px before 2000 at 12 px, joined by a slope.
TEST(Components, ASmallNearPartSetsTheRangeOfALargeThing) {
    Bench bench;
    fill_pixels(bench.mask, TerrainClass::kTraversable);
    for (int v = 0; v < 40; ++v)
        for (int u = 0; u < 86; ++u) {
            const bool near = u >= 74 && v >= 30;
            if (u >= 50 && !near && (v != 35 || u >= 74)) continue;
            bench.mask.at(u, v) = TerrainClass::kObstacle;
            bench.map.disparity_q4.at(u, v) = static_cast<std::int16_t>(near     ? 480
                                                                        : u < 50 ? 192
                                                                                 : 192 + 12 * (u - 50));
        }
    bench.find();
    ASSERT_EQ(bench.things.size(), 1U);
    EXPECT_NEAR(bench.things[0].median_px, 12.0, 0.13);
    EXPECT_NEAR(bench.things[0].near_px, 30.0, 0.13);
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
