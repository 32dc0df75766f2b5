#include <gtest/gtest.h>

#include <cmath>

#include "core/error.hpp"
#include "terrain/ground_finder.hpp"
#include "terrain/v_disparity.hpp"
#include "unit/terrain_scene.hpp"

namespace groundline::terrain {
namespace {

using test::Box;
using test::Dice;
using test::Noise;
using test::pose_deg;
using test::rig_of;
using test::World;

constexpr int kDisparities = 96;

struct Found {
    GroundEvidence evidence;
    Ground ground;
    bool flat = true;
    double rise_at_10_px = 0.0;
};

class Bench {
  public:
    explicit Bench(const RectifiedRig& rig, const TerrainConfig& config = {}, int disparities = kDisparities)
        : finder_(config, rig, 0, disparities, arena_),
          map(DisparityMap::make(arena_, rig.width, rig.height)),
          v_disparity(make_v_disparity(arena_, rig.height, 0, disparities)),
          disparities_(disparities) {
        arena_.seal();
    }
    Found find(const GroundPose* prior = nullptr) {
        Serial serial;
        return find(serial, prior);
    }
    Found find(Parallel& parallel, const GroundPose* prior = nullptr) {
        Found found;
        finder_.find(map, v_disparity, parallel, prior, found.evidence, found.ground);
        found.flat = finder_.surface().flat();
        found.rise_at_10_px = finder_.surface().rise(160);
        return found;
    }
    Found find(const World& world, const Noise& noise = {}) {
        test::render(world, 0, disparities_, noise, map);
        return find();
    }

  private:
    Arena arena_;
    GroundFinder finder_;

  public:
    DisparityMap map;
    VDisparity v_disparity;

  private:
    int disparities_;
};

double pitch_error_deg(const Found& found, const World& world) {
    return std::fabs(det::degrees(found.ground.pose.pitch_rad - world.pose.pitch_rad));
}
double roll_error_deg(const Found& found, const World& world) {
    return std::fabs(det::degrees(found.ground.pose.roll_rad - world.pose.roll_rad));
}
double height_error(const Found& found, const World& world) {
    return std::fabs(found.ground.pose.height_m / world.pose.height_m - 1.0);
}

// Boxes on the ground that all lie in view and do not hide most of it.
std::vector<Box> random_boxes(Dice& dice, int count) {
    std::vector<Box> boxes;
    for (int i = 0; i < count; ++i) {
        const double forward = dice.between(3.0, 9.0);
        boxes.push_back({forward, dice.between(-0.4, 0.4) * forward, dice.between(0.3, 1.0),
                         dice.between(0.3, 1.0), dice.between(0.3, 1.7)});
    }
    return boxes;
}

// Planes whose disparity is a whole number of sixteenths at every pixel: nothing is lost to rounding, so the
// fit must be exact.
TEST(GroundV1, PlaneExactInSixteenthsIsRecoveredExactly) {
    const RectifiedRig rig = rig_of(320, 240, 250.0, 0.12);
    for (const int across : {0, 1, -1}) {
        Bench bench(rig, {}, 192);
        DisparityPlane plane{across / 16.0, 8 / 16.0, 0.0};  // roll 0 and about 7.1 deg either way
        plane.d0 = std::floor(16.0 * (30.0 - plane.at(rig.cx_px, rig.cy_px))) / 16.0;
        const GroundPose truth = pose_of(plane, rig);
        for (int v = 0; v < rig.height; ++v)
            for (int u = 0; u < rig.width; ++u) {
                const double d_px = plane.at(u, v);
                const bool seen = d_px >= 0.0 && d_px <= 191.0;
                bench.map.disparity_q4.at(u, v) = static_cast<std::int16_t>(seen ? 16.0 * d_px : 0.0);
                bench.map.invalid.at(u, v) = seen ? Invalid::kNone : Invalid::kBorder;
            }
        const Found found = bench.find();
        ASSERT_TRUE(found.ground.found) << across;
        EXPECT_NEAR(found.ground.plane.du, plane.du, 1e-10);
        EXPECT_NEAR(found.ground.plane.dv, plane.dv, 1e-10);
        EXPECT_NEAR(found.ground.plane.d0, plane.d0, 1e-8);
        EXPECT_NEAR(found.ground.pose.pitch_rad, truth.pitch_rad, det::radians(0.001));
        EXPECT_NEAR(found.ground.pose.roll_rad, truth.roll_rad, det::radians(0.001));
        EXPECT_NEAR(found.ground.pose.height_m, truth.height_m, 1e-4 * truth.height_m);
        EXPECT_GT(found.evidence.inlier_share, 0.99);
        EXPECT_GT(found.evidence.line_run_share, 0.95);
        EXPECT_LT(found.evidence.residual_rms_px, 1e-6);
    }
}

// Any pose, disparities rounded to sixteenths. Without roll a whole row shares its rounding error (0.018 px
// rms), which 240 rows average to 0.0012 px: 0.002 deg of pitch at the horizon, 0.008 % of height.
TEST(GroundV1, AnyPoseIsRecoveredToWhatRoundingAllows) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    for (const double roll : {0.0, 2.0, -4.0, 8.0, -8.0})
        for (const double pitch : {0.0, 12.0, 30.0}) {
            World world{rig, pose_deg(pitch, roll, 1.2), {}};
            const Found found = bench.find(world);
            ASSERT_TRUE(found.ground.found) << roll << " " << pitch;
            EXPECT_LT(pitch_error_deg(found, world), 0.004) << roll << " " << pitch;
            EXPECT_LT(roll_error_deg(found, world), 0.004) << roll << " " << pitch;
            EXPECT_LT(height_error(found, world), 2e-4) << roll << " " << pitch;
            EXPECT_TRUE(found.evidence.line_found && found.evidence.inside_gate && !found.evidence.wall);
        }
}

TEST(GroundV1, PrincipalPointOffsetChangesNothing) {
    for (const double offset : {11.3, -31.1}) {  // -31.1 px: a Middlebury pair
        RectifiedRig rig = rig_of(640, 480, 500.0, 0.2);
        rig.cx_right_px = rig.cx_px - offset;
        Bench bench(rig, {}, 128);
        World world{rig, pose_deg(22.0, 3.0, 1.2), {{3.0, 0.3, 0.6, 0.5, 0.8}}};
        test::render(world, 0, 128, {0.25, 0.3, 0.3, 5}, bench.map);
        const Found found = bench.find();
        ASSERT_TRUE(found.ground.found) << offset;
        EXPECT_LT(pitch_error_deg(found, world), 0.05) << offset;
        EXPECT_LT(height_error(found, world), 2e-3) << offset;
    }
}

TEST(GroundV2, NoiseOutliersBoxesAndRollLeaveThePoseWithinItsBounds) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    Dice dice(2024);
    double worst_pitch = 0.0;
    double worst_roll = 0.0;
    double worst_height = 0.0;
    for (int trial = 0; trial < 40; ++trial) {
        World world{
            rig, pose_deg(dice.between(5.0, 20.0), dice.between(-8.0, 8.0), dice.between(0.9, 1.6)), {}};
        world.boxes = random_boxes(dice, trial % 4);
        const Found found = bench.find(world, {0.25, 0.05, 0.0, 100U + static_cast<std::uint32_t>(trial)});
        ASSERT_TRUE(found.ground.found) << trial;
        worst_pitch = std::max(worst_pitch, pitch_error_deg(found, world));
        worst_roll = std::max(worst_roll, roll_error_deg(found, world));
        worst_height = std::max(worst_height, height_error(found, world));
        EXPECT_LT(found.evidence.second_peak_ratio, 0.85) << trial;
    }
    EXPECT_LE(worst_pitch, 0.25);
    EXPECT_LE(worst_roll, 0.1);
    EXPECT_LE(worst_height, 0.01);
    RecordProperty("worst_pitch_deg", std::to_string(worst_pitch));
    RecordProperty("worst_roll_deg", std::to_string(worst_roll));
    RecordProperty("worst_height_percent", std::to_string(100.0 * worst_height));
}

TEST(GroundV3, PoseDoesNotDependOnWhereBoxesStand) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    Dice dice(77);
    World world{rig, pose_deg(12.0, 0.0, 1.2), {}};
    const test::Rays plain(world);
    int largest_share = 0;
    for (int trial = 0; trial < 25; ++trial) {
        world.boxes.clear();
        for (int i = 0; i < 4; ++i) {
            const double forward = dice.between(2.2, 5.0);
            world.boxes.push_back({forward, dice.between(-0.5, 0.5) * forward, dice.between(0.5, 1.5), 0.5,
                                   dice.between(0.3, 1.7)});
        }
        const test::Rays rays(world);
        int ground = 0;
        int hidden = 0;
        for (int v = 0; v < rig.height; v += 8)
            for (int u = 0; u < rig.width; u += 8) {
                if (plain.cast(u, v).depth_m <= 0.0) continue;
                ++ground;
                hidden += rays.cast(u, v).box >= 0 ? 1 : 0;
            }
        if (hidden * 100 > 40 * ground) continue;
        largest_share = std::max(largest_share, hidden * 100 / ground);
        const Found found = bench.find(world, {0.25, 0.05, 0.0, 500U + static_cast<std::uint32_t>(trial)});
        ASSERT_TRUE(found.ground.found) << trial;
        EXPECT_LT(pitch_error_deg(found, world), 0.25) << trial;
        EXPECT_LT(roll_error_deg(found, world), 0.15) << trial;
        EXPECT_LT(height_error(found, world), 0.01) << trial;
    }
    EXPECT_GT(largest_share, 33);  // the trials do hide a good part of the ground
}

TEST(GroundFinder, AShortGapDoesNotBreakTheRunOfTheLine) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    const World world{rig, pose_deg(12.0, 0.0, 1.0), {}};
    test::render(world, 0, 96, {0.25, 0.05, 0.0, 9}, bench.map);
    const double whole = bench.find().evidence.line_run_share;
    for (int v = 300; v < 305; ++v)
        for (int u = 0; u < rig.width; ++u) {
            bench.map.disparity_q4.at(u, v) = 0;
            bench.map.invalid.at(u, v) = Invalid::kTexture;
        }
    const Found found = bench.find();
    ASSERT_TRUE(found.ground.found);
    EXPECT_EQ(found.evidence.line_run_share, whole);
}

void expect_no_ground(const Found& found) {
    EXPECT_FALSE(found.ground.found);
    EXPECT_FALSE(found.ground.metric);
    EXPECT_TRUE(found.flat);
    for (const double value : found.ground.covariance)
        EXPECT_EQ(value, 0.0);
}

TEST(GroundV4, WallIsNeverAGround) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    std::uint32_t seed = 1;
    for (const double distance : {0.8, 1.5, 3.0, 8.0, 20.0})
        for (const double pitch : {0.0, 12.0, 35.0}) {
            World world{rig, pose_deg(pitch, 3.0, 1.2), {}};
            world.ground = false;
            world.wall_m = distance;
            const Found found = bench.find(world, {0.25, 0.05, 0.1, seed++});
            expect_no_ground(found);
            EXPECT_TRUE(found.evidence.wall) << distance << " " << pitch;
        }
}

// A wall before the robot with a strip of floor at its foot: the strongest thing is upright. Farther away the
// floor is the stronger and must be found as it is.
TEST(GroundV4, WallThatFillsTheViewHidesTheGroundAndAFarOneDoesNot) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    for (const double distance : {1.9, 2.1, 2.3}) {
        World world{rig, pose_deg(12.0, 0.0, 1.2), {}};
        world.wall_m = distance;
        const Found found = bench.find(world, {0.25, 0.05, 0.1, 7});
        expect_no_ground(found);
        EXPECT_TRUE(found.evidence.wall) << distance;
    }
    for (const double distance : {5.0, 8.0, 20.0}) {
        World world{rig, pose_deg(12.0, 0.0, 1.2), {}};
        world.wall_m = distance;
        const Found found = bench.find(world, {0.25, 0.05, 0.1, 7});
        ASSERT_TRUE(found.ground.found) << distance;
        EXPECT_FALSE(found.evidence.wall);
        EXPECT_LT(pitch_error_deg(found, world), 0.25) << distance;
    }
}

TEST(GroundV4, WallSeenAtAnAngleIsNeverAGround) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    Dice dice(3);
    for (const double across : {0.02, -0.05, 0.12, 0.3}) {  // px of disparity per column
        for (int v = 0; v < rig.height; ++v)
            for (int u = 0; u < rig.width; ++u) {
                const double d_px = 40.0 + across * (u - 320) + 0.25 * dice.normal();
                const bool seen = d_px >= 0.0 && d_px <= 95.0;
                bench.map.disparity_q4.at(u, v) =
                    static_cast<std::int16_t>(seen ? std::floor(16.0 * d_px + 0.5) : 0.0);
                bench.map.invalid.at(u, v) = seen ? Invalid::kNone : Invalid::kCost;
            }
        const Found found = bench.find();
        expect_no_ground(found);
    }
}

TEST(GroundV4, SkyBlackAndNoiseAreNeverAGround) {
    const RectifiedRig rig = rig_of();
    for (const int disparities : {16, 64, 128}) {
        Bench bench(rig, {}, disparities);
        for (int v = 0; v < rig.height; ++v)
            for (int u = 0; u < rig.width; ++u) {
                bench.map.disparity_q4.at(u, v) = static_cast<std::int16_t>((u * 7 + v * 3) % 9);
                bench.map.invalid.at(u, v) = Invalid::kNone;
            }
        Found found = bench.find();  // sky: all within half a pixel of nothing
        expect_no_ground(found);

        fill_pixels(bench.map.invalid, Invalid::kTexture);
        fill_pixels(bench.map.disparity_q4, 0);
        found = bench.find();  // black: no pixel has an answer
        expect_no_ground(found);
        EXPECT_FALSE(found.evidence.line_found);
        EXPECT_EQ(found.evidence.density, 0.0);
        EXPECT_EQ(found.evidence.blocked_share, 1.0);

        for (std::uint32_t seed = 1; seed <= 8; ++seed) {
            Dice dice(seed);
            fill_pixels(bench.map.invalid, Invalid::kNone);
            for (int v = 0; v < rig.height; ++v)
                for (int u = 0; u < rig.width; ++u)
                    bench.map.disparity_q4.at(u, v) = static_cast<std::int16_t>(
                        dice.bits() % static_cast<std::uint32_t>(16 * disparities - 15));
            found = bench.find();
            expect_no_ground(found);
            EXPECT_FALSE(found.evidence.line_found) << disparities << " " << seed;
        }
    }
}

// Noise as a matcher leaves it, in patches that agree within themselves, is no ground either.
TEST(GroundV4, PatchyNoiseIsNeverAGround) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    for (std::uint32_t seed = 1; seed <= 12; ++seed)
        for (const int side : {8, 24}) {
            Dice dice(seed);
            std::vector<int> patch(static_cast<std::size_t>(rig.width / side + 1));
            for (int v = 0; v < rig.height; ++v) {
                if (v % side == 0)
                    for (int& value : patch)
                        value = static_cast<int>(dice.bits() % (16 * 90));
                for (int u = 0; u < rig.width; ++u) {
                    bench.map.invalid.at(u, v) = Invalid::kNone;
                    bench.map.disparity_q4.at(u, v) = static_cast<std::int16_t>(
                        patch[static_cast<std::size_t>(u / side)] + static_cast<int>(dice.bits() % 9));
                }
            }
            expect_no_ground(bench.find());
        }
}

// A weak matcher: most answers wrong, a third missing, whole disparities only.
TEST(GroundFinder, FindsGroundUnderAWeakMatcher) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    Dice dice(11);
    for (int trial = 0; trial < 10; ++trial) {
        World world{rig, pose_deg(dice.between(5.0, 20.0), dice.between(-11.0, 11.0), 1.3), {}};
        world.boxes = random_boxes(dice, 2);
        test::render(world, 0, kDisparities, {0.6, 0.5, 0.35, 900U + static_cast<std::uint32_t>(trial)},
                     bench.map);
        for (int v = 0; v < rig.height; ++v)
            for (int u = 0; u < rig.width; ++u)
                bench.map.disparity_q4.at(u, v) =
                    static_cast<std::int16_t>((bench.map.disparity_q4.at(u, v) + 8) / 16 * 16);
        const Found found = bench.find();
        ASSERT_TRUE(found.ground.found) << trial;
        EXPECT_LT(pitch_error_deg(found, world), 0.5) << trial;
        EXPECT_LT(roll_error_deg(found, world), 0.5) << trial;
        EXPECT_LT(height_error(found, world), 0.02) << trial;
    }
}

// Little ground, much wall, a leaning robot and views whose principal points differ: the first guess must be
// right, since there is a stronger plane to slide to.
TEST(GroundFinder, FindsLittleGroundBelowAWallWithRollAndOffset) {
    RectifiedRig rig = rig_of(640, 480, 500.0, 0.2);
    rig.cx_right_px = rig.cx_px + 31.0;
    Bench bench(rig, {}, 128);
    int found_frames = 0;
    for (const double roll : {-11.0, -7.0, 7.0, 11.0})
        for (const double distance : {3.0, 3.5, 4.0}) {
            World world{rig, pose_deg(12.0, roll, 1.2), {}};
            world.wall_m = distance;
            test::render(world, 0, 128, {0.3, 0.15, 0.2, 5}, bench.map);
            const Found found = bench.find();
            if (!found.ground.found) continue;
            ++found_frames;
            EXPECT_LT(pitch_error_deg(found, world), 0.5) << roll << " " << distance;
            EXPECT_LT(roll_error_deg(found, world), 0.5) << roll << " " << distance;
            EXPECT_LT(height_error(found, world), 0.02) << roll << " " << distance;
        }
    EXPECT_GE(found_frames, 8);
}

// Half the floor raised by 0.4 m: two grounds as good as each other. A flat floor has no rival, nor has a
// floor with boxes.
TEST(GroundFinder, SecondGroundIsSeenAsARival) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    World world{rig, pose_deg(14.0, 0.0, 1.2), {}};
    EXPECT_LT(bench.find(world, {0.25, 0.05, 0.0, 3}).evidence.second_peak_ratio, 0.2);
    world.boxes.push_back({4.0, 0.5, 0.6, 0.6, 0.8});
    EXPECT_LT(bench.find(world, {0.25, 0.05, 0.0, 3}).evidence.second_peak_ratio, 0.3);
    world.boxes = {{0.5, 10.0, 20.0, 60.0, 0.4}};  // everything to the left
    EXPECT_GT(bench.find(world, {0.25, 0.05, 0.0, 3}).evidence.second_peak_ratio, 0.6);
}

// A road view: over 1240 px a roll of 10 deg moves the ground by 36 px either way, far beyond the fit's
// reach. A verge beside the road, 0.15 m high, must not tilt it.
TEST(GroundFinder, FindsARoadInAWideViewWithRollAndVerge) {
    RectifiedRig rig = rig_of(1240, 376, 720.0, 0.54);
    Bench bench(rig, {}, 128);
    std::uint32_t seed = 1;
    for (const double roll : {-11.0, -8.0, -3.0, 0.0, 3.0, 8.0, 11.0})
        for (const bool verge : {false, true}) {
            World world{rig, pose_deg(2.0, roll, 1.65), {{12.0, 1.0, 1.8, 4.0, 1.5}}};
            if (verge) world.boxes.push_back({2.0, 6.5, 7.0, 60.0, 0.15});
            const Found found = bench.find(world, {0.5, 0.3, 0.2, seed++});
            ASSERT_TRUE(found.ground.found) << roll << " " << verge;
            EXPECT_LT(pitch_error_deg(found, world), 0.25) << roll << " " << verge;
            EXPECT_LT(roll_error_deg(found, world), 0.5) << roll << " " << verge;
            EXPECT_LT(height_error(found, world), 0.03) << roll << " " << verge;
        }
}

// Half resolution: f and d halve, the pose stays.
TEST(GroundG6, HalfResolutionGivesTheSamePose) {
    const RectifiedRig rig = rig_of();
    RectifiedRig half = rig_of(320, 240, 250.0, 0.12);
    half.cx_px = half.cx_right_px = (rig.cx_px - 0.5) / 2.0;
    half.cy_px = (rig.cy_px - 0.5) / 2.0;
    World world{rig, pose_deg(14.0, 5.0, 1.1), {{4.0, 0.5, 0.6, 0.6, 0.8}}};
    World half_world = world;
    half_world.rig = half;
    Bench bench(rig);
    Bench half_bench(half, {}, kDisparities / 2);
    const Found one = bench.find(world);
    const Found other = half_bench.find(half_world);
    ASSERT_TRUE(one.ground.found && other.ground.found);
    EXPECT_LT(pitch_error_deg(other, world), 0.02);
    EXPECT_LT(roll_error_deg(other, world), 0.02);
    EXPECT_LT(height_error(other, world), 2e-3);
    EXPECT_NEAR(other.ground.plane.dv, one.ground.plane.dv, 1e-3);
}

// The sigmas must cover the errors they speak of: neighbouring pixels with a common error must not make the
// fit look surer than it is. Errors shared by patches of 8 x 8 px, 30 frames.
TEST(GroundFinder, SigmasCoverTheErrorsOfCorrelatedNoise) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    int within_two = 0;
    double sum_squares = 0.0;
    constexpr int kTrials = 30;
    for (int trial = 0; trial < kTrials; ++trial) {
        World world{rig, pose_deg(12.0, 1.0, 1.2), {}};
        test::render(world, 0, kDisparities, {}, bench.map);
        Dice dice(40U + static_cast<std::uint32_t>(trial));
        std::vector<double> patch(81);
        for (int v = 0; v < rig.height; ++v) {
            if (v % 8 == 0)
                for (double& value : patch)
                    value = 0.35 * dice.normal();
            for (int u = 0; u < rig.width; ++u) {
                if (bench.map.invalid.at(u, v) != Invalid::kNone) continue;
                const int d_q4 =
                    bench.map.disparity_q4.at(u, v) +
                    static_cast<int>(std::floor(16.0 * patch[static_cast<std::size_t>(u / 8)] + 0.5));
                bench.map.disparity_q4.at(u, v) = static_cast<std::int16_t>(std::max(0, d_q4));
            }
        }
        const Found found = bench.find();
        ASSERT_TRUE(found.ground.found);
        const double error = found.ground.pose.height_m - 1.2;
        const double score = error / found.ground.sigma.height_m;
        within_two += std::fabs(score) <= 2.0 ? 1 : 0;
        sum_squares += score * score;
        EXPECT_LT(found.ground.sigma.height_m, 0.02);
    }
    EXPECT_GE(within_two, kTrials - 3);
    EXPECT_LT(sum_squares / kTrials, 2.0);
}

// Matching windows make errors that grow down the picture; nothing in one frame tells them from a pose.
TEST(GroundFinder, SigmasCoverAnErrorThatGrowsDownThePicture) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    const World world{rig, pose_deg(12.0, 1.0, 1.2), {}};
    for (const double border_px : {-0.1, 0.1}) {
        test::render(world, 0, kDisparities, {0.25, 0.0, 0.0, 7}, bench.map);
        for (int v = 0; v < rig.height; ++v)
            for (int u = 0; u < rig.width; ++u) {
                const double error_px = border_px * (v / rig.cy_px - 1.0);
                auto& d_q4 = bench.map.disparity_q4.at(u, v);
                d_q4 = static_cast<std::int16_t>(std::max(0.0, std::floor(d_q4 + 16.0 * error_px + 0.5)));
            }
        const Found found = bench.find();
        ASSERT_TRUE(found.ground.found);
        EXPECT_LT(std::fabs(found.ground.pose.height_m - 1.2), 2.0 * found.ground.sigma.height_m);
        EXPECT_LT(std::fabs(found.ground.pose.pitch_rad - world.pose.pitch_rad),
                  2.0 * found.ground.sigma.pitch_rad);
    }
}

TEST(GroundFinder, LongestSegmentModeFindsTheGroundToo) {
    const RectifiedRig rig = rig_of();
    TerrainConfig config;
    config.line = LineMode::kLongest;
    Bench bench(rig, config);
    World world{rig, pose_deg(12.0, 0.0, 1.2), {{4.0, 0.8, 0.6, 0.6, 0.8}}};
    const Found found = bench.find(world, {0.25, 0.05, 0.0, 4});
    ASSERT_TRUE(found.ground.found);
    EXPECT_LT(pitch_error_deg(found, world), 0.25);
    EXPECT_LT(height_error(found, world), 0.01);
}

TEST(GroundFinder, WithoutCalibrationGivesThePlaneAndNoMetres) {
    const RectifiedRig rig = rig_of();
    RectifiedRig unknown;
    unknown.width = rig.width;
    unknown.height = rig.height;
    Bench bench(unknown);
    for (const double roll : {0.0, 5.0}) {
        World world{rig, pose_deg(12.0, roll, 1.2), {{4.0, 0.5, 0.6, 0.6, 0.8}}};
        const Found found = bench.find(world, {0.25, 0.05, 0.0, 8});
        ASSERT_TRUE(found.ground.found) << roll;
        EXPECT_FALSE(found.ground.metric);
        EXPECT_EQ(found.ground.pose.height_m, 0.0);
        const DisparityPlane truth = plane_of(world.pose, rig);
        for (const double v : {250.0, 470.0})
            EXPECT_NEAR(found.ground.plane.at(320, v), truth.at(320, v), 0.3);
    }
}

TEST(GroundFinder, PoseOutsideTheGateIsNotFound) {
    const RectifiedRig rig = rig_of();
    TerrainConfig config;
    config.gate = gate_of_mount(0.8, 12.0, 0.0);  // the ground is at 1.2 m
    Bench bench(rig, config);
    World world{rig, pose_deg(12.0, 0.0, 1.2), {}};
    expect_no_ground(bench.find(world, {0.25, 0.05, 0.0, 8}));
    TerrainConfig fitting;
    fitting.gate = gate_of_mount(1.1, 10.0, 0.0);
    Bench other(rig, fitting);
    EXPECT_TRUE(other.find(world, {0.25, 0.05, 0.0, 8}).ground.found);
}

TEST(GroundFinder, PriorNarrowsTheGate) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    World world{rig, pose_deg(12.0, 2.0, 1.2), {}};
    test::render(world, 0, kDisparities, {0.25, 0.05, 0.0, 8}, bench.map);
    const GroundPose near = pose_deg(10.0, 0.0, 1.3);
    const GroundPose far = pose_deg(25.0, 0.0, 1.2);
    const Found with_near = bench.find(&near);
    ASSERT_TRUE(with_near.ground.found);
    EXPECT_LT(pitch_error_deg(with_near, world), 0.1);
    EXPECT_FALSE(bench.find(&far).ground.found);
}

TEST(GroundFinder, TheRunOfTheLineEndsWhereNoGroundIsSeen) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    World world{rig, pose_deg(12.0, 0.0, 1.2), {}};
    test::render(world, 0, kDisparities, {0.25, 0.05, 0.0, 8}, bench.map);
    Dice dice(6);
    for (int v = 300; v < 360; ++v)
        for (int u = 0; u < rig.width; ++u) {
            // Rows without an answer, and rows that answer anything.
            bench.map.invalid.at(u, v) = v < 330 ? Invalid::kTexture : Invalid::kNone;
            bench.map.disparity_q4.at(u, v) = static_cast<std::int16_t>(dice.bits() % (95 * 16));
        }
    const Found found = bench.find();
    ASSERT_TRUE(found.ground.found);
    EXPECT_LT(found.evidence.line_run_share, 0.7);
}

TEST(GroundFinder, IsTheSameForAnyNumberOfLanes) {
    const RectifiedRig rig = rig_of();
    Bench bench(rig);
    World world{rig, pose_deg(12.0, 4.0, 1.2), {{4.0, 0.5, 0.6, 0.6, 0.8}}};
    test::render(world, 0, kDisparities, {0.4, 0.2, 0.2, 8}, bench.map);
    const Found one = bench.find();
    ASSERT_TRUE(one.ground.found);
    for (const int lanes : {2, 3}) {
        test::Threads threads(lanes);
        const Found other = bench.find(threads);
        EXPECT_EQ(one.ground.plane.du, other.ground.plane.du);
        EXPECT_EQ(one.ground.plane.dv, other.ground.plane.dv);
        EXPECT_EQ(one.ground.plane.d0, other.ground.plane.d0);
        EXPECT_EQ(one.ground.covariance, other.ground.covariance);
        EXPECT_EQ(one.flat, other.flat);
        EXPECT_EQ(one.rise_at_10_px, other.rise_at_10_px);
        EXPECT_EQ(one.evidence.residual_rms_px, other.evidence.residual_rms_px);
        EXPECT_EQ(one.evidence.row_residual_px, other.evidence.row_residual_px);
        EXPECT_EQ(one.evidence.second_peak_ratio, other.evidence.second_peak_ratio);
    }
}

TEST(GroundFinder, RefusesWhatCannotBe) {
    Arena arena;
    TerrainConfig config;
    EXPECT_THROW(GroundFinder(config, rig_of(16, 16), 0, 64, arena), Refusal);
    EXPECT_THROW(GroundFinder(config, rig_of(), 0, 1, arena), Refusal);
    config.gate.height_max_m = 0.1;
    EXPECT_THROW(GroundFinder(config, rig_of(), 0, 64, arena), Refusal);
}

}  // namespace
}  // namespace groundline::terrain
