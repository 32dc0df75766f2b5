// What becomes of things in the picture: their metric extent, and the things that are easily missed.
#include "terrain/obstacles.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "terrain/classifier.hpp"
#include "unit/terrain_scene.hpp"

namespace groundline::terrain {
namespace {

using test::Box;
using test::pose_deg;
using test::rig_of;
using test::World;

constexpr int kDisparities = 64;

Ground ground_of(const RectifiedRig& rig, const GroundPose& pose) {
    Ground ground;
    ground.found = true;
    ground.metric = rig.calibrated;
    ground.plane = plane_of(pose, rig);
    ground.pose = pose;
    return ground;
}

TEST(Obstacles, EdgesAndWidthAreThoseOfAnUprightFace) {
    RectifiedRig rig = rig_of();
    rig.cx_px = 300.25;
    for (const int left : {0, 100, 300, 560})
        for (const int width : {1, 7, 80}) {
            FixedVector<Thing, kMaxObstacles> things(1);
            Thing& thing = things[0];
            thing.left = left;
            thing.right = left + width - 1;
            thing.near_px = 20.0;
            FixedVector<Obstacle, kMaxObstacles> obstacles;
            obstacles_of(things, rig, ground_of(rig, pose_deg(10.0, 0.0, 1.0)), 0.25, obstacles);
            ASSERT_EQ(obstacles.size(), 1U);
            const Obstacle& seen = obstacles[0];
            EXPECT_NEAR(seen.range_m, 3.0, 1e-12);
            // The face lies in the plane z = 3 m, x to the left.
            const double x_left = 3.0 * (300.25 - (left - 0.5)) / 500.0;
            const double x_right = 3.0 * (300.25 - (left + width - 0.5)) / 500.0;
            EXPECT_NEAR(seen.left_rad, std::atan2(x_left, 3.0), 1e-9);
            EXPECT_NEAR(seen.right_rad, std::atan2(x_right, 3.0), 1e-9);
            EXPECT_LT(seen.right_rad, seen.bearing_rad);
            EXPECT_LT(seen.bearing_rad, seen.left_rad);
            const double middle = std::atan2(0.5 * (x_left + x_right), 3.0);
            EXPECT_NEAR(seen.width_m, (x_left - x_right) * std::cos(middle), 1e-9);
        }
}

TEST(Obstacles, HaveNoMetresWithoutAMetricGround) {
    const RectifiedRig rig = rig_of();
    Ground ground = ground_of(rig, pose_deg(10.0, 0.0, 1.0));
    ground.metric = false;
    FixedVector<Thing, kMaxObstacles> things(1);
    things[0].right = 9;
    things[0].near_px = 20.0;
    FixedVector<Obstacle, kMaxObstacles> obstacles;
    obstacles_of(things, rig, ground, 0.25, obstacles);
    ASSERT_EQ(obstacles.size(), 1U);
    const Obstacle& seen = obstacles[0];
    for (const double metres : {seen.range_m, seen.range_sigma_m, seen.bearing_rad, seen.left_rad,
                                seen.right_rad, seen.width_m, seen.height_m, seen.lowest_m})
        EXPECT_EQ(metres, 0.0);
}

// A world as a perfect matcher sees it, with this noise, and its true ground.
struct Look {
    World world{rig_of(), pose_deg(10.0, 2.0, 1.0), {}};
    TerrainConfig config;
    test::Noise noise{0.25, 0.02, 0.05, 1};
    Arena arena;
    Mask mask;
    FixedVector<Obstacle, kMaxObstacles> obstacles;

    void take() {
        const RectifiedRig& rig = world.rig;
        DisparityMap map = DisparityMap::make(arena, rig.width, rig.height);
        mask = arena.image<TerrainClass>(rig.width, rig.height);
        test::render(world, 0, kDisparities, noise, map);
        Classifier classifier(config, rig, 0, kDisparities, arena);
        GroundSurface surface;
        surface.take(arena, rig.width, rig.height, 0, kDisparities);
        surface.flatten(CellSupport::kSupported);
        Serial serial;
        double range_limit_m = 0.0;
        classifier.classify(map, ground_of(rig, world.pose), GroundUse::kOwn, surface, mask, obstacles,
                            range_limit_m, serial);
    }
    // Depth along the optical axis of a point this far ahead and this high; roll moves none of it.
    double depth_of(double forward_m, double height_m) const {
        const double pitch = world.pose.pitch_rad;
        return forward_m * std::cos(pitch) + (world.pose.height_m - height_m) * std::sin(pitch);
    }
    // The rig resolves this many metres in a pixel at that range.
    double pixel_m(double range_m) const { return range_m / world.rig.focal_px; }
};

struct Upright {
    const char* name;
    Box box;
};

// Thin and upright: each is one obstacle with the extent of its box.
TEST(Obstacles, ThinUprightThingsAreFoundWithTheirExtent) {
    for (const Upright& thing : {Upright{"pole of 4 cm at 3 m", {3.0, 0.6, 0.04, 0.04, 1.2}},
                                 Upright{"fence post at 6 m", {6.0, -1.0, 0.1, 0.1, 1.3}},
                                 Upright{"table leg at 2 m", {2.0, 0.2, 0.03, 0.03, 0.45}}})
        for (std::uint32_t seed = 1; seed <= 10; ++seed) {
            SCOPED_TRACE(std::string(thing.name) + ", seed " + std::to_string(seed));
            Look look;
            look.noise.seed = seed;
            look.world.boxes = {thing.box};
            look.take();
            ASSERT_EQ(look.obstacles.size(), 1U);
            const Obstacle& seen = look.obstacles[0];
            EXPECT_EQ(seen.kind, TerrainClass::kObstacle);
            EXPECT_FALSE(seen.overhang);
            const Box& box = thing.box;
            const double nearest = look.depth_of(box.forward_m, box.top_m);
            const double farthest = look.depth_of(box.forward_m, look.config.tolerance_up_m);
            EXPECT_GT(seen.range_m, nearest - 3.0 * seen.range_sigma_m);
            EXPECT_LT(seen.range_m, farthest + 3.0 * seen.range_sigma_m);
            // Roll leans it by 2 deg in the picture, pitch as its top is nearer than its foot; a pixel at
            // either side is rounding.
            const double lean_m = (box.top_m - look.config.tolerance_up_m) * std::tan(det::radians(2.0)) +
                                  std::fabs(box.left_m) * (farthest / nearest - 1.0);
            EXPECT_GT(seen.width_m, box.width_m - 2.0 * look.pixel_m(nearest));
            EXPECT_LT(seen.width_m, box.width_m + lean_m + 3.0 * look.pixel_m(farthest));
            // The highest pixel of many, each with its own noise: 4 deviations of its height.
            const double noise_m = 4.0 * 0.25 / seen.disparity_px * look.world.pose.height_m;
            EXPECT_NEAR(seen.height_m, box.top_m, noise_m + look.pixel_m(farthest));
            EXPECT_NEAR(seen.bearing_rad, std::atan2(box.left_m, nearest), 0.03);
            EXPECT_GT(seen.left_rad, seen.right_rad);
        }
}

// 15 cm high, 4 m away, right across the view; the robot climbs 10 cm.
TEST(Obstacles, AKerbAcrossTheViewIsOneObstacleFromEdgeToEdge) {
    for (std::uint32_t seed = 1; seed <= 10; ++seed) {
        SCOPED_TRACE(seed);
        Look look;
        look.config.tolerance_up_m = look.config.tolerance_down_m = 0.10;
        look.noise.seed = seed;
        look.world.boxes = {{4.0, 0.0, 20.0, 6.0, 0.15}};
        look.take();
        ASSERT_FALSE(look.obstacles.empty());
        const Obstacle& kerb = look.obstacles[0];
        EXPECT_LE(kerb.left, 2);
        EXPECT_GE(kerb.right, look.world.rig.width - 3);
        const double edge_m = look.depth_of(4.0, 0.15);
        EXPECT_NEAR(kerb.range_m, edge_m, 3.0 * kerb.range_sigma_m);
        EXPECT_NEAR(kerb.width_m, look.world.rig.width * look.pixel_m(kerb.range_m), 1e-6);
        // All columns are blocked: the robot nowhere finds a way up.
        int open = 0;
        for (int u = 0; u < look.world.rig.width; ++u) {
            int pixels = 0;
            for (int v = 0; v < look.world.rig.height; ++v)
                pixels += look.mask.at(u, v) == TerrainClass::kObstacle ? 1 : 0;
            open += pixels == 0 ? 1 : 0;
        }
        EXPECT_EQ(open, 0);
    }
}

// Nearer than the search range: at the nearest range it can be, which is where it is at the farthest.
TEST(Obstacles, WhatIsNearerThanTheSearchRangeStandsAtItsNearEnd) {
    Look look;
    look.world.boxes = {{0.5, 0.0, 0.2, 0.2, 0.9}};
    look.take();
    ASSERT_FALSE(look.obstacles.empty());
    const Obstacle& near = look.obstacles[0];
    EXPECT_EQ(near.kind, TerrainClass::kObstacle);
    EXPECT_FALSE(near.overhang);
    const double least_m = look.world.rig.focal_px * look.world.rig.baseline_m / (kDisparities - 1);
    EXPECT_NEAR(near.range_m, least_m, 0.01);
    EXPECT_LT(look.depth_of(0.5, 0.5), least_m);
    // Its bearings are right all the same.
    EXPECT_NEAR(near.bearing_rad, 0.0, 0.05);
    EXPECT_NEAR(near.left_rad - near.right_rad, 2.0 * std::atan2(0.1, look.depth_of(0.5, 0.5)), 0.08);
    const int u = (near.left + near.right) / 2;
    const int v = (near.top + near.bottom) / 2;
    EXPECT_EQ(look.mask.at(u, v), TerrainClass::kObstacle);
}

// A beam from `bottom_m` up: the robot passes under it or it does not.
TEST(Obstacles, ABeamAboveTheClearanceIsUnknownAndListedAndALowerOneIsAnObstacle) {
    for (const double bottom_m : {1.7, 1.2}) {
        SCOPED_TRACE(bottom_m);
        Look look;
        look.config.clearance_m = 1.5;
        look.noise = {};
        look.world.boxes = {{5.0, 0.3, 1.4, 0.3, 2.2, bottom_m}};
        look.take();
        ASSERT_EQ(look.obstacles.size(), 1U);
        const Obstacle& beam = look.obstacles[0];
        const bool passes = bottom_m > 1.5;
        EXPECT_EQ(beam.overhang, passes);
        EXPECT_NEAR(beam.lowest_m, bottom_m, 0.03);
        EXPECT_NEAR(beam.width_m, 1.4, 0.1);
        int obstacle = 0;
        int free = 0;
        int all = 0;
        for (int v = beam.top; v <= beam.bottom; ++v)
            for (int u = beam.left; u <= beam.right; ++u, ++all) {
                obstacle += look.mask.at(u, v) == TerrainClass::kObstacle ? 1 : 0;
                free += look.mask.at(u, v) == TerrainClass::kTraversable ? 1 : 0;
            }
        EXPECT_EQ(free, 0);
        if (passes) {
            EXPECT_EQ(obstacle, 0);
        } else {
            EXPECT_GE(obstacle, beam.pixels) << "as a whole, the part above the clearance too";
        }
    }
}

}  // namespace
}  // namespace groundline::terrain
