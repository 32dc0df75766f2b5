// The elevation grid against surfaces whose height, slope, roughness and steps are known by formula.
#include "terrain/elevation_grid.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "core/error.hpp"
#include "support/allocation_count.hpp"
#include "synth/renderer.hpp"
#include "terrain/classifier.hpp"
#include "unit/terrain_scene.hpp"

namespace groundline::terrain {
namespace {

using test::pose_deg;
using test::rig_of;

constexpr int kDisparities = 96;

// Metres above the ground plane at (forward, left) of the camera's foot point.
using Surface = std::function<double(double, double)>;

TerrainConfig noiseless(double tolerance_m = 0.20) {
    TerrainConfig config;
    config.sigma_disparity_px = 0.0;
    config.tolerance_up_m = config.tolerance_down_m = tolerance_m;
    return config;
}

struct Bench {
    TerrainConfig config;
    GridConfig grid_config;
    RectifiedRig rig;
    GroundPose pose = pose_deg(14.0, 2.0, 1.2);
    Arena arena;
    ElevationGrid finder;
    DisparityMap map;
    Mask mask;
    TerrainGrid grid;
    Ground ground;

    explicit Bench(const TerrainConfig& terrain = noiseless(), GridConfig wanted = {}, int width = 640)
        : config(terrain),
          grid_config(on(wanted)),
          rig(rig_of(width)),
          finder(grid_config, config, rig, 0, kDisparities, arena),
          map(DisparityMap::make(arena, rig.width, rig.height)),
          mask(arena.image<TerrainClass>(rig.width, rig.height)),
          grid(make_terrain_grid(grid_config, arena)) {
        ground.found = ground.metric = true;
        ground.plane = plane_of(pose, rig);
        ground.pose = pose;
    }
    static GridConfig on(GridConfig config) {
        config.on = true;
        return config;
    }

    double top_m = 0.3;  // above every surface shown

    // Disparities of the first point of each ray below the surface, in sixteenths, and classes by height.
    void see(const Surface& surface, const test::Noise& noise = {}) {
        const test::World world{rig, pose, {}};
        const test::Rays rays(world);
        test::Dice dice(noise.seed);
        for (int v = 0; v < rig.height; ++v) {
            for (int u = 0; u < rig.width; ++u) {
                double along[3];
                rays.direction(u, v, along);
                const auto above = [&](double depth) {
                    return pose.height_m - depth * along[2] - surface(depth * along[0], depth * along[1]);
                };
                double near = std::max(0.3, (pose.height_m - top_m) / std::max(along[2], 1e-3));
                double far = near;
                while (far < 14.0 && above(far) > 0.0) {
                    near = far;
                    far *= 1.01;
                }
                map.invalid.at(u, v) = far < 14.0 ? Invalid::kNone : Invalid::kTexture;
                map.disparity_q4.at(u, v) = 0;
                mask.at(u, v) = TerrainClass::kUnknown;
                if (far >= 14.0) continue;
                for (int i = 0; i < 30; ++i)
                    (above(0.5 * (near + far)) > 0.0 ? near : far) = 0.5 * (near + far);
                const double d_px = rig.focal_px * rig.baseline_m / far + noise.sigma_px * dice.normal();
                const double height = height_above_ground(pose.height_m, ground.plane.at(u, v), d_px);
                map.disparity_q4.at(u, v) = static_cast<std::int16_t>(std::floor(16.0 * d_px + 0.5));
                mask.at(u, v) = height > config.tolerance_up_m      ? TerrainClass::kObstacle
                                : height < -config.tolerance_down_m ? TerrainClass::kDrop
                                                                    : TerrainClass::kTraversable;
            }
        }
        find();
    }
    void see(const test::World& world) {
        test::render(world, 0, kDisparities, {}, map);
        Classifier classifier(config, rig, 0, kDisparities, arena);
        FixedVector<Obstacle, kMaxObstacles> obstacles;
        GroundSurface surface;
        surface.take(arena, rig.width, rig.height, 0, kDisparities);
        surface.flatten(CellSupport::kSupported);
        double limit_m = 0.0;
        Serial serial;
        classifier.classify(map, ground, GroundUse::kOwn, surface, mask, obstacles, limit_m, serial);
        find();
    }
    void find() { finder.find(map, ground, mask, grid); }

    // Height of a sixteenth of a pixel on the ground at x, without a mount: what a cell seen in one row is
    // uncertain by either way, and a step, of four such cells, three times.
    double quantum_m(double x) const {
        const double depth = x * std::cos(pose.pitch_rad) + pose.height_m * std::sin(pose.pitch_rad);
        return pose.height_m * depth / (16.0 * rig.focal_px * rig.baseline_m);
    }
    double x_of(int row) const { return (row + 0.5) * grid.cell_m; }
    double y_of(int column) const { return grid.y_m + (column + 0.5) * grid.cell_m; }
    GridCell& at(double x, double y) const {
        return grid.at(static_cast<int>(std::floor(x / grid.cell_m)),
                       static_cast<int>(std::floor((y - grid.y_m) / grid.cell_m)));
    }
    int count(const std::function<bool(const GridCell&)>& wanted) const {
        return static_cast<int>(std::count_if(grid.cells.begin(), grid.cells.end(), wanted));
    }
    // f(cell, x, y) for each.
    template <typename F>
    void each(F f) const {
        for (int i = 0; i < grid.rows; ++i)
            for (int j = 0; j < grid.columns; ++j)
                f(grid.at(i, j), x_of(i), y_of(j));
    }
};

bool measured(float value) {
    return !std::isnan(value);
}
bool graded(const GridCell& cell) {
    return measured(cell.slope_rad) && measured(cell.roughness_m) && measured(cell.step_m) &&
           measured(cell.index);
}
bool blank(const GridCell& cell) {
    return cell.kind == TerrainClass::kUnknown && cell.points == 0 && !measured(cell.elevation_m) &&
           !measured(cell.highest_m) && !measured(cell.slope_rad) && !measured(cell.roughness_m) &&
           !measured(cell.step_m) && !measured(cell.index);
}

TEST(Grid, LevelGroundIsPerfectWhereItIsSeenAndUnknownElsewhere) {
    Bench bench;
    bench.see([](double, double) { return 0.0; });
    ASSERT_EQ(bench.grid.rows, 80);
    ASSERT_EQ(bench.grid.columns, 80);
    int seen = 0;
    bench.each([&](const GridCell& cell, double x, double y) {
        // The view is 65 deg wide and begins 1.6 m before the camera.
        const bool in_view = x > 2.0 && x < 7.0 && std::fabs(y) < 0.55 * x;
        const bool outside = x < 1.0 || std::fabs(y) > 0.75 * x + 0.2;
        if (in_view) {
            ++seen;
            ASSERT_EQ(cell.kind, TerrainClass::kTraversable) << x << ' ' << y;
            ASSERT_NEAR(cell.elevation_m, 0.0, 0.501 * bench.quantum_m(x + 0.05));
            ASSERT_NEAR(cell.highest_m, 0.0, 0.501 * bench.quantum_m(x + 0.05));
            ASSERT_GE(cell.points, 3);
            ASSERT_TRUE(graded(cell)) << x << ' ' << y;
            ASSERT_LT(cell.slope_rad, 0.01);
            ASSERT_LT(cell.roughness_m, 0.006);
            ASSERT_LT(cell.step_m, 3.0 * bench.quantum_m(x));
            ASSERT_EQ(cell.index, 1.0F);
        }
        if (outside) {
            ASSERT_TRUE(blank(cell)) << x << ' ' << y;
        }
    });
    EXPECT_GT(seen, 2000);
}

// Any direction of rise; heights are those at the cells' middles, and a slope alone is neither rough nor a
// step.
TEST(Grid, SlopeOfAPlane) {
    for (const double slope_deg : {8.0, 20.0}) {
        for (const double heading_deg : {0.0, 90.0, -60.0}) {
            const double rise = std::tan(det::radians(slope_deg));
            const double rise_x = rise * std::cos(det::radians(heading_deg));
            const double rise_y = rise * std::sin(det::radians(heading_deg));
            Bench bench(noiseless(3.0));
            bench.top_m = 3.0;
            const auto surface = [=](double x, double y) { return rise_x * (x - 3.5) + rise_y * y; };
            bench.see(surface);
            int cells = 0;
            bench.each([&](const GridCell& cell, double x, double y) {
                if (x < 2.6 || x > 4.5 || std::fabs(y) > 0.3 * x || !graded(cell)) return;
                ++cells;
                ASSERT_NEAR(det::degrees(cell.slope_rad), slope_deg, 0.3)
                    << heading_deg << ' ' << x << ' ' << y;
                ASSERT_LT(cell.roughness_m, 0.005);
                // A cell's mean is that of its samples, which may lie up to half a cell from its middle.
                ASSERT_LT(cell.step_m, 3.0 * bench.quantum_m(x) + bench.grid.cell_m * rise);
                ASSERT_NEAR(cell.elevation_m, surface(x, y),
                            0.25 * bench.grid.cell_m * rise + bench.quantum_m(x));
                ASSERT_GE(cell.highest_m, cell.elevation_m - bench.quantum_m(x));
            });
            EXPECT_GT(cells, 300) << slope_deg << ' ' << heading_deg;
        }
    }
}

// A ledge along the way and one across it, at a border of cells and amidst a cell, up and down.
TEST(Grid, StepHasItsHeight) {
    for (const double height : {0.06, 0.12, 0.18, -0.12}) {
        for (const double shift : {0.0, 0.05}) {
            Bench bench;
            bench.see([=](double, double y) { return y > 0.3 + shift ? height : 0.0; });
            int cells = 0;
            bench.each([&](const GridCell& cell, double x, double y) {
                if (x < 2.2 || x > 4.5 || y < -0.4 || y > 1.0 || !measured(cell.step_m)) return;
                const double away = std::fabs(y - (0.3 + shift));
                // A ledge hides what lies behind it, so the far side of the highest is not always seen.
                if (away < 0.051) {
                    ++cells;
                    // Also at a border, where the upright side blurs the cells to both sides of it.
                    const double share = shift > 0.0 ? 1.0 : 0.7;
                    ASSERT_GT(cell.step_m, share * std::fabs(height) - 0.012) << height << ' ' << x;
                    ASSERT_LT(cell.step_m, std::fabs(height) + 0.012) << height << ' ' << x;
                }
                if (away > 0.26) {
                    ASSERT_LT(cell.step_m, 0.012) << height << ' ' << x << ' ' << y;
                }
            });
            EXPECT_GT(cells, 20);
        }
        // Across the way the upright face is seen too, by as many pixels as a cell of ground: amidst a cell
        // it matters not, at a border of two it blurs both.
        for (const double edge : {3.05, 3.0}) {
            Bench bench;
            bench.see([=](double x, double) { return x > edge ? std::fabs(height) : 0.0; });
            const double least = edge == 3.05 ? std::fabs(height) - 0.012 : 0.6 * std::fabs(height);
            for (double y = -0.75; y < 0.8; y += 0.1) {
                const float step = std::max(bench.at(2.95, y).step_m, bench.at(3.05, y).step_m);
                ASSERT_GT(step, least) << edge << ' ' << y;
                ASSERT_LT(step, std::fabs(height) + 0.012) << edge << ' ' << y;
                ASSERT_LT(bench.at(2.55, y).step_m, 0.012);
                ASSERT_LT(bench.at(3.45, y).step_m, 0.012);
            }
        }
    }
}

// A thing one cell wide is a step too; its upright side, seen with its top, takes off up to a third.
TEST(Grid, NarrowBumpIsAStep) {
    Bench bench;
    bench.see([](double, double y) { return y > 0.3 && y < 0.4 ? 0.15 : 0.0; });
    int cells = 0;
    for (double x = 2.25; x < 4.5; x += 0.1, ++cells) {
        ASSERT_GT(bench.at(x, 0.35).step_m, 0.1) << x;
        ASSERT_LT(bench.at(x, 0.35).step_m, 0.15 + 0.012) << x;
    }
    EXPECT_GT(cells, 20);
}

// Slopes that lean apart explain no rise: what is left of a ridge is its height over the middle of its sides.
TEST(Grid, RidgeIsNotTwiceAStep) {
    Bench bench(noiseless(0.5));
    const double rise = std::tan(det::radians(20.0));
    bench.see([=](double, double y) { return 0.2 - rise * std::fabs(y - 0.05); });
    int cells = 0;
    for (double x = 2.25; x < 3.5; x += 0.1, ++cells) {
        ASSERT_LT(bench.at(x, 0.05).step_m, 1.2 * rise * 0.1 + 3.0 * bench.quantum_m(x)) << x;
        ASSERT_GT(bench.at(x, 0.05).step_m, 0.4 * rise * 0.1) << x;
    }
    EXPECT_GT(cells, 10);
}

// Waves shorter than the window: their RMS is amplitude / sqrt 2 in each direction.
TEST(Grid, RoughnessIsTheDeviationFromThePlane) {
    for (const double amplitude : {0.01, 0.02, 0.04}) {
        Bench bench;
        const double wave = 2.0 * det::kPi / 0.25;
        bench.see([=](double x, double y) {
            return 0.1 * (x - 3.0) + 0.5 * amplitude * (std::sin(wave * x) + std::sin(wave * y));
        });
        double sum = 0.0;
        int cells = 0;
        bench.each([&](const GridCell& cell, double x, double y) {
            if (x < 2.3 || x > 3.6 || std::fabs(y) > 0.8 || !graded(cell)) return;
            sum += cell.roughness_m;
            ++cells;
        });
        ASSERT_GT(cells, 150);
        // Crests hide a little of the troughs; 1.8 periods are not whole ones.
        EXPECT_NEAR(sum / cells, 0.5 * amplitude, 0.08 * amplitude);
    }
}

TEST(Grid, NoiseOfTheDisparitiesIsNotRoughness) {
    const double sigma_px = 0.2;
    const auto median_ratio = [&](double believed_px) {
        TerrainConfig config = noiseless(0.5);
        config.sigma_disparity_px = believed_px;
        Bench bench(config);
        bench.see([](double, double) { return 0.0; }, {sigma_px, 0.0, 0.0, 3});
        std::vector<double> ratios;
        bench.each([&](const GridCell& cell, double x, double y) {
            if (x < 2.5 || x > 6.0 || std::fabs(y) > 0.4 * x || !graded(cell)) return;
            const double depth = x * std::cos(bench.pose.pitch_rad) + 1.2 * std::sin(bench.pose.pitch_rad);
            ratios.push_back(cell.roughness_m / (1.2 * sigma_px * depth / 60.0));
        });
        EXPECT_GT(ratios.size(), 1000U);
        std::nth_element(ratios.begin(), ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2),
                         ratios.end());
        return ratios[ratios.size() / 2];
    };
    EXPECT_NEAR(median_ratio(0.0), 1.0, 0.04);
    EXPECT_LT(median_ratio(sigma_px), 0.25);
}

TEST(Grid, WhatNoiseHidesIsNotGraded) {
    TerrainConfig config = noiseless(0.20);
    config.sigma_disparity_px = 0.25;
    Bench bench(config, {.cell_m = 0.2, .forward_m = 14.0, .side_m = 5.0});
    bench.see([](double, double) { return 0.0; });
    // sigma_H = 1.2 x 0.25 Z / 60 = 0.05 at Z = 10 m.
    int near = 0;
    int far = 0;
    bench.each([&](const GridCell& cell, double x, double y) {
        if (cell.kind != TerrainClass::kTraversable || std::fabs(y) > 0.4 * x) return;
        const double depth = x * std::cos(bench.pose.pitch_rad) + 1.2 * std::sin(bench.pose.pitch_rad);
        if (depth > 10.05) {
            ++far;
            ASSERT_FALSE(measured(cell.slope_rad) || measured(cell.roughness_m) || measured(cell.step_m) ||
                         measured(cell.index));
            ASSERT_TRUE(measured(cell.elevation_m));
        } else if (depth < 9.9 && x > 2.5) {
            ++near;
            ASSERT_TRUE(graded(cell)) << x << ' ' << y;
        }
    });
    EXPECT_GT(near, 300);
    EXPECT_GT(far, 100);
}

TEST(Grid, BoxStandsAtItsPlaceInTheBodyFrame) {
    for (const double yaw_deg : {0.0, 25.0, -40.0}) {
        TerrainConfig config = noiseless();
        config.mount_x_m = 0.5;
        config.mount_y_m = -0.3;
        config.mount_yaw_deg = yaw_deg;
        Bench bench(config, {.cell_m = 0.1, .forward_m = 6.5, .side_m = 5.0});
        test::World world{bench.rig, bench.pose, {}};
        const test::Box box{3.5, 0.4, 0.6, 0.5, 0.7};
        world.boxes.push_back(box);
        bench.see(world);
        const double c = std::cos(det::radians(yaw_deg));
        const double s = std::sin(det::radians(yaw_deg));
        int inside = 0;
        int behind = 0;
        bench.each([&](const GridCell& cell, double x, double y) {
            const double forward = c * (x - 0.5) + s * (y + 0.3);
            const double left = -s * (x - 0.5) + c * (y + 0.3);
            const double aside = std::fabs(left - box.left_m) - 0.5 * box.width_m;
            const double along = std::max(box.forward_m - forward, forward - box.forward_m - box.depth_m);
            if (cell.kind == TerrainClass::kObstacle) {
                // Half a cell's diagonal, and a little for sixteenths of a pixel.
                ASSERT_LT(std::max(aside, along), 0.08) << yaw_deg << ' ' << x << ' ' << y;
                ASSERT_EQ(cell.index, 0.0F);
                ASSERT_LT(cell.highest_m, 0.73);
            }
            // Its near half: the top is seen from above.
            if (aside < -0.08 && along < -0.08 && forward < box.forward_m + 0.2) {
                ++inside;
                ASSERT_EQ(cell.kind, TerrainClass::kObstacle) << yaw_deg << ' ' << x << ' ' << y;
                ASSERT_GT(cell.highest_m, 0.67);
            }
            // Its shadow: the rays over its far edge meet the ground at 4.0 x 1.2 / 0.5 = 9.6 m.
            const double bearing = left / forward;
            if (forward > 4.15 && bearing > 0.14 / 3.5 && bearing < 0.66 / 4.0) {
                ++behind;
                ASSERT_TRUE(blank(cell)) << yaw_deg << ' ' << x << ' ' << y;
            }
        });
        EXPECT_GE(inside, 4) << yaw_deg;
        EXPECT_GT(behind, 40) << yaw_deg;
    }
}

TEST(Grid, DropIsADropAndItsLipAStep) {
    Bench bench;
    test::World world{bench.rig, bench.pose, {}};
    world.ditch_from_m = 2.5;
    world.ditch_to_m = 4.0;
    world.ditch_depth_m = 0.6;
    bench.see(world);
    EXPECT_EQ(bench.at(2.35, 0.0).kind, TerrainClass::kTraversable);
    const auto drops = bench.count([](const GridCell& cell) { return cell.kind == TerrainClass::kDrop; });
    EXPECT_GT(drops, 40);
    bench.each([&](const GridCell& cell, double x, double y) {
        if (std::fabs(y) > 0.5) return;
        if (cell.kind == TerrainClass::kDrop) {
            ASSERT_GT(x, 2.4) << y;
            ASSERT_LT(x, 4.1) << y;
            ASSERT_LT(cell.elevation_m, -0.2);
            ASSERT_EQ(cell.index, 0.0F);
        }
        if (x > 2.6 && x < 3.4) {
            ASSERT_NE(cell.kind, TerrainClass::kTraversable) << x << ' ' << y;
        }
    });
}

// Any mask at all: the cells say nothing better than its pixels.
TEST(Grid, ObeysTheMask) {
    test::Dice dice(11);
    Bench bench(noiseless(), {}, 637);
    bench.see([](double, double) { return 0.0; });
    const test::Rays rays({bench.rig, bench.pose, {}});
    for (int trial = 0; trial < 4; ++trial) {
        const double density = 0.0003 * (1 << (3 * trial));
        for (int v = 0; v < bench.rig.height; ++v)
            for (int u = 0; u < bench.rig.width; ++u) {
                TerrainClass& kind = bench.mask.at(u, v);
                kind = dice.uniform() < 0.5 ? TerrainClass::kTraversable : TerrainClass::kUnknown;
                if (v % 48 < 24) kind = TerrainClass::kUnknown;
                if (dice.uniform() < density)
                    kind = dice.uniform() < 0.5 ? TerrainClass::kObstacle : TerrainClass::kDrop;
            }
        bench.find();
        std::vector<int> free(bench.grid.cells.size(), 0);
        int things = 0;
        for (int v = 0; v < bench.rig.height; ++v)
            for (int u = 0; u < bench.rig.width; ++u) {
                if (bench.map.invalid.at(u, v) != Invalid::kNone) continue;
                double along[3];
                rays.direction(u, v, along);
                const double depth = 60.0 * 16.0 / bench.map.disparity_q4.at(u, v);
                const double x = depth * along[0];
                const double y = depth * along[1];
                // Next to a border of cells the last bits decide.
                const double near_x = std::fabs(10.0 * x - std::floor(10.0 * x + 0.5));
                const double near_y = std::fabs(10.0 * y - std::floor(10.0 * y + 0.5));
                if (near_x < 1e-6 || near_y < 1e-6) continue;
                if (x < 0.0 || x >= 8.0 || std::fabs(y) >= 4.0) continue;
                const GridCell& cell = bench.at(x, y);
                const TerrainClass kind = bench.mask.at(u, v);
                if (kind == TerrainClass::kObstacle) {
                    ++things;
                    ASSERT_EQ(cell.kind, TerrainClass::kObstacle) << u << ' ' << v;
                }
                if (kind == TerrainClass::kDrop) {
                    ++things;
                    ASSERT_TRUE(cell.kind == TerrainClass::kDrop || cell.kind == TerrainClass::kObstacle);
                }
                if (kind == TerrainClass::kTraversable)
                    ++free[static_cast<std::size_t>(&cell - bench.grid.cells.data())];
            }
        int few = 0;
        for (std::size_t i = 0; i < free.size(); ++i) {
            few += free[i] < 3 ? 1 : 0;
            if (free[i] < 3) {
                ASSERT_NE(bench.grid.cells[i].kind, TerrainClass::kTraversable);
            }
        }
        EXPECT_GT(things, 20);
        EXPECT_GT(few, 100);
    }
}

TEST(Grid, RangeEdgePixelsAreAnObstacleAtTheNearestRange) {
    Bench bench;
    bench.see([](double, double) { return 0.0; });
    for (int v = 100; v < 300; ++v)
        for (int u = 300; u < 340; ++u) {
            bench.map.invalid.at(u, v) = Invalid::kRangeEdge;
            bench.map.disparity_q4.at(u, v) = 0;
            bench.mask.at(u, v) = TerrainClass::kObstacle;
        }
    bench.find();
    EXPECT_EQ(bench.at(0.63, 0.0).kind, TerrainClass::kObstacle);  // 60 / 95
    bench.each([&](const GridCell& cell, double x, double) {
        if (cell.kind == TerrainClass::kObstacle) {
            ASSERT_LT(x, 0.9);
        }
    });
}

TEST(Grid, IsUnknownWithoutGroundOrMetresOrClasses) {
    Bench bench;
    const auto nothing = [&] { return bench.count(blank) == static_cast<int>(bench.grid.cells.size()); };
    const auto flat = [](double, double) { return 0.0; };
    bench.see(flat);
    ASSERT_FALSE(nothing());
    const Ground good = bench.ground;
    bench.ground.found = false;
    bench.find();
    EXPECT_TRUE(nothing());
    bench.ground = good;
    bench.find();
    ASSERT_FALSE(nothing());
    bench.ground.metric = false;
    bench.find();
    EXPECT_TRUE(nothing());
    bench.ground = good;
    RectifiedRig uncalibrated = bench.rig;
    uncalibrated.calibrated = false;
    ElevationGrid finder(bench.grid_config, bench.config, uncalibrated, 0, kDisparities, bench.arena);
    bench.find();
    finder.find(bench.map, good, bench.mask, bench.grid);
    EXPECT_TRUE(nothing());
    bench.find();
    fill_pixels(bench.mask, TerrainClass::kUnknown);  // what blind looks like
    bench.find();
    EXPECT_TRUE(nothing());
}

// With a held ground the mask has obstacles but no class 1, and so has the grid.
TEST(Grid, IsFreeOnlyWhereTheMaskIs) {
    Bench bench;
    test::World world{bench.rig, bench.pose, {}};
    world.boxes.push_back({3.5, 0.4, 0.6, 0.5, 0.7});
    bench.see(world);
    const auto obstacles = [&] {
        return bench.count([](const GridCell& cell) { return cell.kind == TerrainClass::kObstacle; });
    };
    const auto free = [&] {
        return bench.count([](const GridCell& cell) { return cell.kind == TerrainClass::kTraversable; });
    };
    const int before = obstacles();
    ASSERT_GT(before, 10);
    ASSERT_GT(free(), 1000);
    for (int v = 0; v < bench.rig.height; ++v)
        for (int u = 0; u < bench.rig.width; ++u)
            if (bench.mask.at(u, v) == TerrainClass::kTraversable)
                bench.mask.at(u, v) = TerrainClass::kUnknown;
    bench.find();
    EXPECT_EQ(obstacles(), before);
    EXPECT_EQ(free(), 0);
}

TEST(Grid, AFrameLeavesNothingToTheNext) {
    Bench bench;
    test::World world{bench.rig, bench.pose, {}};
    world.boxes.push_back({3.5, 0.4, 0.6, 0.5, 0.7});
    bench.see(world);
    const std::vector<GridCell> first(bench.grid.cells.begin(), bench.grid.cells.end());
    bench.see([](double x, double) { return 0.02 * x; });
    EXPECT_EQ(bench.count([](const GridCell& cell) { return cell.kind == TerrainClass::kObstacle; }), 0);
    bench.see(world);
    const auto same = [](float one, float other) {
        return one == other || (std::isnan(one) && std::isnan(other));
    };
    for (std::size_t i = 0; i < first.size(); ++i) {
        const GridCell& now = bench.grid.cells[i];
        ASSERT_TRUE(first[i].kind == now.kind && first[i].points == now.points &&
                    same(first[i].elevation_m, now.elevation_m) && same(first[i].slope_rad, now.slope_rad) &&
                    same(first[i].roughness_m, now.roughness_m) && same(first[i].step_m, now.step_m) &&
                    same(first[i].index, now.index));
    }
}

TEST(Grid, FindingAllocatesNothing) {
    Bench bench;
    bench.see([](double, double) { return 0.0; });
    const std::uint64_t before = groundline::test::allocations();
    for (int i = 0; i < 3; ++i)
        bench.find();
    EXPECT_EQ(groundline::test::allocations() - before, 0U);
    EXPECT_GT(before, 0U) << "the counter does not count";
}

TEST(Grid, RefusesWhatOneMessageCannotHold) {
    Arena arena;
    const auto refusal = [&](double cell_m, double forward_m, double side_m) -> std::string {
        const GridConfig config{true, cell_m, forward_m, side_m, 25.0};
        try {
            make_terrain_grid(config, arena);
        } catch (const Refusal& refused) {
            EXPECT_EQ(refused.status(), ExitStatus::kConfig);
            EXPECT_THROW(ElevationGrid(config, {}, rig_of(), 0, 64, arena), Refusal);
            return refused.what();
        }
        return "";
    };
    EXPECT_EQ(refusal(0.1, 8.0, 4.0), "");
    EXPECT_EQ(refusal(0.1, 8.1, 4.0), "");
    const std::string said = refusal(0.1, 8.2, 4.0);
    EXPECT_NE(said.find("grid.forward_m of 8.1 or less"), std::string::npos) << said;
    EXPECT_NE(said.find("grid.cell_m of 0.11 or more"), std::string::npos) << said;
    EXPECT_EQ(refusal(0.11, 8.2, 4.0), "");
    EXPECT_NE(refusal(0.02, 100.0, 100.0).find("grid.cell_m of"), std::string::npos);
    EXPECT_TRUE(make_terrain_grid(GridConfig{}, arena).cells.empty()) << "off is off";
}

TEST(Grid, IndexFollowsItsRules) {
    const TerrainConfig config;  // tolerance 0.20 m
    const IndexRules rules = IndexRules::of({}, config);
    const auto index = [&](double slope_deg, double roughness, double step) {
        return rules.index(det::radians(slope_deg), roughness, step);
    };
    EXPECT_EQ(index(0.0, 0.0, 0.0), 1.0);
    EXPECT_EQ(index(5.0, 0.02, 0.05), 1.0);
    EXPECT_NEAR(index(15.0, 0.0, 0.0), 2.0 / 3.0, 1e-12);
    EXPECT_NEAR(index(0.0, 0.06, 0.0), 2.0 / 3.0, 1e-12);
    EXPECT_NEAR(index(0.0, 0.0, 0.125), 2.0 / 3.0, 1e-12);
    EXPECT_NEAR(index(15.0, 0.06, 0.0), 1.0 / 3.0, 1e-12);
    EXPECT_NEAR(index(15.0, 0.06, 0.125), 0.0, 1e-12);
    EXPECT_NEAR(index(10.0, 0.0, 0.0), 5.0 / 6.0, 1e-12);
    EXPECT_NEAR(index(20.0, 0.0, 0.0), 1.0 / 3.0, 1e-12);
    EXPECT_EQ(index(25.0, 0.0, 0.0), 0.0);
    EXPECT_EQ(index(0.0, 0.10, 0.0), 0.0);
    EXPECT_EQ(index(0.0, 0.0, 0.20), 0.0);
    EXPECT_EQ(index(89.0, 3.0, 3.0), 0.0);
}

TEST(Grid, IndexNeverRisesWithSlopeRoughnessOrStep) {
    const IndexRules rules = IndexRules::of({}, TerrainConfig{});
    test::Dice dice(5);
    for (int trial = 0; trial < 200'000; ++trial) {
        double values[3] = {dice.between(0.0, 0.6), dice.between(0.0, 0.15), dice.between(0.0, 0.3)};
        const double before = rules.index(values[0], values[1], values[2]);
        ASSERT_GE(before, 0.0);
        ASSERT_LE(before, 1.0);
        values[trial % 3] += dice.between(0.0, 0.1);
        ASSERT_LE(rules.index(values[0], values[1], values[2]), before + 1e-12);
    }
}

// Rendered scenes, exact disparities rounded to sixteenths: a traversable cell's elevation is the mean height
// of the surface in it.
TEST(Grid, ElevationOnRenderedScenes) {
    for (const char* name :
         {"synthetic:undulating?seed=3", "synthetic:plane?seed=4&rocks=20", "synthetic:drive?seed=5"}) {
        const synth::Renderer renderer(synth::scene_by_name(name));
        const RectifiedRig& rig = renderer.scene().rig;
        Arena arena;
        const synth::Truth truth = synth::Truth::make(arena, rig.width, rig.height);
        Serial serial;
        renderer.render_truth(0, serial, 0.2, truth);
        const DisparityMap map = DisparityMap::make(arena, rig.width, rig.height);
        const Mask mask = arena.image<TerrainClass>(rig.width, rig.height);
        const synth::CameraPose camera = synth::camera_at(renderer.scene(), 0);
        Ground ground;
        ground.found = ground.metric = true;
        ground.plane = renderer.plane(0);
        ground.pose = camera.pose;
        for (int v = 0; v < rig.height; ++v)
            for (int u = 0; u < rig.width; ++u) {
                const double d_px = truth.disparity_px.at(u, v);
                const bool valid = truth.seen.at(u, v) != 0 && d_px < 250.0;
                map.invalid.at(u, v) = valid ? Invalid::kNone : Invalid::kTexture;
                map.disparity_q4.at(u, v) =
                    valid ? static_cast<std::int16_t>(std::floor(16.0 * d_px + 0.5)) : std::int16_t{0};
                mask.at(u, v) = valid ? truth.terrain.at(u, v) : TerrainClass::kUnknown;
            }
        GridConfig config;
        config.on = true;
        ElevationGrid finder(config, noiseless(), rig, 0, 256, arena);
        TerrainGrid grid = make_terrain_grid(config, arena);
        finder.find(map, ground, mask, grid);

        // The mean truth of each cell, by its own geometry.
        const test::Rays rays({rig, camera.pose, {}});
        std::vector<double> sum(grid.cells.size(), 0.0);
        std::vector<int> seen(grid.cells.size(), 0);
        for (int v = 0; v < rig.height; ++v)
            for (int u = 0; u < rig.width; ++u) {
                if (mask.at(u, v) != TerrainClass::kTraversable) continue;
                double along[3];
                rays.direction(u, v, along);
                const double depth =
                    rig.focal_px * rig.baseline_m / (truth.disparity_px.at(u, v) - rig.offset_px());
                const double x = depth * along[0];
                const double y = depth * along[1] + 4.0;
                if (x < 0.0 || x >= 8.0 || y < 0.0 || y >= 8.0) continue;
                const auto at =
                    static_cast<std::size_t>(static_cast<int>(10.0 * x) * 80 + static_cast<int>(10.0 * y));
                sum[at] += truth.height_m.at(u, v);
                ++seen[at];
            }
        double squares = 0.0;
        int wrong = 0;  // by a tenth of the tolerance
        int cells = 0;
        for (std::size_t i = 0; i < sum.size(); ++i) {
            if (grid.cells[i].kind != TerrainClass::kTraversable || seen[i] < 4) continue;
            const double error = grid.cells[i].elevation_m - sum[i] / seen[i];
            squares += error * error;
            wrong += std::fabs(error) > 0.02 ? 1 : 0;
            ++cells;
        }
        EXPECT_GT(cells, 1000) << name;
        EXPECT_LT(std::sqrt(squares / cells), 0.006) << name;
        EXPECT_LT(wrong, 0.02 * cells) << name;
    }
}

}  // namespace
}  // namespace groundline::terrain
