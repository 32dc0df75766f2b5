// Every figure of an evaluation against counts made by hand.
#include "cli/evaluation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <random>
#include <vector>

#include "core/deterministic_math.hpp"

namespace groundline::cli {
namespace {

template <typename T>
struct Picture {
    int width;
    int height;
    std::vector<T> pixels;
    Picture(int w, int h, T value = {})
        : width(w), height(h), pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), value) {}
    Picture(std::initializer_list<T> row) : width(static_cast<int>(row.size())), height(1), pixels(row) {}
    ImageView<T> view() { return {pixels.data(), width, height, width}; }
    T& at(int x, int y) { return view().at(x, y); }
};
using Disparities = Picture<std::uint16_t>;
using Bytes = Picture<std::uint8_t>;
using Classes = Picture<TerrainClass>;

constexpr auto kUnknown = TerrainClass::kUnknown;
constexpr auto kTraversable = TerrainClass::kTraversable;
constexpr auto kObstacle = TerrainClass::kObstacle;
constexpr auto kDrop = TerrainClass::kDrop;

RectifiedRig test_rig() {
    RectifiedRig rig;
    rig.width = 320;
    rig.height = 240;
    rig.calibrated = true;
    rig.focal_px = 300.0;
    rig.cx_px = 158.0;
    rig.cy_px = 121.0;
    rig.cx_right_px = 163.0;  // an offset of -5 px
    rig.baseline_m = 0.2;
    return rig;
}

GroundPose pose_deg(double pitch, double roll, double height) {
    return {det::radians(pitch), det::radians(roll), height};
}

std::uint16_t stored(double disparity_px) {
    return static_cast<std::uint16_t>(disparity_px * 256.0 + 0.5);
}

TEST(DisparityScore, CountsByHand) {
    //                    no truth, exact, 1 px off, more, 3 px off, more, absent, occluded, sky answered
    Disparities truth{0, 1000, 1000, 1000, 1000, 1000, 1000, 1000, 0};
    Disparities result{500, 1000, 1256, 743, 1768, 1769, 0, 9000, 700};
    Bytes occluded{0, 0, 0, 0, 0, 0, 0, 255, 0};
    DisparityScore score;
    score_disparity(truth.view(), result.view(), occluded.view(), score);
    EXPECT_EQ(score.occluded, 1);
    EXPECT_EQ(score.scored, 6);
    EXPECT_EQ(score.answered, 5);
    EXPECT_EQ(score.bad1, 3);  // 257, 768 and 769 of 256
    EXPECT_EQ(score.bad3, 1);  // 769
    EXPECT_EQ(score.error_q8, 0 + 256 + 257 + 768 + 769);

    score_disparity(truth.view(), result.view(), {}, score);  // adds up; now the occluded one counts
    EXPECT_EQ(score.occluded, 1);
    EXPECT_EQ(score.scored, 13);
    EXPECT_EQ(score.answered, 11);
    EXPECT_EQ(score.bad1, 7);
    EXPECT_EQ(score.bad3, 3);
    EXPECT_EQ(score.error_q8, 2 * 2050 + 8000);
}

TEST(Occlusion, IsWhatTheForegroundHidesAndWhatLeavesTheView) {
    // Background at 1 px; columns 8 .. 11 at 4 px land on right columns 4 .. 7 and hide 5, 6 and 7.
    Disparities truth(16, 2, 256);
    for (int x = 8; x < 12; ++x)
        truth.at(x, 1) = 4 * 256;
    truth.at(15, 0) = 0;
    Bytes occluded(16, 2, 9);
    mark_occluded(truth.view(), occluded.view());
    for (int x = 0; x < 16; ++x) {
        EXPECT_EQ(occluded.at(x, 0), x == 0 ? 255 : 0) << x;
        EXPECT_EQ(occluded.at(x, 1), x == 0 || (x >= 5 && x <= 7) ? 255 : 0) << x;
    }
}

TEST(Occlusion, ASlantedSurfaceDoesNotHideItself) {
    for (const double slope : {0.1, 0.45, -0.3, -0.9}) {
        Disparities truth(64, 1);
        for (int x = 0; x < 64; ++x)
            truth.at(x, 0) = stored((slope > 0 ? 2.0 : 60.0) + slope * x);
        Bytes occluded(64, 1);
        mark_occluded(truth.view(), occluded.view());
        for (int x = 0; x < 64; ++x)
            EXPECT_EQ(occluded.at(x, 0) != 0, 256 * x < truth.at(x, 0))
                << "slope " << slope << " column " << x;
    }
}

// Columns 8 .. 14 lean away: neighbours land 1.3 px apart in the right image and hide what lies between, too.
TEST(Occlusion, ALeaningSurfaceHidesWithoutGaps) {
    Disparities truth(18, 1, 256);
    for (int x = 8; x < 15; ++x)
        truth.at(x, 0) = stored(6.0 - 0.3 * (x - 8));
    Bytes occluded(18, 1);
    mark_occluded(truth.view(), occluded.view());
    for (int x = 0; x < 18; ++x)
        EXPECT_EQ(occluded.at(x, 0), x == 0 || (x >= 3 && x <= 7) ? 255 : 0) << x;
}

TEST(Labels, FromClassesAndHeights) {
    //                 sky,   ground, kerb,  box,   foot,  ditch, edge of it, an id of no meaning
    Bytes classes{0, 1, 1, 2, 2, 3, 3, 7};
    Disparities heights{32768,       32768 + 99,  32768 + 100, 32768 + 301,
                        32768 + 300, 32768 - 301, 32768 - 300, 32768};
    Classes labels(8, 1, kDrop);
    label_by_class(classes.view(), heights.view(), labels.view());
    EXPECT_EQ(labels.pixels,
              (std::vector{kUnknown, kTraversable, kUnknown, kObstacle, kUnknown, kDrop, kDrop, kUnknown}));
    label_by_class(classes.view(), {}, labels.view());
    EXPECT_EQ(labels.pixels, (std::vector{kUnknown, kTraversable, kTraversable, kObstacle, kObstacle, kDrop,
                                          kDrop, kUnknown}));
    label_by_height(heights.view(), labels.view());
    EXPECT_EQ(labels.pixels, (std::vector{kTraversable, kTraversable, kUnknown, kObstacle, kUnknown, kDrop,
                                          kUnknown, kTraversable}));
}

TEST(Labels, ADropOfTheSceneIsOneHoweverShallow) {
    Bytes classes{3, 3, 3, 3, 3, 0};
    Disparities heights{32768 - 200, 32768 - 250, 32768 - 300, 32768 - 1500, 0, 32768 - 1500};
    Classes labels(6, 1, kObstacle);
    label_by_class(classes.view(), heights.view(), labels.view());
    EXPECT_EQ(labels.pixels, (std::vector{kDrop, kDrop, kDrop, kDrop, kDrop, kUnknown}));
}

TEST(Labels, FromDisparities) {
    const RectifiedRig rig = test_rig();
    const DisparityPlane plane = plane_of(pose_deg(8.0, 3.0, 1.2), rig);
    const struct {
        int x, y;
        double height_m;
        TerrainClass label;
    } cases[] = {
        {40, 200, 0.05, kTraversable}, {90, 230, -0.05, kTraversable}, {160, 220, 0.20, kUnknown},
        {200, 210, 0.35, kObstacle},   {300, 239, -0.5, kUnknown},     {20, 150, 0.31, kObstacle},
    };
    Disparities truth(320, 240);
    for (const auto& each : cases) {
        const double ground = plane.at(each.x, each.y) - rig.offset_px();
        truth.at(each.x, each.y) = stored(ground * 1.2 / (1.2 - each.height_m) + rig.offset_px());
    }
    truth.at(10, 10) = 1;  // above the horizon everything is high; a true disparity of 5 px is 12 m away
    Classes labels(320, 240, kDrop);
    label_by_disparity(truth.view(), plane, rig, labels.view());
    EXPECT_EQ(labels.at(10, 10), kObstacle);
    for (const auto& each : cases)
        EXPECT_EQ(labels.at(each.x, each.y), each.label) << each.height_m;
    EXPECT_EQ(labels.at(0, 0), kUnknown);
    EXPECT_EQ(std::count(labels.pixels.begin(), labels.pixels.end(), kUnknown), 320 * 240 - 5);
}

TEST(Labels, EndAtThirtyMetres) {
    RectifiedRig rig = test_rig();
    rig.cx_right_px = 153.0;  // an offset of +5 px: measured 7 px are 30 m
    Disparities truth{stored(7.01), stored(6.99), 0};
    Classes labels{kObstacle, kObstacle, kTraversable};
    limit_range(truth.view(), rig, labels.view());
    EXPECT_EQ(labels.pixels, (std::vector{kObstacle, kUnknown, kUnknown}));
}

TEST(TerrainScore, CountsEveryPairing) {
    // Label l and mask m together occur 1 + 4 l + m times: each count below can come from one pairing only.
    std::vector<TerrainClass> label_row;
    std::vector<TerrainClass> mask_row;
    for (int l = 0; l < 4; ++l) {
        for (int m = 0; m < 4; ++m) {
            label_row.insert(label_row.end(), static_cast<std::size_t>(1 + 4 * l + m),
                             static_cast<TerrainClass>(l));
            mask_row.insert(mask_row.end(), static_cast<std::size_t>(1 + 4 * l + m),
                            static_cast<TerrainClass>(m));
        }
    }
    const int width = static_cast<int>(label_row.size());
    TerrainScore score;
    score_terrain({label_row.data(), width, 1, width}, {mask_row.data(), width, 1, width}, score);
    EXPECT_EQ(score.ground, 5 + 6 + 7 + 8);
    EXPECT_EQ(score.ground_known, 6 + 7 + 8);
    EXPECT_EQ(score.ground_alarmed, 7 + 8);
    EXPECT_EQ(score.obstacle, 9 + 10 + 11 + 12);
    EXPECT_EQ(score.obstacle_free, 10);
    EXPECT_EQ(score.obstacle_found, 11);
    EXPECT_EQ(score.drop, 13 + 14 + 15 + 16);
    EXPECT_EQ(score.drop_free, 14);
    EXPECT_EQ(score.drop_found, 16);
}

TEST(PoseScore, MeanAndLargest) {
    PoseScore score;
    score_pose(pose_deg(5.0, -1.0, 1.10), pose_deg(4.0, 1.0, 1.0), score);
    score_pose(pose_deg(4.0, 1.5, 0.95), pose_deg(4.5, 1.0, 1.0), score);
    EXPECT_EQ(score.frames, 2);
    EXPECT_NEAR(det::degrees(score.sum.pitch_rad), 1.5, 1e-12);
    EXPECT_NEAR(det::degrees(score.most.pitch_rad), 1.0, 1e-12);
    EXPECT_NEAR(det::degrees(score.sum.roll_rad), 2.5, 1e-12);
    EXPECT_NEAR(det::degrees(score.most.roll_rad), 2.0, 1e-12);
    EXPECT_NEAR(score.sum.height_m, 0.15, 1e-12);
    EXPECT_NEAR(score.most.height_m, 0.10, 1e-12);
}

// Ground where the plane has a positive true disparity; `other` may put something else there.
template <typename Other>
Disparities scene(const GroundPose& pose, const RectifiedRig& rig, Other other) {
    const DisparityPlane plane = plane_of(pose, rig);
    Disparities truth(rig.width, rig.height);
    for (int y = 0; y < rig.height; ++y) {
        for (int x = 0; x < rig.width; ++x) {
            const double disparity = other(x, y, plane.at(x, y));
            truth.at(x, y) =
                disparity > 0.0 && disparity - rig.offset_px() > 0.0 ? stored(disparity) : std::uint16_t{0};
        }
    }
    return truth;
}

void expect_pose(const std::optional<DisparityPlane>& plane, const GroundPose& pose, const RectifiedRig& rig,
                 double angle_deg, double height_share) {
    ASSERT_TRUE(plane.has_value());
    const GroundPose found = pose_of(*plane, rig);
    EXPECT_NEAR(det::degrees(found.pitch_rad), det::degrees(pose.pitch_rad), angle_deg);
    EXPECT_NEAR(det::degrees(found.roll_rad), det::degrees(pose.roll_rad), angle_deg);
    EXPECT_NEAR(found.height_m / pose.height_m, 1.0, height_share);
}

TEST(FitGround, ExactPlane) {
    const RectifiedRig rig = test_rig();
    for (const GroundPose& pose :
         {pose_deg(0.0, 0.0, 1.65), pose_deg(14.0, -4.0, 0.5), pose_deg(30.0, 8.0, 2.0)}) {
        Disparities truth = scene(pose, rig, [](int, int, double ground) { return ground; });
        expect_pose(fit_ground(truth.view(), rig), pose, rig, 0.005, 0.0005);  // stored in 1/256 px
    }
}

TEST(FitGround, UnderNoiseObstaclesAndOutliers) {
    const RectifiedRig rig = test_rig();
    const GroundPose pose = pose_deg(6.0, 2.0, 1.0);
    std::mt19937 random(7);
    const auto uniform = [&] { return static_cast<double>(random()) / 4294967296.0; };
    Disparities truth = scene(pose, rig, [&](int x, int y, double ground) {
        const double noise = 0.5 * (uniform() + uniform() + uniform() + uniform() - 2.0);  // sigma 0.29 px
        if (uniform() < 0.05) return 40.0 * uniform();
        if (x > 60 && x < 140 && y > 60 && y < 200) return 22.0 + noise;   // a box
        if (x > 200 && x < 290 && y > 20 && y < 170) return 14.0 + noise;  // and a wall
        return ground + noise;
    });
    expect_pose(fit_ground(truth.view(), rig), pose, rig, 0.15, 0.01);
}

// A table fills more of the picture than the floor, but floor is seen below it: the floor is the ground.
TEST(FitGround, TakesTheLowerOfTwoPlanes) {
    const RectifiedRig rig = test_rig();
    const GroundPose floor = pose_deg(15.0, 0.0, 1.4);
    const DisparityPlane table = plane_of(pose_deg(15.0, 0.0, 0.7), rig);
    Disparities truth =
        scene(floor, rig, [&](int x, int y, double ground) { return x < 185 ? table.at(x, y) : ground; });
    expect_pose(fit_ground(truth.view(), rig), floor, rig, 0.01, 0.001);
}

TEST(FitGround, FindsNoneWhereThereIsNone) {
    const RectifiedRig rig = test_rig();
    Disparities nothing(rig.width, rig.height);
    EXPECT_FALSE(fit_ground(nothing.view(), rig));
    Disparities wall(rig.width, rig.height, stored(12.0));
    EXPECT_FALSE(fit_ground(wall.view(), rig));
    Disparities ceiling =
        scene(pose_deg(6.0, 0.0, 1.0), rig, [](int, int y, double) { return 20.0 - 0.1 * y; });
    EXPECT_FALSE(fit_ground(ceiling.view(), rig));
    std::mt19937 random(3);
    Disparities noise(rig.width, rig.height);
    for (std::uint16_t& pixel : noise.pixels)
        pixel = static_cast<std::uint16_t>(1 + random() % (60 * 256));
    EXPECT_FALSE(fit_ground(noise.view(), rig));
    // A tenth of what is seen lies on a plane, the rest is clutter above it.
    Disparities clutter = scene(pose_deg(6.0, 0.0, 1.0), rig, [&](int, int, double ground) {
        return ground + (random() % 10 == 0 ? 0.0 : 4.0 + static_cast<double>(random() % 40));
    });
    EXPECT_FALSE(fit_ground(clutter.view(), rig));
}

}  // namespace
}  // namespace groundline::cli
