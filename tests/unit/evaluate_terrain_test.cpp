// `groundline evaluate --terrain`: its scenes, labels, baseline and bookkeeping against answers made by hand.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "cli/evaluate_command.hpp"
#include "cli/terrain_baseline.hpp"
#include "cli/terrain_judge.hpp"
#include "cli/terrain_run.hpp"
#include "cli/terrain_suite.hpp"
#include "cli/terrain_table.hpp"
#include "core/deterministic_math.hpp"
#include "core/error.hpp"
#include "io/png.hpp"
#include "rig/range.hpp"
#include "synth/renderer.hpp"
#include "unit/evaluate_support.hpp"

namespace groundline::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr auto kUnknown = TerrainClass::kUnknown;
constexpr auto kTraversable = TerrainClass::kTraversable;
constexpr auto kObstacle = TerrainClass::kObstacle;
constexpr auto kDrop = TerrainClass::kDrop;

double ground_disparity_at_the_corners(const synth::Scene& scene) {
    const DisparityPlane plane = plane_of(scene.mount, scene.rig);
    const double bottom = scene.rig.height - 1;
    return std::max(plane.at(0, bottom), plane.at(scene.rig.width - 1, bottom));
}

// --- scenes

TEST(TerrainSuite, DrawsEveryPoseWithinItsLimits) {
    std::set<std::string> scenes;
    std::set<double> pitches;
    std::size_t frames = 0;
    for (const char* name : {"synthetic:", "synthetic:free", "synthetic:ditches"}) {
        for (const SuiteFrame& frame : terrain_suite(name, 30).frames) {
            SCOPED_TRACE(frame.spec);
            scenes.insert(frame.scene);
            ++frames;
            const synth::Scene scene = synth::scene_by_name("synthetic:" + frame.spec);
            pitches.insert(det::degrees(scene.mount.pitch_rad));
            EXPECT_EQ(scene.seed, frame.seed);
            EXPECT_EQ(scene.frames, 1);
            EXPECT_TRUE(scene.rig.width == 640 && scene.rig.height == 480);
            EXPECT_LE(std::abs(det::degrees(scene.mount.roll_rad)), 8.0 + 1e-9);
            EXPECT_GE(det::degrees(scene.mount.pitch_rad), 5.0 - 1e-9);
            EXPECT_LE(det::degrees(scene.mount.pitch_rad), 20.0 + 1e-9);
            EXPECT_GE(scene.mount.height_m, 0.3);
            EXPECT_LE(scene.mount.height_m, 1.2);
            EXPECT_DOUBLE_EQ(scene.rig.baseline_m, scene.mount.height_m < 0.5 ? 0.06 : 0.12);
            // The lowest ground in the picture can be matched.
            EXPECT_LT(ground_disparity_at_the_corners(scene), rig::auto_disparities(640, 0) - 1);
            EXPECT_EQ(frame.picture, Picture::kRendered);
        }
    }
    EXPECT_GE(scenes.size(), 14U + 5U + 1U);
    EXPECT_GT(pitches.size(), frames * 9 / 10) << "each scene and seed has a pose of its own";
    EXPECT_LT(*pitches.begin(), 5.5);
    EXPECT_GT(*pitches.rbegin(), 19.5);
}

TEST(TerrainSuite, IsTheSameEveryTimeWhateverElseIsAsked) {
    const Suite all = terrain_suite("synthetic:", 0);
    EXPECT_EQ(all.study, Study::kScenes);
    const Suite two = terrain_suite("synthetic:rocks,boxes", 3);
    ASSERT_EQ(two.frames.size(), 6U);
    for (const SuiteFrame& frame : two.frames) {
        const auto same = std::find_if(all.frames.begin(), all.frames.end(), [&](const SuiteFrame& each) {
            return each.scene == frame.scene && each.seed == frame.seed;
        });
        ASSERT_NE(same, all.frames.end());
        EXPECT_EQ(same->spec, frame.spec);
    }
    EXPECT_EQ(two.frames[0].scene, "rocks");
    EXPECT_EQ(two.frames[5].scene, "boxes");
    EXPECT_EQ(two.frames[5].seed, 3U);
    EXPECT_EQ(all.frames.size() % 20, 0U);
    EXPECT_EQ(terrain_suite("synthetic:ditches", 0).frames.size(), 200U);
    EXPECT_EQ(terrain_suite("synthetic:free", 0).frames.size(), 1000U);
    EXPECT_EQ(terrain_suite("synthetic:free", 13).frames.size(), 13U) << "seeds of all scenes together";
}

TEST(TerrainSuite, NothingStandsInTheScenesWithoutThings) {
    for (const SuiteFrame& frame : terrain_suite("synthetic:free", 20).frames) {
        const synth::Scene scene = synth::scene_by_name(frame.spec);
        EXPECT_TRUE(scene.things.empty() && !scene.strewn && scene.wall_z_m <= 0.0) << frame.spec;
        EXPECT_TRUE(scene.trenches.empty()) << frame.spec;
    }
}

TEST(TerrainSuite, EveryDitchCanBeSeen) {
    for (const SuiteFrame& frame : terrain_suite("synthetic:ditches", 100).frames) {
        SCOPED_TRACE(frame.spec);
        const synth::Scene scene = synth::scene_by_name(frame.spec);
        ASSERT_EQ(scene.trenches.size(), 1U);
        const synth::Trench& ditch = scene.trenches.front();
        EXPECT_TRUE(detectable_ditch(scene.rig.focal_px, scene.mount.height_m, ditch.near_m,
                                     ditch.far_m - ditch.near_m, ditch.depth_m, 0.20));
        // Straight ahead the lip lies in the picture: nearer ground is at its lower edge.
        const double lowest = det::degrees(scene.mount.pitch_rad) + det::degrees(det::atan(240.0 / 500.0));
        EXPECT_GT(ditch.near_m, scene.mount.height_m / det::tan(det::radians(lowest)));
    }
}

TEST(TerrainSuite, ADitchNeedsSixRowsAndItsDepth) {
    // f = 500, h = 1, R = 2, w = 0.5, tolerance 0.1: 500 (0.5 - 1.1 / 2.5) = 30 rows; depth 0.25.
    EXPECT_TRUE(detectable_ditch(500, 1, 2, 0.5, 0.25, 0.1));
    EXPECT_FALSE(detectable_ditch(500, 1, 2, 0.5, 0.24, 0.1));
    // algorithm.md 4.10: up to 3.4 m for these.
    EXPECT_TRUE(detectable_ditch(500, 1, 3.35, 0.5, 1, 0.1));
    EXPECT_FALSE(detectable_ditch(500, 1, 3.5, 0.5, 1, 0.1));
}

TEST(TerrainSuite, AWallAloneLeavesNoGroundInView) {
    int walls = 0;
    for (const SuiteFrame& frame : terrain_suite("synthetic:never", 4).frames) {
        if (frame.scene != "wall_only" && frame.scene != "sky_only") continue;
        SCOPED_TRACE(frame.spec);
        const synth::Scene scene = synth::scene_by_name(frame.spec);
        Arena arena;
        Serial serial;
        const synth::Truth truth = synth::Truth::make(arena, 640, 480);
        synth::Renderer(scene).render_truth(0, serial, 0.2, truth);
        const bool wall = frame.scene == "wall_only";
        for (int y = 0; y < 480; ++y)
            for (int x = 0; x < 640; ++x) {
                ASSERT_EQ(truth.seen.at(x, y), wall ? 1 : 0) << x << ", " << y;
                const bool on_ground = wall && std::abs(truth.height_m.at(x, y)) < 1e-9;
                ASSERT_FALSE(on_ground) << x << ", " << y;
            }
        walls += wall ? 1 : 0;
    }
    EXPECT_EQ(walls, 4);
}

TEST(TerrainSuite, RefusesAnUnknownSceneByNamingAll) {
    for (const char* name : {"synthetic:box", "synthetic:boxes,,free", "synthetic:free,boxes"}) {
        try {
            terrain_suite(name, 1);
            ADD_FAILURE() << name;
        } catch (const Refusal& refusal) {
            EXPECT_EQ(refusal.status(), ExitStatus::kUsage);
            EXPECT_NE(std::string(refusal.what()).find("waves_10_boxes"), std::string::npos);
        }
    }
}

// --- labels

TEST(TerrainLabels, JudgedRangeIsWhereThreeDeviationsAreTheTolerance) {
    RectifiedRig rig;
    rig.focal_px = 500.0;
    rig.baseline_m = 0.12;
    EXPECT_DOUBLE_EQ(judged_range(rig, 1.0, 0.20), 16.0);  // 500 0.12 0.2 / 0.75
    EXPECT_DOUBLE_EQ(judged_range(rig, 1.0, 0.10), 8.0);
    EXPECT_DOUBLE_EQ(judged_range(rig, 0.5, 0.20), 30.0);
}

TEST(TerrainLabels, FollowTheirRules) {
    RectifiedRig rig;
    rig.calibrated = true;
    rig.focal_px = 500.0;
    rig.baseline_m = 0.12;
    rig.cx_px = 5.0;
    rig.cx_right_px = 7.0;  // measured disparities are 2 px less than f b / Z
    struct {
        TerrainClass is;
        double height_m;
        bool deep, seen, occluded;
        double depth_m;
        TerrainClass label;  // with occluded pixels
    } const cases[] = {
        {kObstacle, 0.25, false, true, false, 9.9, kObstacle},
        {kObstacle, 0.249, false, true, false, 9.9, kUnknown},
        {kObstacle, 2.0, false, true, false, 10.1, kUnknown},  // beyond the range
        {kObstacle, 2.0, false, true, true, 5.0, kObstacle},
        {kObstacle, 2.0, false, false, false, 5.0, kUnknown},  // sky
        {kTraversable, 0.10, false, true, false, 5.0, kTraversable},
        {kTraversable, -0.10, false, true, false, 5.0, kTraversable},
        {kTraversable, 0.11, false, true, false, 5.0, kUnknown},
        {kTraversable, 0.0, false, true, true, 5.0, kTraversable},
        {kDrop, -0.26, true, true, false, 5.0, kDrop},
        {kDrop, -0.22, false, true, false, 5.0, kUnknown},
        {kDrop, -0.26, true, true, true, 5.0, kDrop},
    };
    constexpr int kCases = static_cast<int>(std::size(cases));
    Arena arena;
    const synth::Truth truth = synth::Truth::make(arena, kCases, 1);
    const synth::Truth deep = synth::Truth::make(arena, kCases, 1);
    const Mask seen = arena.image<TerrainClass>(kCases, 1);
    const Mask all = arena.image<TerrainClass>(kCases, 1);
    for (int i = 0; i < kCases; ++i) {
        truth.terrain.at(i, 0) = cases[i].is;
        truth.height_m.at(i, 0) = cases[i].height_m;
        truth.seen.at(i, 0) = cases[i].seen ? 1 : 0;
        truth.occluded.at(i, 0) = cases[i].occluded ? 1 : 0;
        truth.disparity_px.at(i, 0) = 60.0 / cases[i].depth_m - 2.0;
        deep.terrain.at(i, 0) = cases[i].deep ? kDrop : kTraversable;
    }
    label_rendered(truth, &deep, rig, 10.0, seen, all);
    for (int i = 0; i < kCases; ++i) {
        EXPECT_EQ(all.at(i, 0), cases[i].label) << i;
        EXPECT_EQ(seen.at(i, 0), cases[i].occluded ? kUnknown : cases[i].label) << i;
    }
    label_rendered(truth, nullptr, rig, 10.0, seen, all);
    for (int i = 0; i < kCases; ++i)
        EXPECT_EQ(all.at(i, 0), cases[i].is == kDrop ? kUnknown : cases[i].label) << i;
}

// --- sectors and ditches

RectifiedRig vga_rig() {
    return synth::scene_by_name("plane").rig;
}

Sector sector_at(double bearing_deg, double free_m, double width_deg = 2.0) {
    Sector sector;
    sector.bearing_rad = det::radians(bearing_deg);
    sector.width_rad = det::radians(width_deg);
    sector.free_range_m = free_m;
    return sector;
}

TEST(BeyondLip, ComparesWithTheNearestPointOfTheLipInTheSector) {
    const GroundPose pose{det::radians(12.0), 0.0, 1.0};
    const RectifiedRig rig = vga_rig();
    const std::vector<Sector> ends_before = {sector_at(0.0, 2.9), sector_at(0.5, 2.8)};
    EXPECT_NEAR(beyond_lip(ends_before, 3.0, pose, rig), -0.1, 1e-12);
    const std::vector<Sector> aside = {sector_at(20.0, 3.3)};
    EXPECT_NEAR(beyond_lip(aside, 3.0, pose, rig), 3.3 - 3.0 / std::cos(19.0 * det::kPi / 180.0), 1e-12);
    const std::vector<Sector> other_side = {sector_at(-20.0, 3.3)};
    EXPECT_NEAR(beyond_lip(other_side, 3.0, pose, rig), 3.3 - 3.0 / std::cos(19.0 * det::kPi / 180.0), 1e-12);
    EXPECT_DOUBLE_EQ(beyond_lip({}, 3.0, pose, rig), -3.0) << "nothing is called free";
}

TEST(BeyondLip, LeavesOutSectorsWhoseLipIsNotInThePicture) {
    const RectifiedRig rig = vga_rig();
    const GroundPose pose{det::radians(12.0), 0.0, 1.0};
    const std::vector<Sector> ahead = {sector_at(0.0, 9.0)};
    EXPECT_DOUBLE_EQ(beyond_lip(ahead, 1.0, pose, rig), -1.0);  // the picture begins at 1.30 m
    EXPECT_DOUBLE_EQ(beyond_lip(ahead, 1.4, pose, rig), 7.6);
    const std::vector<Sector> beside = {sector_at(40.0, 9.0)};  // the view ends at 32.6 deg
    EXPECT_DOUBLE_EQ(beyond_lip(beside, 3.0, pose, rig), -3.0);
}

// With a rolled camera the lip leaves the picture on one side first: on the one the renderer says.
TEST(BeyondLip, SeesARolledPictureAsTheRendererDoes) {
    for (const double roll_deg : {8.0, -8.0}) {
        char spec[128];
        std::snprintf(spec, sizeof spec,
                      "plane?ditch_m=1.3&ditch_width_m=9&ditch_depth_m=1&roll_deg=%g&pitch_deg=12", roll_deg);
        const synth::Scene scene = synth::scene_by_name(spec);
        Arena arena;
        Serial serial;
        const synth::Truth truth = synth::Truth::make(arena, 640, 480);
        synth::Renderer(scene).render_truth(0, serial, 0.2, truth);
        // Where the lip is in view, the lowest pixel is still ground; the lip is then some rows above.
        const bool left = truth.height_m.at(20, 479) > -0.01 && truth.height_m.at(20, 470) > -0.01;
        const bool right = truth.height_m.at(619, 479) > -0.01 && truth.height_m.at(619, 470) > -0.01;
        ASSERT_NE(left, right) << spec;
        const std::vector<Sector> leftmost = {sector_at(29.0, 9.0)};
        const std::vector<Sector> rightmost = {sector_at(-29.0, 9.0)};
        EXPECT_EQ(beyond_lip(leftmost, 1.3, scene.mount, scene.rig) > 0.0, left) << spec;
        EXPECT_EQ(beyond_lip(rightmost, 1.3, scene.mount, scene.rig) > 0.0, right) << spec;
    }
}

// --- judging

struct Handmade {
    explicit Handmade(std::vector<TerrainClass> label_pixels) : labels(std::move(label_pixels)) {
        truth.seen = truth.all = view(labels);
        truth.rig = vga_rig();
    }
    static ConstMask view(const std::vector<TerrainClass>& row) {
        return {row.data(), static_cast<int>(row.size()), 1, static_cast<std::ptrdiff_t>(row.size())};
    }
    FrameScore score(const std::vector<TerrainClass>& mask) {
        answer.mask = view(mask);
        return judge(truth, answer);
    }
    std::vector<TerrainClass> labels;
    FrameTruth truth;
    FrameAnswer answer;
};

TEST(Judge, CountsFalseObstaclesOnlyWhereNothingStands) {
    Handmade frame({kTraversable, kTraversable});
    frame.truth.range_m = 10.0;
    frame.answer.obstacle_ranges_m = {3.0, 10.0, 10.1, 25.0};
    EXPECT_FALSE(frame.score({kTraversable, kUnknown}).false_obstacles);
    frame.truth.empty = true;
    EXPECT_EQ(*frame.score({kTraversable, kUnknown}).false_obstacles, 2);
}

TEST(Judge, TakesPoseErrorsWithoutSign) {
    Handmade frame({kTraversable});
    frame.truth.pose = GroundPose{0.20, 0.05, 1.0};
    EXPECT_FALSE(frame.score({kUnknown}).pose_error);
    frame.answer.pose = GroundPose{0.19, 0.07, 0.98};
    const FrameScore score = frame.score({kUnknown});
    ASSERT_TRUE(score.pose_error);
    EXPECT_NEAR(score.pose_error->pitch_rad, 0.01, 1e-12);
    EXPECT_NEAR(score.pose_error->roll_rad, 0.02, 1e-12);
    EXPECT_NEAR(score.pose_error->height_m, 0.02, 1e-12);
}

TEST(TerrainPool, AddsPixelsAndKeepsEveryPoseError) {
    TerrainPool pool;
    Handmade frame({kObstacle, kObstacle, kTraversable, kTraversable, kDrop, kUnknown});
    frame.truth.pose = GroundPose{0.0, 0.0, 1.0};
    frame.answer.verdict = Verdict::kTrusted;
    for (const double error_deg : {0.1, 0.5, 0.2}) {
        frame.answer.pose = GroundPose{det::radians(error_deg), 0.0, 1.0 + error_deg};
        pool.add(frame.score({kObstacle, kTraversable, kDrop, kTraversable, kDrop, kObstacle}));
    }
    frame.answer.verdict = Verdict::kBlind;
    frame.answer.pose.reset();
    pool.add(frame.score({kUnknown, kUnknown, kUnknown, kUnknown, kUnknown, kUnknown}));
    EXPECT_EQ(pool.verdicts, (std::array<int, 3>{1, 0, 3}));
    EXPECT_EQ(pool.seen.obstacle, 8);
    EXPECT_EQ(pool.seen.obstacle_found, 3);
    EXPECT_EQ(pool.seen.obstacle_free, 3);
    EXPECT_EQ(pool.seen.ground, 8);
    EXPECT_EQ(pool.seen.ground_alarmed, 3);
    EXPECT_EQ(pool.seen.ground_known, 6);
    EXPECT_EQ(pool.seen.drop_found, 3);
    ASSERT_EQ(pool.pitch_deg.size(), 3U);
    EXPECT_NEAR(*median_of(pool.pitch_deg), 0.2, 1e-12);
    EXPECT_NEAR(*most_of(pool.height_share), 0.5, 1e-12);
    EXPECT_EQ(pool.empty_frames, 0);
}

TEST(TerrainPool, ADitchIsShownWhereAtMostOnePercentOfItIsCalledFree) {
    TerrainPool pool;
    Handmade ditch(std::vector<TerrainClass>(100, kDrop));
    std::vector<TerrainClass> mask(100, kDrop);
    for (const int free : {0, 1, 2}) {
        std::fill(mask.begin(), mask.begin() + free, kTraversable);
        pool.add(ditch.score(mask));
    }
    pool.add(Handmade({kTraversable}).score({kTraversable}));  // no ditch
    EXPECT_EQ(pool.ditches, 3);
    EXPECT_EQ(pool.ditches_shown, 2);
    EXPECT_EQ(pool.ditches_with_sectors, 0);
}

TEST(TerrainPool, AFreeRangeEndsBeforeTheLipInEverySectorOrNot) {
    TerrainPool pool;
    Handmade ditch({kDrop});
    ditch.truth.pose = GroundPose{det::radians(12.0), 0.0, 1.0};
    ditch.truth.ditch_lip_m = 3.0;
    std::vector<Sector> sectors = {sector_at(-5.0, 2.5), sector_at(0.0, 2.95), sector_at(5.0, 2.0)};
    ditch.answer.sectors = sectors;
    pool.add(ditch.score({kDrop}));
    EXPECT_EQ(pool.ditches_before_lip, 1);
    EXPECT_NEAR(pool.most_beyond_lip_m, -0.05, 1e-12);
    sectors[1].free_range_m = 3.25;
    pool.add(ditch.score({kDrop}));
    EXPECT_EQ(pool.ditches_with_sectors, 2);
    EXPECT_EQ(pool.ditches_before_lip, 1);
    EXPECT_NEAR(pool.most_beyond_lip_m, 0.25, 1e-12);
    ditch.answer.sectors.reset();  // who has no sectors is not judged by them
    pool.add(ditch.score({kDrop}));
    EXPECT_EQ(pool.ditches_with_sectors, 2);
}

TEST(TerrainPool, AMedianIsTheMiddle) {
    EXPECT_FALSE(median_of({}));
    EXPECT_FALSE(most_of({}));
    EXPECT_DOUBLE_EQ(*median_of({3.0, 1.0, 2.0}), 2.0);
    EXPECT_DOUBLE_EQ(*median_of({4.0, 1.0, 2.0, 3.0}), 2.5);
    EXPECT_DOUBLE_EQ(*most_of({3.0, 4.0, 1.0}), 4.0);
}

// --- the baseline

// The exact disparities of a scene, as a perfect matcher would store them.
struct PerfectMatch {
    explicit PerfectMatch(const char* spec) : scene(synth::scene_by_name(spec)) {
        Serial serial;
        truth = synth::Truth::make(arena, scene.rig.width, scene.rig.height);
        synth::Renderer(scene).render_truth(0, serial, kTolerance, truth);
        disparity = arena.image<std::uint16_t>(scene.rig.width, scene.rig.height);
        for (int y = 0; y < scene.rig.height; ++y)
            for (int x = 0; x < scene.rig.width; ++x)
                disparity.at(x, y) = static_cast<std::uint16_t>(truth.disparity_px.at(x, y) * 256.0 + 0.5);
    }
    static constexpr double kTolerance = 0.2;
    synth::Scene scene;
    Arena arena;
    synth::Truth truth;
    ImageView<std::uint16_t> disparity;
};

TEST(TerrainBaseline, FindsTheExactPlaneOfExactDisparities) {
    for (const char* spec : {"plane?roll_deg=-7&pitch_deg=9&camera_height_m=0.8", "plane?pitch_deg=18"}) {
        const PerfectMatch match(spec);
        const std::optional<DisparityPlane> plane = ransac_ground(match.disparity, match.scene.rig);
        ASSERT_TRUE(plane) << spec;
        const GroundPose pose = pose_of(*plane, match.scene.rig);
        EXPECT_NEAR(det::degrees(pose.pitch_rad - match.scene.mount.pitch_rad), 0.0, 0.001) << spec;
        EXPECT_NEAR(det::degrees(pose.roll_rad - match.scene.mount.roll_rad), 0.0, 0.001) << spec;
        EXPECT_NEAR(pose.height_m / match.scene.mount.height_m, 1.0, 1e-4) << spec;
    }
}

TEST(TerrainBaseline, ClassifiesExactDisparitiesAsTheRendererDoes) {
    const PerfectMatch match(
        "boxes?roll_deg=-7&pitch_deg=9&camera_height_m=0.8&ditch_m=2.5&ditch_width_m=1.5");
    const RectifiedRig& rig = match.scene.rig;
    // With the true plane only rounding is left: 1/512 px of disparity and what it is in height.
    Arena arena;
    const Mask mask = arena.image<TerrainClass>(rig.width, rig.height);
    classify_by_height(match.disparity, plane_of(match.scene.mount, rig), rig, PerfectMatch::kTolerance,
                       mask);
    std::array<int, kTerrainClasses> count{};
    for (int y = 0; y < rig.height; ++y)
        for (int x = 0; x < rig.width; ++x) {
            const double height = match.truth.height_m.at(x, y);
            ++count[static_cast<std::size_t>(mask.at(x, y))];
            if (match.disparity.at(x, y) == 0) {
                ASSERT_EQ(mask.at(x, y), kUnknown);
            } else if (std::abs(std::abs(height) - PerfectMatch::kTolerance) >
                       0.8 / 256.0 / match.truth.disparity_px.at(x, y)) {
                ASSERT_EQ(mask.at(x, y), match.truth.terrain.at(x, y)) << x << ", " << y << ": " << height;
            }
        }
    for (const int each : count)
        EXPECT_GT(each, 1000);
}

TEST(TerrainBaseline, FindsNoGroundInNoiseAndOnAWall) {
    const PerfectMatch wall("wall?wall_m=1&wall_height_m=50&pitch_deg=0");
    EXPECT_FALSE(ransac_ground(wall.disparity, wall.scene.rig));
    const RectifiedRig rig = vga_rig();
    std::vector<std::uint16_t> noise(640 * 480);
    std::uint32_t state = 1;
    for (std::uint16_t& pixel : noise) {
        state = state * 1664525U + 1013904223U;
        pixel = static_cast<std::uint16_t>(1 + (state >> 16U) % (112 * 256 - 1));
    }
    EXPECT_FALSE(ransac_ground({noise.data(), 640, 480, 640}, rig));
    const std::vector<std::uint16_t> nothing(640 * 480, 0);
    EXPECT_FALSE(ransac_ground({nothing.data(), 640, 480, 640}, rig));
}

TEST(TerrainBaseline, ListsPatchesOfObstaclesByTheirNearestTenth) {
    RectifiedRig rig = vga_rig();
    std::vector<TerrainClass> mask(200 * 100, kTraversable);
    std::vector<std::uint16_t> disparity(200 * 100, 10 * 256);
    const auto fill = [&](int left, int top, int width, int height, int disparity_px) {
        for (int y = top; y < top + height; ++y)
            for (int x = left; x < left + width; ++x) {
                mask[static_cast<std::size_t>(200 * y + x)] = kObstacle;
                disparity[static_cast<std::size_t>(200 * y + x)] =
                    static_cast<std::uint16_t>(256 * disparity_px);
            }
    };
    fill(10, 10, 10, 10, 20);  // 100 px at 3 m ...
    fill(20, 20, 10, 2, 30);   // ... and 20 px at 2 m that touch it by a corner: more than a tenth
    fill(100, 10, 9, 11, 40);  // 99 px are too few
    const std::vector<double> ranges =
        obstacle_ranges(ConstMask(mask.data(), 200, 100, 200), {disparity.data(), 200, 100, 200}, rig);
    ASSERT_EQ(ranges.size(), 1U);
    EXPECT_DOUBLE_EQ(ranges[0], 2.0);
}

TEST(TerrainBaseline, SeesAnEasyScene) {
    const synth::Scene scene = synth::scene_by_name("boxes?width=320&height=240&pitch_deg=10");
    Arena arena;
    Serial serial;
    const Luma left = arena.image<std::uint8_t>(320, 240);
    const Luma right = arena.image<std::uint8_t>(320, 240);
    const Mask mask = arena.image<TerrainClass>(320, 240);
    const synth::Renderer renderer(scene);
    renderer.render(0, serial, left, {}, right);
    TerrainBaseline baseline(scene.rig, 0, 64, 0.2);
    const TerrainBaseline::Answer answer = baseline.run(left, right, mask);
    ASSERT_TRUE(answer.pose);
    EXPECT_NEAR(det::degrees(answer.pose->pitch_rad), 10.0, 0.5);
    EXPECT_NEAR(answer.pose->height_m, 1.0, 0.05);
    EXPECT_GE(answer.obstacle_ranges_m.size(), 1U);

    fill_pixels(left, 0);
    fill_pixels(right, 0);
    EXPECT_FALSE(baseline.run(left, right, mask).pose);
    for (int y = 0; y < 240; ++y)
        for (int x = 0; x < 320; ++x)
            ASSERT_EQ(mask.at(x, y), kUnknown) << "no ground, no classes";
}

// --- runs

JudgedFrame judged(const std::string& spec, Picture picture = Picture::kRendered) {
    JudgedUnit unit = judge_rendered({"scene", 5, spec, picture}, settings::Settings{});
    EXPECT_EQ(unit.frames.size(), 1U);
    EXPECT_TRUE(unit.done && unit.problem.empty());
    return std::move(unit.frames.front());
}

constexpr const char* kSmallBoxes = "boxes?width=320&height=240&seed=5&pitch_deg=10";

TEST(JudgeRendered, LabelsEveryPixelOnceAndShowsBlackToBothMethods) {
    const JudgedFrame boxes = judged(kSmallBoxes);
    EXPECT_DOUBLE_EQ(boxes.range_m, 8.0);  // f is 250 at this width
    EXPECT_GT(boxes.scores[0].seen.obstacle, 0);
    EXPECT_GT(boxes.scores[0].all.ground, boxes.scores[0].seen.ground) << "some ground is occluded";
    EXPECT_FALSE(boxes.scores[0].false_obstacles) << "something stands there";
    EXPECT_TRUE(boxes.scores[0].pose_error);
    const JudgedFrame black = judged(kSmallBoxes, Picture::kBlack);
    for (std::size_t method = 0; method < kTerrainMethods; ++method) {
        SCOPED_TRACE(method);
        EXPECT_EQ(black.scores[method].seen.obstacle, boxes.scores[method].seen.obstacle);
        EXPECT_EQ(black.scores[method].seen.obstacle_found, 0);
        EXPECT_EQ(black.scores[method].seen.ground_known, 0);
        EXPECT_EQ(black.scores[method].verdict, Verdict::kBlind);
        EXPECT_FALSE(black.scores[method].pose_error);
    }
}

TEST(JudgeRendered, EveryPictureDiffersFromTheRenderedPair) {
    const JudgedFrame plain = judged(kSmallBoxes);
    for (const Picture picture : {Picture::kWhite, Picture::kNoise, Picture::kLeftTwice, Picture::kSwapped}) {
        const JudgedFrame other = judged(kSmallBoxes, picture);
        EXPECT_NE(other.scores[1].seen.ground_known, plain.scores[1].seen.ground_known)
            << static_cast<int>(picture);
    }
}

TEST(JudgeRendered, FrozenPicturesComeFromALiveSource) {
    EXPECT_TRUE(judged(kSmallBoxes, Picture::kFrozen).scores[0].reasons.has(Reason::kFrozen));
    EXPECT_FALSE(judged(kSmallBoxes).scores[0].reasons.has(Reason::kFrozen));
}

class TerrainTable : public CommandTest {
  protected:
    TerrainTable() {
        std::string pattern = testing::TempDir() + "terrain-XXXXXX";
        suite_ = ::mkdtemp(pattern.data());
    }
    ~TerrainTable() override { fs::remove_all(suite_); }

    int run(const TerrainTableOptions& options) {
        return kept([&] { return run_terrain_table(options); });
    }

    // A rendered pair as a folder with truth.
    void write_set(const std::string& name, const std::string& spec, bool calibrated = true) const {
        const synth::Scene scene = synth::scene_by_name(spec);
        const int width = scene.rig.width;
        const int height = scene.rig.height;
        Arena arena;
        Serial serial;
        const synth::Renderer renderer(scene);
        const Luma left = arena.image<std::uint8_t>(width, height);
        const Luma right = arena.image<std::uint8_t>(width, height);
        renderer.render(0, serial, left, {}, right);
        const synth::Truth truth = synth::Truth::make(arena, width, height);
        renderer.render_truth(0, serial, 0.2, truth);
        const auto disparity = arena.image<std::uint16_t>(width, height);
        const auto heights = arena.image<std::uint16_t>(width, height);
        const Luma classes = arena.image<std::uint8_t>(width, height);
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                disparity.at(x, y) = static_cast<std::uint16_t>(truth.disparity_px.at(x, y) * 256.0 + 0.5);
                heights.at(x, y) = static_cast<std::uint16_t>(truth.height_m.at(x, y) * 1000.0 + 32768.5);
                classes.at(x, y) = static_cast<std::uint8_t>(truth.terrain.at(x, y));
            }
        fs::create_directories(suite_ / name);
        io::write_png(suite_ / name / "left.png", left);
        io::write_png(suite_ / name / "right.png", right);
        io::write_png(suite_ / name / "disp.png", ConstImageView<std::uint16_t>(disparity));
        io::write_png(suite_ / name / "height.png", ConstImageView<std::uint16_t>(heights));
        io::write_png(suite_ / name / "class.png", classes);
        if (!calibrated) return;
        std::ofstream(suite_ / name / "calib.txt")
            << "P0: " << scene.rig.focal_px << " 0 " << scene.rig.cx_px << " 0 0 " << scene.rig.focal_px
            << " " << scene.rig.cy_px << " 0 0 0 1 0\nP1: " << scene.rig.focal_px << " 0 " << scene.rig.cx_px
            << " " << -scene.rig.focal_px * scene.rig.baseline_m << " 0 " << scene.rig.focal_px << " "
            << scene.rig.cy_px << " 0 0 0 1 0\n";
    }

    fs::path suite_;
};

TEST_F(TerrainTable, IsTheSameForAnyNumberOfThreads) {
    TerrainTableOptions options;
    options.suite = "synthetic:plane,wall";
    options.seeds = 2;
    options.json = true;
    options.threads = 1;
    ASSERT_EQ(run(options), 0) << sentence_ << err_;
    json one = json::parse(out_);
    ASSERT_EQ(one["times_ms"].size(), 3U);  // two scenes and all
    options.threads = 2;
    ASSERT_EQ(run(options), 0) << sentence_ << err_;
    json two = json::parse(out_);
    one.erase("times_ms");
    two.erase("times_ms");
    EXPECT_EQ(one.dump(), two.dump());

    // Frames in their order; each can be run again by its spec.
    ASSERT_EQ(one["frames"].size(), 4U);
    const json& last = one["frames"][3];
    EXPECT_EQ(last["set"], "wall");
    EXPECT_EQ(last["seed"], 2);
    const JudgedFrame again = judged(last["spec"].get<std::string>());
    EXPECT_EQ(last["groundline"]["pixels"]["obstacle_found"], again.scores[0].seen.obstacle_found);
    EXPECT_EQ(last["baseline"]["pixels"]["ground_flagged"], again.scores[1].seen.ground_alarmed);
    // Pools add up.
    const auto ground = [&](const json& row) { return row["baseline"]["pixels"]["ground"].get<int>(); };
    EXPECT_EQ(ground(one["rows"][0]) + ground(one["rows"][1]), ground(one["all"]));
    EXPECT_EQ(one["rows"][0]["groundline"]["frames_without_things"], 2);
    EXPECT_TRUE(one["rows"][1]["groundline"]["false_obstacles"].is_null());
    EXPECT_TRUE(one["groups"].empty());
}

TEST_F(TerrainTable, JudgesFoldersAsTheyAreLabelled) {
    write_set("road_a", "boxes?width=320&height=240&boxes=5");
    write_set("road_b", "boxes?width=320&height=240&boxes=5&seed=2&box_height_m=1");
    write_set("yard_a", "boxes?width=320&height=240", false);
    TerrainTableOptions options;
    options.suite = suite_;
    options.json = true;
    ASSERT_EQ(run(options), 0) << sentence_ << err_;
    const json table = json::parse(out_);
    ASSERT_EQ(table["rows"].size(), 2U);
    EXPECT_EQ(table["groups"].size(), 1U);
    EXPECT_EQ(table["groups"][0]["name"], "road");
    EXPECT_EQ(table["left_out"][0]["name"], "yard_a");
    EXPECT_NE(err_.find("yard_a: no calibration"), std::string::npos) << err_;

    // The rule of folders: higher than 0.30 m, within 30 m. Boxes of 1 m have many such pixels.
    const synth::Scene scene =
        synth::scene_by_name("boxes?width=320&height=240&boxes=5&seed=2&box_height_m=1");
    Arena arena;
    Serial serial;
    const synth::Truth truth = synth::Truth::make(arena, 320, 240);
    synth::Renderer(scene).render_truth(0, serial, 0.2, truth);
    int high = 0;
    for (int y = 0; y < 240; ++y)
        for (int x = 0; x < 320; ++x)
            high += truth.terrain.at(x, y) == kObstacle && std::lround(truth.height_m.at(x, y) * 1000.0) > 300
                        ? 1
                        : 0;
    const json& second = table["rows"][1]["groundline"];
    EXPECT_EQ(second["pixels_with_occluded"]["obstacle"], high);
    EXPECT_LT(second["pixels"]["ground"], second["pixels_with_occluded"]["ground"]);
    EXPECT_TRUE(second["pitch_deg_median"].is_null()) << "no truth.json, no true pose";

    options.sets = {"road_b"};
    options.json = false;
    ASSERT_EQ(run(options), 0) << sentence_ << err_;
    for (const char* part : {"set     ", "road_b  groundline", "        baseline", "road    groundline",
                             "all     groundline", "obstacles above 0.3 m", "MODE_SGBM_3WAY", "500 draws",
                             "Time a frame, medians: groundline matching "})
        EXPECT_NE(out_.find(part), std::string::npos) << part << " is not in:\n" << out_;
    EXPECT_EQ(out_.find("road_a"), std::string::npos);
}

TEST_F(TerrainTable, ConfigurationReachesBothMethods) {
    write_set("a", "boxes?width=320&height=240&box_height_m=0.6");
    TerrainTableOptions options;
    options.suite = suite_;
    options.json = true;
    ASSERT_EQ(run(options), 0) << sentence_ << err_;
    const json usual = json::parse(out_);
    options.set = {"terrain.tolerance_m=0.5"};
    ASSERT_EQ(run(options), 0) << sentence_ << err_;
    const json high = json::parse(out_);
    for (const char* method : {"groundline", "baseline"})
        EXPECT_LT(high["all"][method]["obstacle_recall"], usual["all"][method]["obstacle_recall"]) << method;
    options.set = {"mount.body_mask=0,200 319,200 319,239 0,239"};
    ASSERT_EQ(run(options), 0) << sentence_ << err_;
    const json body = json::parse(out_);
    EXPECT_LT(body["all"]["groundline"]["ground_known"], usual["all"]["groundline"]["ground_known"]);
    EXPECT_EQ(body["all"]["baseline"], usual["all"]["baseline"]) << "which has no such mask";
    options.set = {"terrain.tolerance=0.5"};
    EXPECT_EQ(run(options), 78);
}

TEST_F(TerrainTable, WhatCannotBeReadIsSaidAndDecidesTheStatus) {
    write_set("a_good", "boxes?width=320&height=240");
    write_set("b_broken", "boxes?width=320&height=240");
    fs::resize_file(suite_ / "b_broken/disp.png", 40);
    TerrainTableOptions options;
    options.suite = suite_;
    options.json = true;
    EXPECT_EQ(run(options), 66);
    EXPECT_EQ(json::parse(out_)["rows"].size(), 1U);
    EXPECT_NE(err_.find("b_broken: "), std::string::npos) << err_;
    fs::remove(suite_ / "b_broken/right.png");
    EXPECT_EQ(run(options), 66);
    EXPECT_EQ(json::parse(out_)["left_out"][0]["name"], "b_broken");
    options.sets = {"c"};
    EXPECT_EQ(run(options), 66);
}

TEST_F(TerrainTable, PicturesThatMustNotBeTrustedAreListedByVerdictAndReasons) {
    TerrainTableOptions options;
    options.suite = "synthetic:never";
    options.seeds = 1;
    ASSERT_EQ(run(options), 0) << sentence_ << err_;
    for (const char* part :
         {"scene       frames  verdict", "wall_only   1 ", "black       1       blind", "frozen      1 "})
        EXPECT_NE(out_.find(part), std::string::npos) << part << " is not in:\n" << out_;
    EXPECT_NE(out_.find(" of 8 frames"), std::string::npos) << out_;
    EXPECT_NE(out_.find(" dark"), std::string::npos) << out_;
}

TEST_F(TerrainTable, IsAskedForByOptionsThatGoTogether) {
    const auto parse = [](const std::vector<std::string>& words, EvaluateOptions& options) {
        CLI::App app;
        add_evaluate_options(app, options);
        std::vector<std::string> reversed(words.rbegin(), words.rend());
        app.parse(reversed);
    };
    EvaluateOptions options;
    parse({"--suite", "synthetic:boxes", "--terrain", "--seeds", "3", "--threads", "2", "--set",
           "terrain.tolerance_m=0.1"},
          options);
    EXPECT_TRUE(options.terrain);
    EXPECT_EQ(options.seeds, 3);
    EXPECT_EQ(options.threads, 2);
    EXPECT_EQ(options.set.size(), 1U);
    for (const std::vector<std::string>& words :
         std::vector<std::vector<std::string>>{{"--terrain"},
                                               {"truth", "out", "--terrain"},
                                               {"--suite", "d", "--terrain", "--matchers"},
                                               {"--suite", "synthetic:"},
                                               {"--suite", "d", "--terrain", "--seeds", "3"},
                                               {"--suite", "d", "--threads", "2"},
                                               {"--suite", "synthetic:", "--terrain", "--seeds", "0"}}) {
        EvaluateOptions refused;
        EXPECT_THROW(parse(words, refused), CLI::ParseError) << words.back();
    }
    TerrainTableOptions with_sets;
    with_sets.suite = "synthetic:boxes";
    with_sets.sets = {"a"};
    EXPECT_EQ(run(with_sets), 2);
}

}  // namespace
}  // namespace groundline::cli
