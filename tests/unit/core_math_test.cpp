#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/deterministic_math.hpp"

namespace groundline {
namespace {

// Promised: below 4e-16 relative to the result's range, that is to the larger of the value and 1 for results
// of unit size.
constexpr double kError = 4e-16;

class Points {
  public:
    double between(double low, double high) {
        return low + (high - low) * ((random_() + 0.5) / 4294967296.0);
    }

  private:
    std::mt19937 random_{7};
};

TEST(DeterministicMath, SineAndCosineAgreeWithTheLibrary) {
    Points points;
    for (int i = 0; i < 200000; ++i) {
        const double x = points.between(-20.0, 20.0);
        ASSERT_NEAR(det::sin(x), std::sin(x), kError) << x;
        ASSERT_NEAR(det::cos(x), std::cos(x), kError) << x;
    }
    for (const double x :
         {0.0, 1e-300, 1e-9, det::kPi / 4, det::kPi / 2, det::kPi, 3 * det::kPi / 2, 100.0}) {
        EXPECT_NEAR(det::sin(x), std::sin(x), kError) << x;
        EXPECT_NEAR(det::sin(-x), -std::sin(x), kError) << x;
        EXPECT_NEAR(det::cos(x), std::cos(x), kError) << x;
    }
    EXPECT_EQ(det::sin(0.0), 0.0);
    EXPECT_EQ(det::cos(0.0), 1.0);
}

TEST(DeterministicMath, TangentAgreesWithTheLibrary) {
    Points points;
    for (int i = 0; i < 200000; ++i) {
        const double x = points.between(-1.5, 1.5);
        const double truth = std::tan(x);
        ASSERT_NEAR(det::tan(x), truth, 4 * kError * (1.0 + truth * truth)) << x;
    }
}

TEST(DeterministicMath, ArcTangentAgreesWithTheLibrary) {
    Points points;
    for (int i = 0; i < 200000; ++i) {
        const double x = points.between(-3.0, 3.0);
        ASSERT_NEAR(det::atan(x), std::atan(x), kError * 1.6) << x;
        const double wide = x * x * x * 1e4;
        ASSERT_NEAR(det::atan(wide), std::atan(wide), kError * 1.6) << wide;
    }
    // The joints of the argument's reduction.
    for (const double x : {0.0, 0.19891236737965800691, 0.41421356237309504880, 1.0})
        for (const double nudge : {-1e-15, 0.0, 1e-15})
            EXPECT_NEAR(det::atan(x + nudge), std::atan(x + nudge), kError) << x;
}

TEST(DeterministicMath, ArcTangentOfTwoCoversAllQuadrants) {
    Points points;
    for (int i = 0; i < 200000; ++i) {
        const double x = points.between(-2.0, 2.0);
        const double y = points.between(-2.0, 2.0);
        ASSERT_NEAR(det::atan2(y, x), std::atan2(y, x), 4.0 * kError) << y << " " << x;
    }
    EXPECT_EQ(det::atan2(0.0, 0.0), 0.0);
    EXPECT_DOUBLE_EQ(det::atan2(1.0, 0.0), det::kPi / 2);
    EXPECT_DOUBLE_EQ(det::atan2(-1.0, 0.0), -det::kPi / 2);
    EXPECT_DOUBLE_EQ(det::atan2(0.0, -1.0), det::kPi);
    EXPECT_EQ(det::atan2(0.0, 1.0), 0.0);
}

TEST(DeterministicMath, ArcSineAgreesWithTheLibraryAndClamps) {
    Points points;
    for (int i = 0; i < 200000; ++i) {
        const double x = points.between(-0.999, 0.999);
        ASSERT_NEAR(det::asin(x), std::asin(x), 2 * kError) << x;
    }
    EXPECT_DOUBLE_EQ(det::asin(1.0), det::kPi / 2);
    EXPECT_DOUBLE_EQ(det::asin(1.5), det::kPi / 2);
    EXPECT_DOUBLE_EQ(det::asin(-7.0), -det::kPi / 2);
}

TEST(DeterministicMath, ExponentialAgreesWithTheLibrary) {
    Points points;
    for (int i = 0; i < 200000; ++i) {
        const double x = points.between(-30.0, 30.0);
        const double truth = std::exp(x);
        ASSERT_NEAR(det::exp(x), truth, kError * truth) << x;
    }
    EXPECT_EQ(det::exp(0.0), 1.0);
    EXPECT_EQ(det::exp(-1000.0), 0.0);
    EXPECT_TRUE(std::isinf(det::exp(1000.0)));
}

TEST(DeterministicMath, DegreesAndRadiansAreInverse) {
    for (const double degrees : {-180.0, -5.0, 0.0, 12.0, 45.0, 360.0})
        EXPECT_NEAR(det::degrees(det::radians(degrees)), degrees, 1e-13);
    EXPECT_DOUBLE_EQ(det::radians(180.0), det::kPi);
}

}  // namespace
}  // namespace groundline
