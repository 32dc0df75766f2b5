// Disparity and metres: inverses, derivatives, scaling, limits.
#include "rig/range.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "unit/rig_support.hpp"

namespace groundline::rig {
namespace {

RectifiedRig sample(test::Random& random) {
    RectifiedRig rig;
    rig.width = 640;
    rig.height = 480;
    rig.calibrated = true;
    rig.focal_px = random.between(200, 1500);
    rig.baseline_m = random.between(0.05, 0.6);
    rig.cx_px = random.between(200, 400);
    rig.cx_right_px = rig.cx_px + random.between(-40, 40);
    return rig;
}

TEST(Range, DisparityAndDepthAreInverse) {
    test::Random random(11);
    for (int i = 0; i < 1000; ++i) {
        const RectifiedRig rig = sample(random);
        const double depth = random.between(0.2, 80.0);
        EXPECT_NEAR(depth_m(rig, disparity_px(rig, depth)), depth, 1e-9 * depth);
    }
}

TEST(Range, AMeasuredDisparityIsTheDifferenceOfTheTwoColumns) {
    test::Random random(12);
    for (int i = 0; i < 1000; ++i) {
        const RectifiedRig rig = sample(random);
        const double x = random.between(-3, 3), z = random.between(0.5, 60);
        const double left = rig.focal_px * x / z + rig.cx_px;
        const double right = rig.focal_px * (x - rig.baseline_m) / z + rig.cx_right_px;
        EXPECT_NEAR(disparity_px(rig, z), left - right, 1e-9);
    }
}

TEST(Range, NothingIsBehindInfinity) {
    RectifiedRig rig;
    rig.focal_px = 500;
    rig.baseline_m = 0.1;
    rig.cx_px = 300;
    rig.cx_right_px = 290;  // offset 10
    EXPECT_TRUE(std::isinf(depth_m(rig, 10.0)));
    EXPECT_TRUE(std::isinf(depth_m(rig, 3.0)));
    EXPECT_DOUBLE_EQ(depth_m(rig, 20.0), 5.0);
}

TEST(Range, TheDeviationIsTheDerivative) {
    test::Random random(13);
    for (int i = 0; i < 1000; ++i) {
        const RectifiedRig rig = sample(random);
        const double depth = random.between(0.5, 50);
        const double d = disparity_px(rig, depth);
        const double step = 1e-4 * (d - rig.offset_px());
        const double slope = (depth_m(rig, d - step) - depth_m(rig, d + step)) / (2 * step);
        EXPECT_NEAR(depth_sigma_m(rig, depth, 0.25), 0.25 * slope, 1e-6 * slope);
    }
}

// G5: a k times longer baseline makes every disparity k times larger and leaves depths alone.
TEST(Range, BaselineScalesDisparity) {
    test::Random random(14);
    for (int i = 0; i < 1000; ++i) {
        const RectifiedRig rig = sample(random);
        RectifiedRig longer = rig;
        const double k = random.between(0.3, 4.0);
        longer.baseline_m *= k;
        const double depth = random.between(0.5, 50);
        const double d = disparity_px(rig, depth) - rig.offset_px();
        EXPECT_NEAR(disparity_px(longer, depth) - longer.offset_px(), k * d, 1e-9 * k * d);
        EXPECT_NEAR(depth_m(longer, k * d + longer.offset_px()), depth, 1e-9 * depth);
        EXPECT_NEAR(depth_sigma_m(longer, depth, k * 0.2), depth_sigma_m(rig, depth, 0.2),
                    1e-12 * depth * depth);
    }
}

// G6: half the resolution halves focal length and disparity and leaves depths alone.
TEST(Range, HalfResolutionHalvesDisparity) {
    test::Random random(15);
    for (int i = 0; i < 1000; ++i) {
        const RectifiedRig rig = sample(random);
        RectifiedRig half = rig;
        half.focal_px *= 0.5;
        half.cx_px = 0.5 * (rig.cx_px + 0.5) - 0.5;
        half.cx_right_px = 0.5 * (rig.cx_right_px + 0.5) - 0.5;
        const double depth = random.between(0.5, 50);
        const double d = disparity_px(rig, depth);
        EXPECT_NEAR(disparity_px(half, depth), 0.5 * d, 1e-9);
        EXPECT_NEAR(depth_m(half, 0.5 * d), depth, 1e-7 * depth);
    }
}

TEST(Range, LimitsFollowFromTheSearchRange) {
    RectifiedRig rig;
    rig.focal_px = 500;
    rig.baseline_m = 0.12;
    const RangeLimits limits = range_limits(rig, 0, 64);
    EXPECT_DOUBLE_EQ(limits.near_m, 60.0 / 63);
    EXPECT_TRUE(std::isinf(limits.far_m));
    EXPECT_DOUBLE_EQ(limits.tenth_m, 24.0);
    EXPECT_NEAR(depth_sigma_m(rig, limits.tenth_m, 0.25), 0.1 * limits.tenth_m, 1e-12);
    EXPECT_DOUBLE_EQ(limits.step_at_tenth_m, 24.0 * 24.0 / 16 / 60);
    EXPECT_DOUBLE_EQ(limits.step_at_5_m, 25.0 / 16 / 60);
    EXPECT_DOUBLE_EQ(range_limits(rig, 4, 32).far_m, 15.0);
    EXPECT_DOUBLE_EQ(range_limits(rig, 4, 32).near_m, 60.0 / 35);
}

TEST(Range, AutomaticDisparities) {
    struct Case {
        int width, hint, expected;
    };
    for (const Case& c :
         {Case{640, 0, 112}, Case{1242, 0, 208}, Case{96, 0, 32}, Case{97, 0, 32}, Case{192, 0, 32},
          Case{193, 0, 48}, Case{1280, 0, 224}, Case{1920, 0, 256}, Case{741, 280, 256}, Case{741, 70, 80},
          Case{741, 64, 64}, Case{741, 65, 80}, Case{640, 8, 32}, Case{640, 2000000000, 256}, Case{2, 0, 32}})
        EXPECT_EQ(auto_disparities(c.width, c.hint), c.expected) << c.width << " px, hint " << c.hint;
}

}  // namespace
}  // namespace groundline::rig
