// The truth of rendered scenes against formulas that do not know the renderer.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "core/deterministic_math.hpp"
#include "core/ground.hpp"
#include "unit/synth_support.hpp"

namespace groundline::synth {
namespace {

using test::Studio;

// A number from low to high; std::mt19937's raw output is the same everywhere, its distributions are not.
double between(std::mt19937& random, double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967295.0);
}

Scene random_pose(std::string_view spec, std::mt19937& random) {
    Scene scene = scene_by_name(spec);
    scene.mount = {det::radians(between(random, -5.0, 30.0)), det::radians(between(random, -12.0, 12.0)),
                   between(random, 0.3, 2.0)};
    return scene;
}

// World point of a left pixel with true disparity d: pinhole model and the ground axes of GroundPose.
struct Point {
    double x, y, z;
};
Point world_point(const Scene& scene, double u, double v, double disparity, std::int64_t frame = 0) {
    const RectifiedRig& rig = scene.rig;
    const CameraPose camera = camera_at(scene, frame);
    const double depth = rig.focal_px * rig.baseline_m / disparity;
    const double px = depth * (u - rig.cx_px) / rig.focal_px;
    const double py = depth * (v - rig.cy_px) / rig.focal_px;
    const double sp = std::sin(camera.pose.pitch_rad), cp = std::cos(camera.pose.pitch_rad);
    const double sr = std::sin(camera.pose.roll_rad), cr = std::cos(camera.pose.roll_rad);
    return {cr * px - sr * py, sr * cp * px + cr * cp * py + sp * depth - camera.pose.height_m,
            -sp * sr * px - sp * cr * py + cp * depth + camera.forward_m};
}

// Calls check(u, v, disparity, height) for every pixel that shows a surface nearer than 60 m.
template <typename Check>
int each_near_pixel(const Studio& studio, Check check) {
    const RectifiedRig& rig = studio.rig();
    const double least = rig.focal_px * rig.baseline_m / 60.0;
    int count = 0;
    for (int v = 0; v < rig.height; ++v)
        for (int u = 0; u < rig.width; ++u)
            if (studio.truth.seen.at(u, v) != 0 && studio.truth.disparity_px.at(u, v) > least) {
                ++count;
                check(u, v, studio.truth.disparity_px.at(u, v), studio.truth.height_m.at(u, v));
            }
    return count;
}

TEST(SynthGeometry, PlaneHasTheDisparityOfItsPose) {
    std::mt19937 random(1);
    for (int trial = 0; trial < 20; ++trial) {
        Scene scene = random_pose("plane?width=160&height=120", random);
        if (trial % 2 == 1) scene.rig.cx_right_px -= 7.25;  // as Middlebury's doffs
        Studio studio(scene);
        studio.look();
        const DisparityPlane plane = plane_of(scene.mount, scene.rig);
        int ground = 0;
        for (int v = 0; v < 120; ++v)
            for (int u = 0; u < 160; ++u) {
                const double expected = plane.at(u, v);
                const bool below_horizon = expected - scene.rig.offset_px() > 1e-9;
                ASSERT_EQ(studio.truth.seen.at(u, v), below_horizon ? 1 : 0) << u << ' ' << v;
                ASSERT_EQ(studio.truth.terrain.at(u, v),
                          below_horizon ? TerrainClass::kTraversable : TerrainClass::kUnknown);
                ASSERT_NEAR(studio.truth.disparity_px.at(u, v), below_horizon ? expected : 0.0, 1e-9);
                ground += below_horizon ? 1 : 0;
            }
        EXPECT_GT(ground, 1000);
        const GroundPose pose = pose_of(studio.renderer.plane(0), scene.rig);
        EXPECT_NEAR(pose.pitch_rad, scene.mount.pitch_rad, 1e-12);
        EXPECT_NEAR(pose.roll_rad, scene.mount.roll_rad, 1e-12);
        EXPECT_NEAR(pose.height_m, scene.mount.height_m, 1e-12);
    }
}

TEST(SynthGeometry, HeightIsTheHeightAboveTheGroundPlane) {
    std::mt19937 random(2);
    for (const char* spec :
         {"clutter?width=160&height=120", "ditch?width=160&height=120",
          "undulating?width=160&height=120&undulation_m=0.07", "drive?width=160&height=120"})
        for (int trial = 0; trial < 5; ++trial) {
            Studio studio(random_pose(spec, random));
            studio.look(trial);
            const CameraPose camera = camera_at(studio.renderer.scene(), trial);
            const DisparityPlane plane = plane_of(camera.pose, studio.rig());
            const int seen = each_near_pixel(studio, [&](int u, int v, double disparity, double height) {
                ASSERT_NEAR(height_above_ground(camera.pose.height_m, plane.at(u, v), disparity), height,
                            1e-9)
                    << spec << ' ' << u << ' ' << v;
            });
            EXPECT_GT(seen, 3000) << spec;
        }
}

TEST(SynthGeometry, BoxTopsHaveTheirHeight) {
    std::mt19937 random(3);
    for (int trial = 0; trial < 10; ++trial) {
        Scene scene = random_pose("boxes?width=160&height=120&box_height_m=0.25", random);
        scene.mount.pitch_rad = det::radians(between(random, 8.0, 30.0));
        scene.mount.height_m = between(random, 0.8, 2.0);
        Studio studio(scene);
        studio.look();
        int on_top = 0;
        each_near_pixel(studio, [&](int, int, double, double height) {
            EXPECT_LE(height, 0.25 + 1e-9);
            on_top += std::abs(height - 0.25) < 1e-9 ? 1 : 0;
        });
        EXPECT_GT(on_top, 10) << "trial " << trial;
    }
}

TEST(SynthGeometry, SurfacesObeyTheirEquations) {
    Scene scene = scene_by_name("plane?width=320&height=240&roll_deg=6");
    scene.things = {{Shape::kBox, -0.8, 3.0, 0.4, 0.3, 0.2, 0.5, {}},
                    {Shape::kPole, 0.1, 2.8, 0.0, 0.08, 0.08, 1.2, {}},
                    {Shape::kRock, 0.9, 3.0, -0.7, 0.4, 0.25, 0.3, {}}};
    Studio studio(scene);
    studio.look();
    int on_box = 0, on_pole = 0, on_rock = 0;
    each_near_pixel(studio, [&](int u, int v, double disparity, double height) {
        if (height < 1e-6) return;
        const Point point = world_point(scene, u, v, disparity);
        const Thing& thing = scene.things[point.x < -0.3 ? 0U : (point.x < 0.4 ? 1U : 2U)];
        const double dx = point.x - thing.x_m, dz = point.z - thing.z_m;
        const double along = std::cos(thing.yaw_rad) * dx - std::sin(thing.yaw_rad) * dz;
        const double across = std::sin(thing.yaw_rad) * dx + std::cos(thing.yaw_rad) * dz;
        double off = 1.0;  // from the surface
        if (thing.shape == Shape::kBox) {
            off = std::max({std::abs(along) - thing.half_x_m, std::abs(across) - thing.half_z_m,
                            height - thing.height_m});
            ++on_box;
        } else if (thing.shape == Shape::kPole) {
            const bool on_cap = std::abs(height - thing.height_m) < 1e-9;
            off = on_cap ? 0.0 : std::sqrt(dx * dx + dz * dz) - thing.half_x_m;
            ++on_pole;
        } else {
            const double a = along / thing.half_x_m, b = height / thing.height_m, c = across / thing.half_z_m;
            off = a * a + b * b + c * c - 1.0;
            ++on_rock;
        }
        ASSERT_NEAR(off, 0.0, 1e-9) << u << ' ' << v;
    });
    EXPECT_GT(on_box, 1000);
    EXPECT_GT(on_pole, 1000);
    EXPECT_GT(on_rock, 1000);
}

TEST(SynthGeometry, ClassFollowsHeightAndTolerance) {
    for (const double tolerance : {0.1, 0.2, 0.35}) {
        Studio studio("clutter?width=160&height=120&ditch_m=2.2&ditch_width_m=1");
        studio.look(0, tolerance);
        int count[kTerrainClasses] = {};
        each_near_pixel(studio, [&](int u, int v, double, double height) {
            const TerrainClass found = studio.truth.terrain.at(u, v);
            ++count[static_cast<int>(found)];
            if (std::abs(std::abs(height) - tolerance) < 1e-9) return;
            ASSERT_EQ(found, height > tolerance    ? TerrainClass::kObstacle
                             : height < -tolerance ? TerrainClass::kDrop
                                                   : TerrainClass::kTraversable);
        });
        EXPECT_EQ(count[0], 0);
        for (int i = 1; i < kTerrainClasses; ++i)
            EXPECT_GT(count[i], 50) << i;
    }
}

TEST(SynthGeometry, DitchShowsItsFarSideAsDeepAsTheNearEdgeLets) {
    // Camera height h, near edge at R, width w: the far side shows down to h w / R, deeper parts are hidden.
    Studio deep("ditch?ditch_m=2.5&ditch_width_m=0.5&ditch_depth_m=2&camera_height_m=1.2");
    deep.look();
    double deepest = 0.0;
    each_near_pixel(deep, [&](int u, int v, double disparity, double height) {
        deepest = std::min(deepest, height);
        if (height > -1e-6) return;
        ASSERT_NEAR(world_point(deep.renderer.scene(), u, v, disparity).z, 3.0, 1e-9) << u << ' ' << v;
    });
    const double limit = 1.2 * 0.5 / 2.5;
    EXPECT_GE(deepest, -limit - 1e-9);
    EXPECT_LT(deepest, -limit + 0.01) << "one row is 7 mm at this range";

    // A shallow one shows its floor.
    Studio shallow("ditch?ditch_m=2.5&ditch_width_m=1.5&ditch_depth_m=0.25");
    shallow.look();
    int floor = 0, deeper = 0;
    each_near_pixel(shallow, [&](int, int, double, double height) {
        floor += std::abs(height + 0.25) < 1e-9 ? 1 : 0;
        deeper += height < -0.25 - 1e-9 ? 1 : 0;
    });
    EXPECT_GT(floor, 5000);
    EXPECT_EQ(deeper, 0);
}

TEST(SynthGeometry, StepDownIsADropFromItsEdgeOn) {
    Studio studio("step?step_m=3&step_depth_m=0.3&width=160&height=120");
    studio.look();
    int upper = 0, lower = 0;
    each_near_pixel(studio, [&](int u, int v, double disparity, double height) {
        const Point point = world_point(studio.renderer.scene(), u, v, disparity);
        const bool beyond = point.z > 3.0;
        ASSERT_NEAR(height, beyond ? -0.3 : 0.0, 1e-9);
        ASSERT_EQ(studio.truth.terrain.at(u, v), beyond ? TerrainClass::kDrop : TerrainClass::kTraversable);
        (beyond ? lower : upper) += 1;
    });
    EXPECT_GT(upper, 1000);
    EXPECT_GT(lower, 1000);
}

TEST(SynthGeometry, UndulatingGroundIsMetFirstWhereTheRayMeetsIt) {
    Scene scene =
        scene_by_name("undulating?width=64&height=96&undulation_m=0.12&camera_height_m=0.6&roll_deg=4");
    scene.waves.push_back({0.03, 1.7, 0.8, 0.5});
    const auto surface_y = [&](double x, double z) {
        double y = 0.0;
        for (const Wave& wave : scene.waves)
            y -= wave.amplitude_m *
                 std::sin(2.0 * det::kPi * (x * std::sin(wave.heading_rad) + z * std::cos(wave.heading_rad)) /
                              wave.length_m +
                          wave.phase_rad);
        return y;
    };
    Studio studio(scene);
    studio.look(0, 0.1);  // below the amplitude: the waves are the ground themselves
    int hidden_crests = 0;
    const int seen = each_near_pixel(studio, [&](int u, int v, double disparity, double height) {
        const Point point = world_point(scene, u, v, disparity);
        ASSERT_NEAR(point.y, surface_y(point.x, point.z), 1e-9) << u << ' ' << v;
        ASSERT_NEAR(height, -point.y, 1e-9);
        ASSERT_EQ(studio.truth.terrain.at(u, v), TerrainClass::kTraversable);
        // Nothing before it: steps of a thousandth of the way, above the ground by more than rounding.
        constexpr int kSteps = 1000;
        bool grazes = false;
        for (int i = 1; i < kSteps; ++i) {
            const double share = static_cast<double>(i) / kSteps;
            const double x = point.x * share, z = point.z * share;
            const double y = -0.6 + (point.y + 0.6) * share;
            ASSERT_LT(y, surface_y(x, z) + 1e-9) << u << ' ' << v << " at " << share;
            if (share < 0.9 && y > surface_y(x, z) - 0.02) grazes = true;
        }
        hidden_crests += grazes ? 1 : 0;
    });
    EXPECT_GT(seen, 2000);
    EXPECT_GT(hidden_crests, 20) << "some rays must pass close over a crest for this to mean anything";
}

TEST(SynthGeometry, OcclusionBesideABoxIsAsWideAsTheDisparityStep) {
    // A box face at 3 m before a wall at 6 m, seen level: left of the box, where the right camera's view of
    // the wall is covered, exactly f b (1/3 - 1/6) px are hidden.
    Scene scene = scene_by_name("wall?wall_m=6&pitch_deg=0&width=320&height=240&focal=400&baseline=0.15");
    scene.things = {{Shape::kBox, 0.0, 3.2, 0.0, 0.31, 0.2, 0.8, {}}};
    Studio studio(scene);
    studio.look();
    const double cx = scene.rig.cx_px;
    const double near = 400 * 0.15 / 3.0, far = 400 * 0.15 / 6.0;
    const double left_edge = cx - 400 * 0.31 / 3.0, right_edge = cx + 400 * 0.31 / 3.0;
    const int v = 150;  // 1 m - 0.23 m at the box, clear of the ground at the wall
    for (int u = 0; u < 320; ++u) {
        const bool box = u > left_edge && u < right_edge;
        ASSERT_NEAR(studio.truth.disparity_px.at(u, v), box ? near : far, 1e-9) << u;
        const bool outside = u - (box ? near : far) < 0.0;
        const bool covered = !box && u - far > left_edge - near && u < left_edge;
        ASSERT_EQ(studio.truth.occluded.at(u, v), outside || covered ? 1 : 0) << u;
    }
    // The sky is neither.
    Studio sky("sky?width=64&height=48");
    sky.look();
    EXPECT_EQ(sky.truth.seen.at(5, 5), 0);
    EXPECT_EQ(sky.truth.occluded.at(5, 5), 0);
    EXPECT_EQ(sky.truth.disparity_px.at(5, 5), 0.0);
    EXPECT_EQ(sky.truth.terrain.at(5, 5), TerrainClass::kUnknown);
}

TEST(SynthGeometry, ThingsStayWhereTheyAreWhileTheCameraDrives) {
    // A point seen in one frame is found in a later one where the motion puts it.
    Studio first("drive?width=320&height=240&frames=20&noise=0");
    Studio later("drive?width=320&height=240&frames=20&noise=0");
    first.look(0);
    later.look(8);
    const Scene& scene = first.renderer.scene();
    const CameraPose camera = camera_at(scene, 8);
    ASSERT_NEAR(camera.forward_m, 0.4, 1e-12);
    const RectifiedRig& rig = scene.rig;
    int tested = 0, agree = 0;
    each_near_pixel(first, [&](int u, int v, double disparity, double height) {
        const Point point = world_point(scene, u, v, disparity, 0);
        const double sp = std::sin(camera.pose.pitch_rad), cp = std::cos(camera.pose.pitch_rad);
        const double sr = std::sin(camera.pose.roll_rad), cr = std::cos(camera.pose.roll_rad);
        const double x = point.x, y = point.y + camera.pose.height_m, z = point.z - camera.forward_m;
        const double px = cr * x + sr * cp * y - sp * sr * z;
        const double py = -sr * x + cr * cp * y - sp * cr * z;
        const double depth = sp * y + cp * z;
        if (depth < 0.5) return;
        const double u2 = rig.cx_px + rig.focal_px * px / depth, v2 = rig.cy_px + rig.focal_px * py / depth;
        if (!(u2 > 0.0 && u2 < rig.width - 1 && v2 > 0.0 && v2 < rig.height - 1)) return;
        ++tested;
        const int nu = static_cast<int>(u2 + 0.5), nv = static_cast<int>(v2 + 0.5);
        agree += std::abs(later.truth.height_m.at(nu, nv) - height) < 0.06 ? 1 : 0;
    });
    EXPECT_GT(tested, 20000);
    EXPECT_GT(agree, tested * 95 / 100) << "all but edges, which the motion covers and uncovers";
}

}  // namespace
}  // namespace groundline::synth
