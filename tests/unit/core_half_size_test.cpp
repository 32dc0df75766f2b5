// The picture at half its size: the same ground by its pixels, there and back, and pixels doubled.
#include "core/half_size.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/arena.hpp"

namespace groundline {
namespace {

RectifiedRig rig_of(int width, int height, double offset_px) {
    RectifiedRig rig;
    rig.width = width;
    rig.height = height;
    rig.calibrated = true;
    rig.focal_px = 411.0;
    rig.cx_px = 0.5 * width - 7.25;
    rig.cy_px = 0.5 * height + 3.5;
    rig.cx_right_px = rig.cx_px - offset_px;
    rig.baseline_m = 0.12;
    return rig;
}

// u = 2 u' + 0.5: where a point of space is seen at the full size, and at the half.
TEST(HalfSize, TheRigSeesEachPointWhereItsPixelsMeanIs) {
    const RectifiedRig rig = rig_of(641, 479, 31.0);
    const RectifiedRig half = halved(rig);
    EXPECT_EQ(half.width, 321);
    EXPECT_EQ(half.height, 240);
    for (const double x : {-2.0, 0.1, 1.5})
        for (const double z : {0.7, 5.0, 30.0}) {
            const double u = rig.focal_px * x / z + rig.cx_px;
            const double v = rig.focal_px * x / z + rig.cy_px;
            EXPECT_NEAR(2.0 * (half.focal_px * x / z + half.cx_px) + 0.5, u, 1e-9);
            EXPECT_NEAR(2.0 * (half.focal_px * x / z + half.cy_px) + 0.5, v, 1e-9);
        }
    EXPECT_DOUBLE_EQ(half.offset_px(), 15.5);
    EXPECT_EQ(half.baseline_m, rig.baseline_m);
}

TEST(HalfSize, TheGroundIsTheSameThereAndBack) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (int i = 0; i < 50; ++i) {
        const RectifiedRig rig = rig_of(640 + i, 480 + i, 20.0 * unit(random));
        Ground ground;
        ground.found = ground.metric = true;
        ground.pose = {0.3 + 0.2 * unit(random), 0.1 * unit(random), 1.0 + 0.5 * unit(random)};
        ground.plane = plane_of(ground.pose, rig);
        // Of three points of the plane, one at a corner each.
        const double at[3][3] = {{1.0, 0.0, 0.0}, {0.3 * unit(random), 1.0, 0.0}, {unit(random), 2.0, 30.0}};
        for (std::size_t row = 0; row < 3; ++row)
            for (std::size_t column = 0; column < 3; ++column)
                for (const auto& root : at)
                    ground.covariance[3 * row + column] += 1e-6 * root[row] * root[column];
        ground.sigma = pose_sigma(ground.plane, ground.covariance, rig);

        const Ground half = halved(ground);
        const GroundPose pose = pose_of(half.plane, halved(rig));
        EXPECT_NEAR(pose.pitch_rad, ground.pose.pitch_rad, 1e-12);
        EXPECT_NEAR(pose.roll_rad, ground.pose.roll_rad, 1e-12);
        EXPECT_NEAR(pose.height_m, ground.pose.height_m, 1e-12);
        EXPECT_NEAR(half.plane.at(10.0, 200.0), 0.5 * ground.plane.at(20.5, 400.5), 1e-9);
        const GroundPose sigma = pose_sigma(half.plane, half.covariance, halved(rig));
        EXPECT_NEAR(sigma.pitch_rad / ground.sigma.pitch_rad, 1.0, 1e-9);
        EXPECT_NEAR(sigma.roll_rad / ground.sigma.roll_rad, 1.0, 1e-9);
        EXPECT_NEAR(sigma.height_m / ground.sigma.height_m, 1.0, 1e-9);

        const Ground back = doubled(half);
        EXPECT_NEAR(back.plane.at(20.5, 400.5), ground.plane.at(20.5, 400.5), 1e-9);
        for (std::size_t k = 0; k < 9; ++k)
            EXPECT_NEAR(back.covariance[k], ground.covariance[k], 1e-15) << k;
        EXPECT_EQ(back.pose.pitch_rad, ground.pose.pitch_rad);
    }
    EXPECT_FALSE(doubled(Ground{}).found);
    EXPECT_EQ(halved(Ground{}).covariance[8], 0.0);
}

TEST(HalfSize, EveryPixelIsThatItStandsFor) {
    Serial serial;
    for (const int width : {1, 2, 33, 64})
        for (const int height : {1, 2, 33, 64}) {
            Arena arena;
            const auto half = arena.image<std::int16_t>(halved(width), halved(height));
            const auto full = arena.image<std::int16_t>(width, height);
            for (int y = 0; y < half.height; ++y)
                for (int x = 0; x < half.width; ++x)
                    half.at(x, y) = static_cast<std::int16_t>(100 * y + x);
            double_pixels<std::int16_t>(
                half, full, serial, [](std::int16_t value) { return static_cast<std::int16_t>(3 * value); });
            for (int y = 0; y < height; ++y)
                for (int x = 0; x < width; ++x)
                    ASSERT_EQ(full.at(x, y), 3 * half.at(x / 2, y / 2)) << width << "x" << height;
        }
}

}  // namespace
}  // namespace groundline
