#include "terrain/sectors.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "core/error.hpp"
#include "terrain/classifier.hpp"
#include "unit/terrain_scene.hpp"

namespace groundline::terrain {
namespace {

using test::pose_deg;
using test::Rays;
using test::rig_of;
using test::World;

constexpr int kDisparities = 96;

struct Bench {
    RectifiedRig rig;
    Arena arena;
    Classifier classifier;
    SectorFinder finder;
    GroundSurface surface;
    DisparityMap map;
    ImageView<TerrainClass> mask;
    FixedVector<Sector, kMaxSectors> sectors;
    Ground ground;
    double range_limit_m = 0.0;

    explicit Bench(const TerrainConfig& config = {}, const RectifiedRig& r = rig_of())
        : rig(r),
          classifier(config, rig, 0, kDisparities, arena),
          finder(config, rig, 0, kDisparities, arena),
          map(DisparityMap::make(arena, rig.width, rig.height)),
          mask(arena.image<TerrainClass>(rig.width, rig.height)) {
        surface.take(arena, rig.width, rig.height, 0, kDisparities);
        surface.flatten(CellSupport::kSupported);
    }
    void see(const World& world, const test::Noise& noise = {}) {
        test::render(world, 0, kDisparities, noise, map);
        ground = {};
        ground.found = ground.metric = true;
        ground.plane = plane_of(world.pose, rig);
        ground.pose = world.pose;
        FixedVector<Obstacle, kMaxObstacles> obstacles;
        Serial serial;
        classifier.classify(map, ground, GroundUse::kOwn, surface, mask, obstacles, range_limit_m, serial);
        finder.find(map, ground, mask, range_limit_m, sectors);
    }
    const Sector& at(double bearing_rad) const {
        for (const Sector& sector : sectors)
            if (std::fabs(sector.bearing_rad - bearing_rad) <= 0.5 * sector.width_rad + 1e-12) return sector;
        ADD_FAILURE() << "no sector at " << bearing_rad;
        return sectors[0];
    }
};

TEST(Sectors, ShareTheFieldOfViewFromLeftToRight) {
    Bench bench;
    bench.see({bench.rig, pose_deg(12.0, 0.0, 1.2), {}});
    ASSERT_EQ(bench.sectors.size(), 32U);
    const double half = std::atan(319.5 / 500.0);
    EXPECT_NEAR(bench.sectors[0].bearing_rad, half - half / 32.0, 1e-12);
    for (std::size_t i = 0; i < 32; ++i) {
        EXPECT_NEAR(bench.sectors[i].width_rad, 2.0 * half / 32.0, 1e-12);
        EXPECT_NEAR(bench.sectors[i].bearing_rad + bench.sectors[31 - i].bearing_rad, 0.0, 1e-12);
    }
}

TEST(Sectors, FlatGroundIsFreeAsFarAsItIsCertifiedAndNoFarther) {
    Bench bench;
    bench.see({bench.rig, pose_deg(12.0, 3.0, 1.2), {}}, {0.1, 0.02, 0.0, 1});
    for (const Sector& sector : bench.sectors) {
        EXPECT_FALSE(sector.blocked);
        EXPECT_EQ(sector.kind, TerrainClass::kUnknown);
        // The limit is along the optical axis; along the ground it is a little farther, more so aside.
        const double limit = bench.range_limit_m / std::cos(sector.bearing_rad);
        EXPECT_GT(sector.free_range_m, 0.75 * limit) << sector.bearing_rad;
        EXPECT_LT(sector.free_range_m, 1.2 * limit) << sector.bearing_rad;
        EXPECT_GT(sector.coverage, 0.8);
    }
}

TEST(Sectors, NearestThingHasItsRangeAndItsBearing) {
    for (const double roll : {0.0, 6.0}) {
        Bench bench;
        World world{bench.rig, pose_deg(12.0, roll, 1.2), {}};
        world.boxes.push_back({5.0, 1.0, 0.6, 0.5, 0.8});
        world.boxes.push_back({9.0, -2.0, 1.0, 0.5, 1.5});
        bench.see(world, {0.15, 0.02, 0.0, 1});
        int blocked = 0;
        for (const Sector& sector : bench.sectors) {
            if (!sector.blocked) continue;
            ++blocked;
            EXPECT_EQ(sector.kind, TerrainClass::kObstacle);
            EXPECT_LE(sector.free_range_m, sector.nearest_m);
            const bool left = sector.bearing_rad > 0.0;
            const double truth = (left ? 5.0 : 9.0) / std::cos(sector.bearing_rad);
            EXPECT_NEAR(sector.nearest_m, truth, 3.0 * sector.nearest_sigma_m + 0.01 * truth) << roll;
        }
        EXPECT_TRUE(bench.at(std::atan2(1.0, 5.0)).blocked);
        EXPECT_TRUE(bench.at(std::atan2(-2.0, 9.0)).blocked);
        EXPECT_FALSE(bench.at(std::atan2(-1.0, 5.0) - 0.2).blocked);
        EXPECT_GE(blocked, 3);
        EXPECT_LE(blocked, 10);
        const Sector& sector = bench.at(std::atan2(1.0, 5.0));
        EXPECT_GT(sector.free_range_m, 3.5);
    }
}

TEST(Sectors, AreInTheBodyFrame) {
    TerrainConfig config;
    config.mount_x_m = 0.8;
    config.mount_y_m = -0.3;
    config.mount_yaw_deg = 20.0;
    Bench bench(config);
    World world{bench.rig, pose_deg(12.0, 0.0, 1.2), {}};
    world.boxes.push_back({5.0, 0.0, 0.5, 0.4, 0.8});
    bench.see(world);
    // The box's near face, 5 m before the camera, turned by 20 deg and moved to the body's origin.
    const double yaw = det::radians(20.0);
    const double x = 0.8 + 5.0 * std::cos(yaw);
    const double y = -0.3 + 5.0 * std::sin(yaw);
    const Sector& sector = bench.at(std::atan2(y, x));
    ASSERT_TRUE(sector.blocked);
    EXPECT_NEAR(sector.nearest_m, std::hypot(x, y), 3.0 * sector.nearest_sigma_m + 0.05);
    EXPECT_NEAR(0.5 * (bench.sectors.front().bearing_rad + bench.sectors.back().bearing_rad), yaw, 1e-9);
}

TEST(Sectors, DropIsAThingToo) {
    Bench bench;
    World world{bench.rig, pose_deg(15.0, 0.0, 1.2), {}};
    world.ditch_from_m = 2.5;
    world.ditch_to_m = 4.0;
    world.ditch_depth_m = 1.0;
    bench.see(world, {0.1, 0.0, 0.0, 2});
    for (const Sector& sector : bench.sectors) {
        ASSERT_TRUE(sector.blocked);
        EXPECT_EQ(sector.kind, TerrainClass::kDrop);
        EXPECT_GT(sector.nearest_m, 2.4);
        EXPECT_LT(sector.nearest_m, 4.2 / std::cos(sector.bearing_rad));
        const double straight = std::max(0.0, std::fabs(sector.bearing_rad) - 0.5 * sector.width_rad);
        EXPECT_LT(sector.free_range_m, 2.5 / std::cos(straight));
        EXPECT_GT(sector.free_range_m, 2.2 / std::cos(sector.bearing_rad));
    }
}

// What is not seen is not free, however good the ground behind it.
TEST(Sectors, UnknownGroundEndsWhatIsFree) {
    Bench bench;
    const World world{bench.rig, pose_deg(12.0, 0.0, 1.2), {}};
    bench.see(world);
    const double before = bench.at(0.0).free_range_m;
    for (int v = 330; v < 380; ++v)
        for (int u = 0; u < bench.rig.width; ++u)
            bench.mask.at(u, v) = TerrainClass::kUnknown;
    bench.finder.find(bench.map, bench.ground, bench.mask, bench.range_limit_m, bench.sectors);
    // Row 380 sees the ground at h cos / (tan-like) : d = beta (v - v_h).
    const double d_px = bench.ground.plane.at(bench.rig.cx_px, 380);
    const double range = 60.0 / d_px;
    EXPECT_GT(before, 8.0);
    EXPECT_LT(bench.at(0.0).free_range_m, range * 1.02);
    EXPECT_GT(bench.at(0.0).free_range_m, range * 0.85);
    fill_pixels(bench.mask, TerrainClass::kUnknown);
    bench.finder.find(bench.map, bench.ground, bench.mask, bench.range_limit_m, bench.sectors);
    for (const Sector& sector : bench.sectors) {
        EXPECT_EQ(sector.free_range_m, 0.0);
        EXPECT_EQ(sector.coverage, 0.0);
        EXPECT_FALSE(sector.blocked);
    }
}

// The view begins 1.56 m before the camera's foot; from there to 2 m are 85 rows.
struct Strip {
    Bench bench;
    World world{bench.rig, pose_deg(12.0, 0.0, 1.2), {}};

    explicit Strip(double stopping_distance_m = 2.0) : bench(config_of(stopping_distance_m)) {
        bench.see(world);
    }
    static TerrainConfig config_of(double stopping_distance_m) {
        TerrainConfig config;
        config.stopping_distance_m = stopping_distance_m;
        return config;
    }
    double range_of(int row) const {
        const Rays rays(world);
        double along[3];
        rays.direction(bench.rig.cx_px, row, along);
        return world.pose.height_m * along[0] / along[2];
    }
    // Where ground straight ahead lies between these ranges.
    template <typename Change>
    void change(double from_m, double to_m, Change&& with) {
        for (int v = 0; v < bench.rig.height; ++v) {
            const double range = range_of(v);
            if (range <= 0.0 || range < from_m || range > to_m) continue;
            for (int u = 0; u < bench.rig.width; ++u)
                with(u, v);
        }
    }
    void hide(double from_m, double to_m) {
        change(from_m, to_m, [&](int u, int v) { bench.mask.at(u, v) = TerrainClass::kUnknown; });
    }
    const Sector& ahead() {
        bench.finder.find(bench.map, bench.ground, bench.mask, bench.range_limit_m, bench.sectors);
        return bench.at(0.02);
    }
};

TEST(Sectors, GapBlocksInsideTheStoppingDistance) {
    Strip strip;
    strip.hide(1.8, 2.2);
    const Sector& sector = strip.ahead();
    ASSERT_TRUE(sector.blocked);
    EXPECT_EQ(sector.kind, TerrainClass::kUnknown);
    EXPECT_NEAR(sector.nearest_m, 1.8, 0.02);
    EXPECT_GT(sector.nearest_sigma_m, 0.0);
    EXPECT_LT(sector.free_range_m, 1.8);
    EXPECT_GT(sector.free_range_m, 1.7);
}

TEST(Sectors, GapBeyondTheStoppingDistanceOnlyEndsWhatIsFree) {
    Strip strip(1.5);
    strip.hide(1.8, 2.2);
    const Sector& sector = strip.ahead();
    EXPECT_FALSE(sector.blocked);
    EXPECT_LT(sector.free_range_m, 1.8);
    EXPECT_GT(sector.free_range_m, 1.7);
}

TEST(Sectors, AShortHoleInWhatIsSeenIsNoGap) {
    Strip strip;
    const double free_range_m = strip.ahead().free_range_m;
    strip.hide(1.70, 1.72);
    EXPECT_FALSE(strip.ahead().blocked);
    EXPECT_DOUBLE_EQ(strip.ahead().free_range_m, free_range_m);
}

// Three fifths of every stretch: too little to be free, too much for a gap.
TEST(Sectors, HalfSeenGroundIsNeitherFreeNorAGap) {
    Strip strip;
    strip.change(1.7, 2.2, [&](int u, int v) {
        if ((u / 4 + 2 * v) % 5 < 2) strip.bench.mask.at(u, v) = TerrainClass::kUnknown;
    });
    EXPECT_FALSE(strip.ahead().blocked);
    EXPECT_LT(strip.ahead().free_range_m, 1.7);
    EXPECT_GT(strip.ahead().free_range_m, 1.6);
}

TEST(Sectors, GroundNotSeenAtTheNearEdgeIsNoGap) {
    Strip strip;
    strip.hide(0.0, 1.7);
    EXPECT_FALSE(strip.ahead().blocked);
    EXPECT_EQ(strip.ahead().free_range_m, 0.0);
}

TEST(Sectors, RobotsOwnPartsAreNeitherNearEdgeNorGap) {
    for (const auto& [from_m, to_m] : {std::pair{0.0, 1.7}, std::pair{1.7, 1.95}}) {
        Strip strip;
        const double free_range_m = strip.ahead().free_range_m;
        const double coverage = strip.ahead().coverage;
        strip.hide(from_m, to_m);
        strip.change(from_m, to_m, [&](int u, int v) { strip.bench.map.invalid.at(u, v) = Invalid::kBody; });
        EXPECT_FALSE(strip.ahead().blocked);
        EXPECT_DOUBLE_EQ(strip.ahead().free_range_m, free_range_m);
        EXPECT_NEAR(strip.ahead().coverage, coverage, 0.1);
    }
}

// Its far wall is less than the tolerance below the ground, so all of it is class 1; 0.28 m of ground are not
// seen all the same.
TEST(Sectors, LipEndsWhatIsFreeThoughNothingBehindItIsADrop) {
    Strip strip;
    strip.world.ditch_from_m = 1.8;
    strip.world.ditch_to_m = 2.08;
    strip.world.ditch_depth_m = 1.0;
    strip.bench.see(strip.world, {0.1, 0.0, 0.0, 3});
    const Sector& sector = strip.ahead();
    ASSERT_TRUE(sector.blocked);
    EXPECT_EQ(sector.kind, TerrainClass::kUnknown);
    EXPECT_NEAR(sector.nearest_m, 1.8, 0.05);
    EXPECT_LT(sector.free_range_m, 1.8);
}

// Wherever in a stretch of rows the lip is; at most a stretch, the margin and the deviation's rows are lost.
TEST(Sectors, WhatIsFreeEndsFourRowsBeforeALip) {
    for (double from_m = 1.65; from_m < 2.0; from_m += 0.003) {
        Strip strip(1.0);
        strip.hide(from_m, 2.4);
        const double free_range_m = strip.ahead().free_range_m;
        int lip = 0;  // the nearest row that is hidden, and one below
        while (strip.range_of(lip) <= 0.0 || strip.range_of(lip) >= from_m)
            ++lip;
        int last = lip;
        while (strip.range_of(last) > free_range_m)
            ++last;
        ASSERT_GE(last - lip, 4) << from_m;
        ASSERT_LE(last - lip, 12) << from_m;
    }
}

TEST(Sectors, GapBeforeAThingIsTheThings) {
    Strip strip;
    strip.world.boxes.push_back({1.9, 0.0, 0.8, 0.5, 0.6});
    strip.bench.see(strip.world, {0.1, 0.0, 0.0, 3});
    ASSERT_TRUE(strip.ahead().blocked);
    EXPECT_EQ(strip.ahead().kind, TerrainClass::kObstacle);
    // Not so a gap well before it.
    strip.hide(1.62, 1.75);
    ASSERT_TRUE(strip.ahead().blocked);
    EXPECT_EQ(strip.ahead().kind, TerrainClass::kUnknown);
    EXPECT_NEAR(strip.ahead().nearest_m, 1.62, 0.02);
}

// 36 pixels at 0.8 m are 1 cm2, too few to be a thing of their own.
TEST(Sectors, APatchMatchedWronglyWithinAThingDecidesNothing) {
    Bench bench;
    World world{bench.rig, pose_deg(12.0, 0.0, 1.2), {}};
    world.boxes.push_back({5.0, 0.0, 1.0, 0.5, 0.8});
    bench.see(world);
    const double nearest_m = bench.at(0.01).nearest_m;
    const int v = static_cast<int>(bench.rig.cy_px) - 40;
    const int u = static_cast<int>(bench.rig.cx_px - 0.01 * bench.rig.focal_px);
    ASSERT_EQ(bench.mask.at(u, v), TerrainClass::kObstacle);
    for (int row = v; row < v + 6; ++row)
        for (int column = u; column < u + 6; ++column)
            bench.map.disparity_q4.at(column, row) = 16 * 75;
    bench.finder.find(bench.map, bench.ground, bench.mask, bench.range_limit_m, bench.sectors);
    EXPECT_NEAR(bench.at(0.01).nearest_m, nearest_m, 0.02);
}

// Holes in obstacles are closed in the mask; they have no range.
TEST(Sectors, PixelsWithoutDisparityHaveNoRange) {
    Bench bench;
    World world{bench.rig, pose_deg(12.0, 0.0, 1.2), {}};
    world.boxes.push_back({5.0, 0.0, 1.0, 0.5, 0.8});
    bench.see(world);
    const double nearest_m = bench.at(0.0).nearest_m;
    int holes = 0;
    for (int v = 0; v < bench.rig.height; ++v)
        for (int u = 0; u < bench.rig.width; ++u) {
            if (bench.mask.at(u, v) != TerrainClass::kObstacle || (u / 4 + v / 4) % 2 == 0) continue;
            bench.map.invalid.at(u, v) = Invalid::kTexture;
            bench.map.disparity_q4.at(u, v) = 16 * 90;  // would be 0.7 m
            ++holes;
        }
    ASSERT_GT(holes, 1000);
    bench.finder.find(bench.map, bench.ground, bench.mask, bench.range_limit_m, bench.sectors);
    EXPECT_NEAR(bench.at(0.0).nearest_m, nearest_m, 0.02);
}

TEST(Sectors, RangeEdgePixelsBlockAtTheNearestRange) {
    Bench bench;
    World world{bench.rig, pose_deg(12.0, 0.0, 1.2), {}};
    test::render(world, 0, kDisparities, {}, bench.map);
    for (int v = 200; v < 300; ++v)
        for (int u = 300; u < 340; ++u)
            bench.map.invalid.at(u, v) = Invalid::kRangeEdge;
    bench.ground.found = bench.ground.metric = true;
    bench.ground.plane = plane_of(world.pose, bench.rig);
    bench.ground.pose = world.pose;
    FixedVector<Obstacle, kMaxObstacles> obstacles;
    Serial serial;
    bench.classifier.classify(bench.map, bench.ground, GroundUse::kOwn, bench.surface, bench.mask, obstacles,
                              bench.range_limit_m, serial);
    bench.finder.find(bench.map, bench.ground, bench.mask, bench.range_limit_m, bench.sectors);
    ASSERT_EQ(obstacles.size(), 1U);
    EXPECT_NEAR(obstacles[0].range_m, 60.0 / 95.0, 0.01);
    EXPECT_TRUE(bench.at(0.0).blocked);
    EXPECT_LT(bench.at(0.0).nearest_m, 0.75);
    EXPECT_EQ(bench.at(0.0).free_range_m, std::min(bench.at(0.0).free_range_m, bench.at(0.0).nearest_m));
}

TEST(Sectors, AreEmptyWithoutMetresOrGround) {
    Bench bench;
    bench.see({bench.rig, pose_deg(12.0, 0.0, 1.2), {}});
    ASSERT_FALSE(bench.sectors.empty());
    Ground ground = bench.ground;
    ground.found = false;
    bench.finder.find(bench.map, ground, bench.mask, bench.range_limit_m, bench.sectors);
    EXPECT_TRUE(bench.sectors.empty());
    ground = bench.ground;
    ground.metric = false;
    bench.finder.find(bench.map, ground, bench.mask, bench.range_limit_m, bench.sectors);
    EXPECT_TRUE(bench.sectors.empty());
    RectifiedRig unknown = bench.rig;
    unknown.calibrated = false;
    SectorFinder finder(TerrainConfig{}, unknown, 0, kDisparities, bench.arena);
    finder.find(bench.map, bench.ground, bench.mask, bench.range_limit_m, bench.sectors);
    EXPECT_TRUE(bench.sectors.empty());
}

TEST(Sectors, RefuseAnImpossibleNumber) {
    Arena arena;
    TerrainConfig config;
    config.sectors = 0;
    EXPECT_THROW(SectorFinder(config, rig_of(), 0, 64, arena), Refusal);
    config.sectors = 65;
    EXPECT_THROW(SectorFinder(config, rig_of(), 0, 64, arena), Refusal);
}

}  // namespace
}  // namespace groundline::terrain
