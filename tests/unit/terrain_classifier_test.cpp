#include "terrain/classifier.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/allocation_count.hpp"
#include "terrain/ground_finder.hpp"
#include "terrain/sectors.hpp"
#include "terrain/shares.hpp"
#include "terrain/v_disparity.hpp"
#include "unit/terrain_scene.hpp"

namespace groundline::terrain {
namespace {

using test::Box;
using test::Dice;
using test::pose_deg;
using test::rig_of;
using test::World;

constexpr int kDisparities = 96;

Ground ground_of(const RectifiedRig& rig, const GroundPose& pose) {
    Ground ground;
    ground.found = true;
    ground.metric = rig.calibrated;
    ground.plane = plane_of(pose, rig);
    ground.pose = pose;
    return ground;
}

struct Bench {
    RectifiedRig rig;
    Arena arena;
    Classifier classifier;
    DisparityMap map;
    ImageView<TerrainClass> mask;
    GroundSurface surface;
    FixedVector<Obstacle, kMaxObstacles> obstacles;
    double range_limit_m = -1.0;

    explicit Bench(const RectifiedRig& r, const TerrainConfig& config = {}, int disparities = kDisparities)
        : rig(r),
          classifier(config, rig, 0, disparities, arena),
          map(DisparityMap::make(arena, rig.width, rig.height)),
          mask(arena.image<TerrainClass>(rig.width, rig.height)) {
        surface.take(arena, rig.width, rig.height, 0, disparities);
        surface.flatten(CellSupport::kSupported);
    }
    void classify(const Ground& ground, GroundUse use = GroundUse::kOwn) {
        Serial serial;
        classifier.classify(map, ground, use, surface, mask, obstacles, range_limit_m, serial);
    }
    int count(TerrainClass kind) const {
        int pixels = 0;
        for (int v = 0; v < rig.height; ++v)
            for (int u = 0; u < rig.width; ++u)
                pixels += mask.at(u, v) == kind ? 1 : 0;
        return pixels;
    }
    std::vector<TerrainClass> pixels() const {
        std::vector<TerrainClass> all;
        for (int v = 0; v < rig.height; ++v)
            for (int u = 0; u < rig.width; ++u)
                all.push_back(mask.at(u, v));
        return all;
    }
};

// Nothing is filtered: the mask is what the pixel rules say.
TerrainConfig unfiltered() {
    TerrainConfig config;
    config.min_pixels = 1;
    config.min_area_m2 = 0.0;
    config.clearance_m = 1e9;
    config.gap_px = 0;
    config.blur_px = config.blur_beyond_px = 0;
    config.min_pixels_far = 1;
    return config;
}

std::array<double, 9> some_covariance(Dice& dice, double scale) {
    // A A' of a random A, sized for a plane in px: du, dv about 1e-5, d0 about 1e-2.
    const double unit[3] = {1e-5 * scale, 1e-5 * scale, 1e-2 * scale};
    double a[3][3];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            a[i][j] = unit[i] * dice.normal();
    std::array<double, 9> out{};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            for (int k = 0; k < 3; ++k)
                out[static_cast<std::size_t>(3 * i + j)] += a[i][k] * a[j][k];
    return out;
}

// The contract in plain doubles, with divisions, numeric derivatives and a search for the certified range.
class Reference {
  public:
    Reference(const TerrainConfig& config, const RectifiedRig& rig, const Ground& ground)
        : config_(config), rig_(rig), ground_(ground), offset_(rig.calibrated ? rig.offset_px() : 0.0) {
        up_ = rig.calibrated ? config.tolerance_up_m : config.tolerance_ratio;
        down_ = rig.calibrated ? config.tolerance_down_m : config.tolerance_ratio;
    }

    double height(const DisparityPlane& plane, double u, double v, double d_px) const {
        const double camera = rig_.calibrated ? pose_of(plane, rig_).height_m : 1.0;
        return camera * (1.0 - (plane.at(u, v) - offset_) / d_px);
    }

    double sigma(double u, double v, double d_px) const {
        const double camera = rig_.calibrated ? pose_of(ground_.plane, rig_).height_m : 1.0;
        const double h = height(ground_.plane, u, v, d_px);
        const double by_d = (camera - h) / d_px * config_.sigma_disparity_px;
        double by[3];
        const double step[3] = {1e-7, 1e-7, 1e-4};
        for (int i = 0; i < 3; ++i) {
            DisparityPlane more = ground_.plane;
            DisparityPlane less = ground_.plane;
            (i == 0 ? more.du : i == 1 ? more.dv : more.d0) += step[i];
            (i == 0 ? less.du : i == 1 ? less.dv : less.d0) -= step[i];
            by[i] = (height(more, u, v, d_px) - height(less, u, v, d_px)) / (2.0 * step[i]);
        }
        double variance = by_d * by_d;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                variance += by[i] * ground_.covariance[static_cast<std::size_t>(3 * i + j)] * by[j];
        return std::sqrt(variance);
    }

    // True disparity of the farthest ground point of a column that is certain enough, by halving.
    double certified_px(int u) const {
        const DisparityPlane& plane = ground_.plane;
        const double horizon = -(plane.du * u + plane.d0 - offset_) / plane.dv;
        const auto certain = [&](double v) {
            const double d_px = plane.at(u, v) - offset_;
            return config_.sigmas * sigma(u, v, d_px) <= std::min(up_, down_);
        };
        double far = horizon + 1e-6;
        double near = horizon + 1e5;
        for (int i = 0; i < 100; ++i) {
            const double middle = 0.5 * (far + near);
            (certain(middle) ? near : far) = middle;
        }
        return std::max(1.0, plane.at(u, near) - offset_);
    }

    // Deviation of a disparity from the ground's, at the corner of the pixel's band of 64 columns where the
    // ground's is least certain.
    double worst_px(int u) const {
        const int first = u / 64 * 64;
        double worst = 0.0;
        for (const double x : {1.0 * first, std::min(first + 64.0, 1.0 * rig_.width) - 1.0})
            for (const double y : {0.0, rig_.height - 1.0}) {
                const double at[3] = {x, y, 1.0};
                double variance = config_.sigma_disparity_px * config_.sigma_disparity_px;
                for (int i = 0; i < 3; ++i)
                    for (int j = 0; j < 3; ++j)
                        variance += at[i] * ground_.covariance[static_cast<std::size_t>(3 * i + j)] * at[j];
                worst = std::max(worst, variance);
            }
        return std::sqrt(worst);
    }

    // The class, and whether a rounding could turn it.
    TerrainClass judge(int u, int v, double measured_px, double certified, bool& close) const {
        const double d_px = measured_px - offset_;
        close = std::fabs(d_px - certified) < 1e-4 * certified;
        if (d_px <= 0.0) return TerrainClass::kUnknown;
        const double h = height(ground_.plane, u, v, d_px);
        const double unit = rig_.calibrated ? ground_.pose.height_m : 1.0;
        if (std::fabs(h - up_) < 1e-5 * unit || std::fabs(h + down_) < 1e-5 * unit) close = true;
        if (d_px < certified) {
            const double limit = std::max(up_, config_.sigmas * worst_px(u) / d_px * unit);
            if (std::fabs(h - limit) < 1e-4 * std::fabs(limit)) close = true;
            return h > limit ? TerrainClass::kObstacle : TerrainClass::kUnknown;
        }
        return h > up_      ? TerrainClass::kObstacle
               : h < -down_ ? TerrainClass::kDrop
                            : TerrainClass::kTraversable;
    }

  private:
    TerrainConfig config_;
    RectifiedRig rig_;
    Ground ground_;
    double offset_;
    double up_;
    double down_;
};

void compare_with_reference(bool calibrated) {
    Dice dice(calibrated ? 21U : 22U);
    int seen[4] = {0, 0, 0, 0};
    for (int trial = 0; trial < 25; ++trial) {
        RectifiedRig rig = rig_of(160, 120, 125.0, 0.2);
        rig.cx_right_px = rig.cx_px - (trial % 3 == 0 ? 7.3 : 0.0);
        TerrainConfig config = unfiltered();
        config.tolerance_up_m = dice.between(0.05, 0.4);
        config.tolerance_down_m = dice.between(0.05, 0.4);
        Ground ground =
            ground_of(rig, pose_deg(dice.between(-5, 30), dice.between(-10, 10), dice.between(0.5, 2.0)));
        // Every fourth ground is so uncertain that nothing is certified and sigma_H decides.
        ground.covariance = some_covariance(dice, trial % 4 == 3 ? 100.0 : dice.between(0.0, 3.0));
        if (!calibrated) {
            if (trial % 3 == 0) ground.plane.d0 -= rig.offset_px();
            rig.calibrated = false;
            ground.metric = false;
        }
        Bench bench(rig, config);
        const double offset = calibrated ? rig.offset_px() : 0.0;
        for (int v = 0; v < rig.height; ++v)
            for (int u = 0; u < rig.width; ++u) {
                // Half anywhere in the range, half about the ground, where the decisions are.
                const double about = ground.plane.at(u, v) - offset;
                const double d_px = dice.bits() % 2 == 0 || about < 1.0
                                        ? dice.between(0.0, 95.0)
                                        : offset + about * dice.between(0.6, 1.6);
                const int d_q4 = static_cast<int>(std::floor(16.0 * std::clamp(d_px, 0.0, 95.0) + 0.5));
                bench.map.disparity_q4.at(u, v) = static_cast<std::int16_t>(d_q4);
            }
        bench.classify(ground);
        const Reference reference(config, rig, ground);
        for (int u = 0; u < rig.width; ++u) {
            const double certified = reference.certified_px(u);
            for (int v = 0; v < rig.height; ++v) {
                bool close = false;
                const TerrainClass truth =
                    reference.judge(u, v, bench.map.disparity_q4.at(u, v) / 16.0, certified, close);
                if (close) continue;
                ASSERT_EQ(bench.mask.at(u, v), truth)
                    << trial << " (" << u << ", " << v << ") d " << bench.map.disparity_q4.at(u, v) / 16.0;
                ++seen[static_cast<int>(truth)];
            }
        }
    }
    for (const int pixels : seen)
        EXPECT_GT(pixels, 5000);  // the trials reach every branch
}

TEST(Classifier, EqualsAPlainReferenceInMetres) {
    compare_with_reference(true);
}

TEST(Classifier, EqualsAPlainReferenceWithoutCalibration) {
    compare_with_reference(false);
}

TEST(Classifier, RangeLimitIsTheFarthestCertifiedRange) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    Ground ground = ground_of(rig, pose_deg(12.0, 2.0, 1.0));
    bench.classify(ground);
    // Disparity noise alone: Z = f b tolerance / (k h sigma) = 60 * 0.2 / (3 * 0.25) = 16 m.
    EXPECT_NEAR(bench.range_limit_m, 16.0, 1e-9);
    Dice dice(4);
    ground.covariance = some_covariance(dice, 5.0);
    bench.classify(ground);
    const Reference reference(TerrainConfig{}, rig, ground);
    double farthest = 1e9;
    for (int u = 0; u < rig.width; ++u)
        farthest = std::min(farthest, reference.certified_px(u));
    EXPECT_NEAR(bench.range_limit_m, 60.0 / farthest, 1e-3);
    EXPECT_LT(bench.range_limit_m, 16.0);
    // Nothing is certain enough: nothing may be traversable.
    ground.covariance = {1, 0, 0, 0, 1, 0, 0, 0, 100};
    fill_pixels(bench.map.disparity_q4, std::int16_t{320});
    bench.classify(ground);
    EXPECT_EQ(bench.range_limit_m, 0.0);
    EXPECT_EQ(bench.count(TerrainClass::kTraversable), 0);
}

// Ground is certified up to 16 m (3.75 px).
TEST(Classifier, BeyondHalfTheCertifiedRangeAThingNeedsFortyPixels) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    World world{rig, pose_deg(12.0, 0.0, 1.0), {}};
    const Ground ground = ground_of(rig, world.pose);
    const auto found = [&](int columns, int rows, int disparity_q4) {
        test::render(world, 0, kDisparities, {}, bench.map);
        // Its lowest row lies on the ground that is half a pixel and a quarter farther.
        const double under_px = 0.75 * disparity_q4 / 16.0 - 0.5;
        const int bottom = static_cast<int>((under_px - ground.plane.d0) / ground.plane.dv);
        for (int v = bottom - rows + 1; v <= bottom; ++v)
            for (int u = 100; u < 100 + columns; ++u)
                bench.map.disparity_q4.at(u, v) = static_cast<std::int16_t>(disparity_q4);
        bench.classify(ground);
        EXPECT_NEAR(bench.range_limit_m, 16.0, 1e-9);
        return bench.obstacles.size();
    };
    EXPECT_EQ(found(13, 3, 119), 0U);
    EXPECT_EQ(found(14, 3, 119), 1U);
    EXPECT_EQ(found(6, 3, 120), 1U);
}

// By the defaults: ground is unknown a window's width beside a thing, twice that beyond it.
TEST(Classifier, GroundBesideAThingIsUnknown) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    World world{rig, pose_deg(12.0, 0.0, 1.0), {}};
    test::render(world, 0, kDisparities, {}, bench.map);
    for (int v = 300; v < 320; ++v)
        for (int u = 100; u < 120; ++u)
            bench.map.disparity_q4.at(u, v) = 30 * 16;
    bench.classify(ground_of(rig, world.pose));
    for (int v = 280; v < 340; ++v)
        for (int u = 80; u < 140; ++u) {
            const bool in = u >= 100 && u < 120 && v >= 300 && v < 320;
            const bool by = u >= 96 && u < 124 && v >= 292 && v < 324;
            ASSERT_EQ(bench.mask.at(u, v), in   ? TerrainClass::kObstacle
                                           : by ? TerrainClass::kUnknown
                                                : TerrainClass::kTraversable)
                << u << ' ' << v;
        }
}

TEST(Classifier, NoPixelBeyondTheRangeLimitIsTraversable) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    World world{rig, pose_deg(8.0, 3.0, 1.2), {}};
    test::render(world, 0, kDisparities, {0.25, 0.05, 0.0, 3}, bench.map);
    bench.classify(ground_of(rig, world.pose));
    EXPECT_GT(bench.count(TerrainClass::kTraversable), 50000);
    for (int v = 0; v < rig.height; ++v)
        for (int u = 0; u < rig.width; ++u)
            if (bench.mask.at(u, v) == TerrainClass::kTraversable) {
                EXPECT_LE(60.0 / (bench.map.disparity_q4.at(u, v) / 16.0), bench.range_limit_m + 1e-9);
            }
}

TEST(Classifier, WhatTheGroundIsWorthDecidesWhatMayBeTraversable) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    World world{rig, pose_deg(12.0, 0.0, 1.2), {{4.0, 0.3, 0.8, 0.5, 0.9}}};
    world.ditch_from_m = 2.2;
    world.ditch_to_m = 3.2;
    world.ditch_depth_m = 0.6;
    test::render(world, 0, kDisparities, {0.1, 0.0, 0.0, 3}, bench.map);
    const Ground ground = ground_of(rig, world.pose);
    bench.classify(ground, GroundUse::kOwn);
    const std::vector<TerrainClass> own = bench.pixels();
    const int obstacles = bench.count(TerrainClass::kObstacle);
    const int drops = bench.count(TerrainClass::kDrop);
    EXPECT_GT(bench.count(TerrainClass::kTraversable), 50000);
    EXPECT_GT(obstacles, 1000);
    EXPECT_GT(drops, 1000);

    bench.classify(ground, GroundUse::kHeld);
    EXPECT_EQ(bench.count(TerrainClass::kTraversable), 0);
    EXPECT_EQ(bench.count(TerrainClass::kObstacle), obstacles);
    EXPECT_EQ(bench.count(TerrainClass::kDrop), drops);
    EXPECT_EQ(bench.range_limit_m, 0.0);

    bench.classify(ground, GroundUse::kWeak);
    EXPECT_EQ(bench.pixels(), own);
    bench.surface.flatten(CellSupport::kNone);
    bench.classify(ground, GroundUse::kWeak);
    const std::vector<TerrainClass> weak = bench.pixels();
    for (std::size_t i = 0; i < own.size(); ++i)
        EXPECT_EQ(weak[i], own[i] == TerrainClass::kTraversable ? TerrainClass::kUnknown : own[i]);
    bench.classify(ground, GroundUse::kOwn);
    EXPECT_EQ(bench.pixels(), own);
    bench.surface.flatten(CellSupport::kContradicted);
    for (const GroundUse use : {GroundUse::kOwn, GroundUse::kWeak}) {
        bench.classify(ground, use);
        EXPECT_EQ(bench.count(TerrainClass::kTraversable), 0);
        EXPECT_EQ(bench.count(TerrainClass::kObstacle), obstacles);
        EXPECT_EQ(bench.count(TerrainClass::kDrop), drops);
    }

    bench.classify(ground, GroundUse::kNone);
    EXPECT_EQ(bench.count(TerrainClass::kUnknown), rig.width * rig.height);
    EXPECT_TRUE(bench.obstacles.empty());
    Ground lost = ground;
    lost.found = false;
    bench.classify(lost, GroundUse::kOwn);
    EXPECT_EQ(bench.count(TerrainClass::kUnknown), rig.width * rig.height);
}

TEST(Classifier, InvalidIsUnknownAndRangeEdgeIsAnObstacle) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig, {}, 64);
    const Ground ground = ground_of(rig, pose_deg(12.0, 0.0, 1.2));  // 24 px at the bottom row: in range
    for (int reason = 1; reason < static_cast<int>(Invalid::kCount); ++reason) {
        fill_pixels(bench.map.invalid, static_cast<Invalid>(reason));
        bench.classify(ground);
        const TerrainClass expected = static_cast<Invalid>(reason) == Invalid::kRangeEdge
                                          ? TerrainClass::kObstacle
                                          : TerrainClass::kUnknown;
        EXPECT_EQ(bench.count(expected), rig.width * rig.height) << reason;
    }
    // Where the ground itself would be nearer than the range, range edge tells nothing.
    Bench near(rig, {}, 16);
    fill_pixels(near.map.invalid, Invalid::kRangeEdge);
    near.classify(ground);
    EXPECT_EQ(near.mask.at(320, 479), TerrainClass::kUnknown);
    EXPECT_EQ(near.mask.at(320, 150), TerrainClass::kObstacle);
}

TEST(Classifier, BoxDropAndOverhangAreReportedWhereTheyAre) {
    const RectifiedRig rig = rig_of();
    TerrainConfig config;
    config.clearance_m = 1.5;
    Bench bench(rig, config);
    World world{rig, pose_deg(10.0, 4.0, 1.2), {}};
    world.boxes.push_back({5.0, 1.0, 0.8, 0.6, 0.9});
    world.boxes.push_back({4.0, -1.2, 1.0, 0.5, 2.4, 1.7});  // hangs from 1.7 m
    world.boxes.push_back({7.0, -1.5, 0.6, 0.5, 1.9, 1.2});  // hangs too, but reaches below 1.5 m
    test::render(world, 0, kDisparities, {}, bench.map);
    bench.classify(ground_of(rig, world.pose));
    ASSERT_EQ(bench.obstacles.size(), 3U);
    const Obstacle& box = bench.obstacles[0];
    EXPECT_EQ(box.kind, TerrainClass::kObstacle);
    EXPECT_FALSE(box.overhang);
    // Range along the optical axis of a point at height H, F ahead: F cos(pitch) + (h - H) sin(pitch).
    const double pitch = world.pose.pitch_rad;
    const double nearest = 5.0 * std::cos(pitch) + (1.2 - 0.9) * std::sin(pitch);
    const double farthest = 5.0 * std::cos(pitch) + (1.2 - 0.2) * std::sin(pitch);
    EXPECT_GT(box.range_m, nearest - 0.1);
    EXPECT_LT(box.range_m, farthest + 0.1);
    EXPECT_NEAR(box.range_sigma_m, box.range_m * box.range_m * 0.25 / 60.0, 1e-9);
    EXPECT_NEAR(box.height_m, 0.9, 0.02);
    EXPECT_NEAR(box.lowest_m, 0.2, 0.02);
    EXPECT_NEAR(box.bearing_rad, std::atan2(1.0, 5.0), 0.05);
    EXPECT_NEAR(box.disparity_px, 60.0 / box.range_m, 0.3);
    const Obstacle& low = bench.obstacles[1];
    EXPECT_FALSE(low.overhang);
    EXPECT_NEAR(low.lowest_m, 1.2, 0.03);
    EXPECT_LT(low.bearing_rad, 0.0);
    const Obstacle& hanging = bench.obstacles[2];
    EXPECT_TRUE(hanging.overhang);
    EXPECT_NEAR(hanging.lowest_m, 1.7, 0.03);
    for (int v = hanging.top; v <= hanging.bottom; ++v)
        for (int u = hanging.left; u <= hanging.right; ++u)
            EXPECT_NE(bench.mask.at(u, v), TerrainClass::kTraversable);
    EXPECT_EQ(bench.mask.at((hanging.left + hanging.right) / 2, (hanging.top + hanging.bottom) / 2),
              TerrainClass::kUnknown);

    world.boxes.clear();
    world.ditch_from_m = 2.0;
    world.ditch_to_m = 3.5;
    world.ditch_depth_m = 1.0;
    test::render(world, 0, kDisparities, {}, bench.map);
    bench.classify(ground_of(rig, world.pose));
    ASSERT_EQ(bench.obstacles.size(), 1U);
    EXPECT_EQ(bench.obstacles[0].kind, TerrainClass::kDrop);
    EXPECT_LT(bench.obstacles[0].lowest_m, -0.4);
    EXPECT_EQ(bench.count(TerrainClass::kObstacle), 0);
}

// Pixels of class 2 of a box seen from `pose`, for each height of it.
int flagged(Bench& bench, World world, double top_m) {
    world.boxes[0].top_m = top_m;
    test::render(world, 0, kDisparities, {0.25, 0.05, 0.0, 9}, bench.map);
    bench.classify(ground_of(bench.rig, world.pose));
    return bench.count(TerrainClass::kObstacle);
}

TEST(ClassifierV6, RaisingABoxNeverLowersItsFlaggedPixels) {
    const RectifiedRig rig = rig_of(320, 240, 250.0, 0.24);
    Bench bench(rig);
    for (const double forward : {2.5, 6.0, 11.0}) {
        const World world{rig, pose_deg(12.0, 3.0, 1.2), {{forward, 0.2, 0.8, 0.5, 0.1}}};
        int before = -1;
        int first = 0;
        for (double top = 0.05; top < 3.2; top += 0.15) {
            const int now = flagged(bench, world, top);
            EXPECT_GE(now, before) << forward << " " << top;
            if (before < 0) first = now;
            before = now;
        }
        EXPECT_GT(before, first + 300);
    }
}

TEST(ClassifierV6, RaisingTheToleranceNeverAddsObstacles) {
    const RectifiedRig rig = rig_of(320, 240, 250.0, 0.24);
    Dice dice(5);
    for (int trial = 0; trial < 6; ++trial) {
        World world{rig, pose_deg(dice.between(5, 20), dice.between(-8, 8), 1.2), {}};
        for (int i = 0; i < 3; ++i)
            world.boxes.push_back({dice.between(2, 12), dice.between(-2, 2), dice.between(0.2, 1.0), 0.5,
                                   dice.between(0.1, 1.5)});
        Ground ground = ground_of(rig, world.pose);
        ground.covariance = some_covariance(dice, 1.0);
        std::vector<TerrainClass> before;
        for (const double tolerance : {0.05, 0.1, 0.15, 0.2, 0.3, 0.45, 0.7}) {
            TerrainConfig config;
            config.tolerance_up_m = tolerance;
            Bench bench(rig, config);
            test::render(world, 0, kDisparities, {0.25, 0.05, 0.0, 60U + static_cast<std::uint32_t>(trial)},
                         bench.map);
            bench.classify(ground);
            const std::vector<TerrainClass> now = bench.pixels();
            for (std::size_t i = 0; i < before.size(); ++i)
                if (now[i] == TerrainClass::kObstacle) {
                    EXPECT_EQ(before[i], TerrainClass::kObstacle) << tolerance;
                }
            before = now;
        }
    }
}

// Of the pixels of a box that stand 0.05 m above the tolerance or higher, the share flagged.
double share_flagged(Bench& bench, const World& world) {
    const test::Rays rays(world);
    test::render(world, 0, kDisparities, {}, bench.map);
    bench.classify(ground_of(bench.rig, world.pose));
    int high = 0;
    int found = 0;
    for (int v = 0; v < bench.rig.height; ++v)
        for (int u = 0; u < bench.rig.width; ++u) {
            const test::Hit hit = rays.cast(u, v);
            if (hit.box < 0 || hit.height_m < 0.25) continue;
            ++high;
            found += bench.mask.at(u, v) == TerrainClass::kObstacle ? 1 : 0;
        }
    return high > 0 ? static_cast<double>(found) / high : -1.0;
}

// A height is tolerated or not, at whatever range: this is what the paper's strip, parallel to the ground
// line, cannot do. It is the negative control: the property must fail for it.
TEST(Classifier, WedgeFlagsTheSameHeightAtEveryRangeAndTheStripDoesNot) {
    const RectifiedRig rig = rig_of();
    TerrainConfig strip;
    strip.band = Band::k50Rows;
    Bench wedge_bench(rig);
    Bench strip_bench(rig, strip);
    for (const double forward : {2.5, 5.0, 9.0, 12.0}) {
        const World world{rig, pose_deg(12.0, 0.0, 1.2), {{forward, 0.0, 0.6, 0.4, 0.35}}};
        EXPECT_GT(share_flagged(wedge_bench, world), 0.99) << forward;
    }
    const World near{rig, pose_deg(12.0, 0.0, 1.2), {{2.0, 0.0, 0.6, 0.4, 0.6}}};
    const World far{rig, pose_deg(12.0, 0.0, 1.2), {{9.0, 0.0, 0.6, 0.4, 0.6}}};
    EXPECT_GT(share_flagged(strip_bench, near), 0.5);
    EXPECT_LT(share_flagged(strip_bench, far), 0.05);
}

// Every band is its definition: |d - d_g| against one offset, traversable only below the horizon.
TEST(Classifier, BandsAreStripsOfTheirWidth) {
    const RectifiedRig rig = rig_of(160, 120, 125.0, 0.2);
    const Ground ground = ground_of(rig, pose_deg(15.0, 4.0, 0.6));
    for (const Band band : {Band::k50Rows, Band::k50Px, Band::k50Disparity8}) {
        TerrainConfig config = unfiltered();
        config.band = band;
        Bench bench(rig, config);
        Dice dice(8);
        for (int v = 0; v < rig.height; ++v)
            for (int u = 0; u < rig.width; ++u)
                bench.map.disparity_q4.at(u, v) = static_cast<std::int16_t>(dice.bits() % (95 * 16));
        bench.classify(ground);
        const double width = band == Band::k50Rows ? 50.0 * ground.plane.dv
                             : band == Band::k50Px ? 50.0
                                                   : 50.0 * kDisparities / 256.0;
        for (int v = 0; v < rig.height; ++v)
            for (int u = 0; u < rig.width; ++u) {
                const double d_px = bench.map.disparity_q4.at(u, v) / 16.0;
                const double ground_px = ground.plane.at(u, v);
                const double above = d_px - ground_px;
                if (std::fabs(std::fabs(above) - width) < 1e-6 || d_px <= 0.0) continue;
                const TerrainClass expected = above > width                    ? TerrainClass::kObstacle
                                              : above < -width                 ? TerrainClass::kDrop
                                              : ground_px > 0.0 && d_px >= 1.0 ? TerrainClass::kTraversable
                                                                               : TerrainClass::kUnknown;
                ASSERT_EQ(bench.mask.at(u, v), expected) << static_cast<int>(band) << " " << u << " " << v;
            }
    }
}

TEST(Classifier, IsTheSameForAnyNumberOfLanes) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    World world{rig, pose_deg(12.0, 3.0, 1.2), {{4.0, 0.2, 0.8, 0.5, 0.8}}};
    test::render(world, 0, kDisparities, {0.4, 0.2, 0.2, 3}, bench.map);
    const Ground ground = ground_of(rig, world.pose);
    bench.classify(ground);
    const std::vector<TerrainClass> one = bench.pixels();
    const auto things = bench.obstacles;
    for (const int lanes : {2, 3}) {
        test::Threads threads(lanes);
        bench.classifier.classify(bench.map, ground, GroundUse::kOwn, bench.surface, bench.mask,
                                  bench.obstacles, bench.range_limit_m, threads);
        EXPECT_EQ(bench.pixels(), one);
        ASSERT_EQ(bench.obstacles.size(), things.size());
        for (std::size_t i = 0; i < things.size(); ++i)
            EXPECT_EQ(bench.obstacles[i].range_m, things[i].range_m);
    }
}

TEST(Classifier, SharesAddUpToOne) {
    Arena arena;
    const ImageView<TerrainClass> mask = arena.image<TerrainClass>(50, 10);
    for (int v = 0; v < 10; ++v)
        for (int u = 0; u < 50; ++u)
            mask.at(u, v) = u < 5    ? TerrainClass::kDrop
                            : u < 15 ? TerrainClass::kObstacle
                            : u < 40 ? TerrainClass::kTraversable
                                     : TerrainClass::kUnknown;
    std::array<double, kTerrainClasses> share{};
    shares_of(mask, share);
    EXPECT_DOUBLE_EQ(share[0], 0.2);
    EXPECT_DOUBLE_EQ(share[1], 0.5);
    EXPECT_DOUBLE_EQ(share[2], 0.2);
    EXPECT_DOUBLE_EQ(share[3], 0.1);
}

// The whole stage, on pictures that make it work hardest.
TEST(Terrain, AllocatesNothingPerFrame) {
    const RectifiedRig rig = rig_of();
    Arena arena;
    const TerrainConfig config;
    GroundFinder finder(config, rig, 0, kDisparities, arena);
    Classifier classifier(config, rig, 0, kDisparities, arena);
    SectorFinder sector_finder(config, rig, 0, kDisparities, arena);
    DisparityMap map = DisparityMap::make(arena, rig.width, rig.height);
    VDisparity v_disparity = make_v_disparity(arena, rig.height, 0, kDisparities);
    const ImageView<TerrainClass> mask = arena.image<TerrainClass>(rig.width, rig.height);
    arena.seal();
    FixedVector<Obstacle, kMaxObstacles> obstacles;
    FixedVector<Sector, kMaxSectors> sectors;
    std::array<double, kTerrainClasses> share{};
    double range_limit_m = 0.0;
    Serial serial;
    World world{rig, pose_deg(12.0, 3.0, 1.2), {{4.0, 0.2, 0.8, 0.5, 0.8}}};
    for (int kind = 0; kind < 3; ++kind) {
        test::render(world, 0, kDisparities, {0.3, kind == 1 ? 0.6 : 0.05, 0.1, 3}, map);
        if (kind == 2) fill_pixels(map.invalid, Invalid::kTexture);
        const std::uint64_t before = test::allocations();
        GroundEvidence evidence;
        Ground ground;
        finder.find(map, v_disparity, serial, nullptr, evidence, ground);
        classifier.classify(map, ground, GroundUse::kOwn, finder.surface(), mask, obstacles, range_limit_m,
                            serial);
        sector_finder.find(map, ground, mask, range_limit_m, sectors);
        shares_of(mask, share);
        EXPECT_EQ(test::allocations(), before) << kind;
        EXPECT_EQ(ground.found, kind != 2);
    }
}

// One plane settles between the floors above and below a step of 0.3 m: the lower floor, deeper than the
// tolerance, must not come out traversable because the plane is near it.
TEST(ClassifierStep, FloorBelowAStepIsNotTraversable) {
    const RectifiedRig rig = rig_of();
    for (const double step_m : {3.5, 5.0, 6.0})
        for (const double depth_m : {0.27, 0.30, 0.36}) {
            Bench bench(rig);
            Arena arena;
            GroundFinder finder({}, rig, 0, kDisparities, arena);
            VDisparity v_disparity = make_v_disparity(arena, rig.height, 0, kDisparities);
            World world{rig, pose_deg(10.0, 1.0, 1.2), {}};
            world.ditch_from_m = step_m;
            world.ditch_to_m = 1e6;
            world.ditch_depth_m = depth_m;
            test::render(world, 0, kDisparities, {0.25, 0.03, 0.0, 5}, bench.map);
            Serial serial;
            GroundEvidence evidence;
            Ground ground;
            finder.find(bench.map, v_disparity, serial, nullptr, evidence, ground);
            ASSERT_TRUE(ground.found);
            const test::Rays rays(world);
            for (const GroundUse use : {GroundUse::kOwn, GroundUse::kWeak}) {
                bench.classifier.classify(bench.map, ground, use, finder.surface(), bench.mask,
                                          bench.obstacles, bench.range_limit_m, serial);
                int lower = 0;
                int free = 0;
                for (int v = 0; v < rig.height; ++v)
                    for (int u = 0; u < rig.width; ++u) {
                        if (rays.cast(u, v).height_m > -0.25) continue;
                        ++lower;
                        free += bench.mask.at(u, v) == TerrainClass::kTraversable ? 1 : 0;
                    }
                EXPECT_GT(lower, 20000);
                EXPECT_LT(free, 0.01 * lower) << step_m << " m away, " << depth_m << " m deep, " << free;
            }
        }
}

}  // namespace
}  // namespace groundline::terrain
