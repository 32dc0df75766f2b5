// Thin and low things in rendered pictures, through the default matcher: what of them becomes an obstacle.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "core/deterministic_math.hpp"
#include "core/parallel.hpp"
#include "stereo/matcher.hpp"
#include "synth/renderer.hpp"
#include "terrain/classifier.hpp"

namespace groundline::terrain {
namespace {

constexpr int kDisparities = 64;

struct Picture {
    Arena arena;
    Serial serial;
    synth::Scene scene;
    TerrainConfig config;
    Mask mask;
    FixedVector<Obstacle, kMaxObstacles> obstacles;
    synth::Truth truth;

    explicit Picture(const std::string& spec) : scene(synth::scene_by_name(spec)) {}

    void take() {
        const int width = scene.rig.width;
        const int height = scene.rig.height;
        const synth::Renderer renderer(scene);
        const StereoFrame frame = StereoFrame::make(arena, width, height, false);
        renderer.render(0, serial, frame.left, frame.left_bgr, frame.right);
        truth = synth::Truth::make(arena, width, height);
        renderer.render_truth(0, serial, config.tolerance_up_m, truth);
        DisparityMap map = DisparityMap::make(arena, width, height);
        stereo::MatcherConfig matcher;
        matcher.disparities = kDisparities;
        stereo::make_matcher(matcher, width, height, 1, arena)->match(frame.left, frame.right, map, serial);
        Ground ground;
        ground.found = ground.metric = true;
        ground.plane = renderer.plane(0);
        ground.pose = synth::camera_at(scene, 0).pose;
        GroundSurface surface;
        surface.take(arena, width, height, 0, kDisparities);
        surface.flatten(CellSupport::kSupported);
        mask = arena.image<TerrainClass>(width, height);
        double range_limit_m = 0.0;
        Classifier classifier(config, scene.rig, 0, kDisparities, arena);
        classifier.classify(map, ground, GroundUse::kOwn, surface, mask, obstacles, range_limit_m, serial);
    }
};

synth::Thing pole(double x_m, double z_m, double width_m, double height_m) {
    return {synth::Shape::kPole, x_m, z_m, 0.0, 0.5 * width_m, 0.5 * width_m, height_m, {60.0, 110.0, 150.0}};
}

// Of the pixels that truly are a thing's, above the tolerance, nearer than `within_m` and in both views.
struct Found {
    int pixels = 0;
    int obstacle = 0;
    int free = 0;
    int columns = 0;
    int open_columns = 0;  // without a single obstacle pixel
};

Found found_of(const Picture& picture, double within_m) {
    const double least_px = picture.scene.rig.focal_px * picture.scene.rig.baseline_m / within_m;
    Found found;
    for (int u = 0; u < picture.mask.width; ++u) {
        int pixels = 0;
        int obstacle = 0;
        for (int v = 0; v < picture.mask.height; ++v) {
            if (picture.truth.terrain.at(u, v) != TerrainClass::kObstacle) continue;
            if (picture.truth.occluded.at(u, v) != 0) continue;
            if (picture.truth.disparity_px.at(u, v) < least_px) continue;
            ++pixels;
            obstacle += picture.mask.at(u, v) == TerrainClass::kObstacle ? 1 : 0;
            found.free += picture.mask.at(u, v) == TerrainClass::kTraversable ? 1 : 0;
        }
        found.pixels += pixels;
        found.obstacle += obstacle;
        found.columns += pixels > 0 ? 1 : 0;
        found.open_columns += pixels > 0 && obstacle == 0 ? 1 : 0;
    }
    return found;
}

struct Upright {
    const char* name;
    double x_m, z_m, width_m, height_m;
    double found;  // least share of its pixels that are obstacle
    double free;   // most that are traversable
    bool alone;    // not joined to the wall
};

// In front of a wall, with noise of 2 grey levels. Rows in which the matcher sees only what is behind break a
// thin thing into pieces, each with the right place; it looks wider than it is, by less than 32 px. What the
// matching joins to the wall has its own range still, as the nearest part.
TEST(ThingsInPictures, ThinUprightThingsBecomeObstaclesInTheirPlace) {
    for (const Upright& thing : {Upright{"pole of 4 cm at 3 m", 0.5, 3.0, 0.04, 1.2, 0.80, 0.02, true},
                                 Upright{"fence post at 6 m", -1.0, 6.0, 0.10, 1.3, 0.95, 0.0, false},
                                 Upright{"table leg at 2 m", 0.2, 2.0, 0.04, 0.45, 0.50, 0.25, true}})
        for (int seed = 1; seed <= 6; ++seed) {
            SCOPED_TRACE(std::string(thing.name) + ", seed " + std::to_string(seed));
            Picture picture("plane?noise=2&wall_m=12&wall_height_m=15&seed=" + std::to_string(seed));
            picture.scene.things = {pole(thing.x_m, thing.z_m, thing.width_m, thing.height_m)};
            picture.take();
            const Found found = found_of(picture, thing.z_m + 1.0);
            ASSERT_GT(found.pixels, 300);
            EXPECT_GE(found.obstacle, thing.found * found.pixels);
            EXPECT_LE(found.free, thing.free * found.pixels);
            const GroundPose pose = picture.scene.mount;
            const auto depth = [&](double height_m) {
                return (thing.z_m - 0.5 * thing.width_m) * std::cos(pose.pitch_rad) +
                       (pose.height_m - height_m) * std::sin(pose.pitch_rad);
            };
            ASSERT_FALSE(picture.obstacles.empty());
            int pieces = 0;
            double highest_m = 0.0;
            double lowest_m = 9.0;
            for (const Obstacle& seen : picture.obstacles) {
                if (seen.range_m > thing.z_m + 1.0) continue;
                ++pieces;
                EXPECT_GT(seen.range_m, depth(thing.height_m) - 3.0 * seen.range_sigma_m);
                EXPECT_LT(seen.range_m, depth(picture.config.tolerance_up_m) + 3.0 * seen.range_sigma_m);
                if (!thing.alone) continue;
                EXPECT_NEAR(seen.bearing_rad, -std::atan2(thing.x_m, depth(0.5 * thing.height_m)), 0.03);
                EXPECT_LT(seen.width_m, thing.width_m + 32.0 * seen.range_m / picture.scene.rig.focal_px);
                highest_m = std::max(highest_m, seen.height_m);
                lowest_m = std::min(lowest_m, seen.lowest_m);
            }
            EXPECT_GE(pieces, 1);
            if (thing.alone) {
                EXPECT_NEAR(highest_m, thing.height_m, 0.12);
                EXPECT_NEAR(lowest_m, picture.config.tolerance_up_m, 0.02);
            }
            std::printf("%s, seed %d: %.1f %% obstacle, %.1f %% free, %d pieces, %.2f to %.2f m\n",
                        thing.name, seed, 100.0 * found.obstacle / found.pixels,
                        100.0 * found.free / found.pixels, pieces, lowest_m, highest_m);
        }
}

// 15 cm high, 4 m away, across the view; the robot climbs 10 cm. Its top goes on to 10 m.
TEST(ThingsInPictures, AKerbLeavesNoColumnOpen) {
    for (int seed = 1; seed <= 6; ++seed) {
        SCOPED_TRACE(seed);
        Picture picture("plane?noise=2&seed=" + std::to_string(seed));
        picture.config.tolerance_up_m = picture.config.tolerance_down_m = 0.10;
        picture.scene.things = {{synth::Shape::kBox, 0.0, 7.0, 0.0, 10.0, 3.0, 0.15, {90.0, 90.0, 90.0}}};
        picture.take();
        const Found found = found_of(picture, 6.0);
        EXPECT_GT(found.columns, picture.mask.width - 20);
        // The outermost column is in both views or not by a fraction of its disparity.
        EXPECT_LE(found.open_columns, 1);
        EXPECT_GE(found.obstacle, 0.80 * found.pixels);
        EXPECT_LE(found.free, 0.003 * found.pixels);
        std::printf("kerb, seed %d: %.1f %% obstacle, %.2f %% free\n", seed,
                    100.0 * found.obstacle / found.pixels, 100.0 * found.free / found.pixels);
    }
}

}  // namespace
}  // namespace groundline::terrain
