#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/deterministic_math.hpp"
#include "core/ground.hpp"

namespace groundline {
namespace {

class Dice {
  public:
    explicit Dice(std::uint32_t seed) : random_(seed) {}
    double between(double low, double high) {
        return low + (high - low) * ((random_() + 0.5) / 4294967296.0);
    }

  private:
    std::mt19937 random_;
};

RectifiedRig random_rig(Dice& dice) {
    RectifiedRig rig;
    rig.width = 640;
    rig.height = 480;
    rig.calibrated = true;
    rig.focal_px = dice.between(300, 900);
    rig.cx_px = dice.between(280, 360);
    rig.cy_px = dice.between(200, 280);
    rig.cx_right_px = rig.cx_px + dice.between(-40, 40);
    rig.baseline_m = dice.between(0.05, 0.6);
    return rig;
}

GroundPose random_pose(Dice& dice) {
    return {det::radians(dice.between(-10, 50)), det::radians(dice.between(-20, 20)), dice.between(0.2, 2.5)};
}

// The same geometry written in space: n P = h with P = Z ((u - cx)/f, (v - cy)/f, 1).
struct Space {
    GroundPose pose;
    RectifiedRig rig;

    double along_normal(double u, double v) const {
        const double nx = std::sin(pose.roll_rad) * std::cos(pose.pitch_rad);
        const double ny = std::cos(pose.roll_rad) * std::cos(pose.pitch_rad);
        const double nz = std::sin(pose.pitch_rad);
        return (nx * (u - rig.cx_px) + ny * (v - rig.cy_px)) / rig.focal_px + nz;
    }
    // Depth at which the pixel's ray is `height_m` above the ground.
    double depth(double u, double v, double height_m) const {
        return (pose.height_m - height_m) / along_normal(u, v);
    }
};

TEST(GroundG1, HeightOfTheGroundIsZeroAndOfABoxTopItsHeight) {
    Dice dice(1);
    int tested = 0;
    for (int i = 0; i < 20000; ++i) {
        const RectifiedRig rig = random_rig(dice);
        const GroundPose pose = random_pose(dice);
        const Space space{pose, rig};
        const double u = dice.between(0, 639);
        const double v = dice.between(0, 479);
        const double top_m = dice.between(0.0, 0.9) * pose.height_m;
        const double depth_m = space.depth(u, v, top_m);
        if (!(depth_m > 0.1 && depth_m < 100.0)) continue;
        ++tested;
        const double d_px = rig.focal_px * rig.baseline_m / depth_m;
        const double ground_px = plane_of(pose, rig).at(u, v) - rig.offset_px();
        EXPECT_NEAR(height_above_ground(pose.height_m, ground_px, d_px), top_m, 1e-9);
        EXPECT_EQ(height_above_ground(pose.height_m, ground_px, ground_px), 0.0);
    }
    EXPECT_GT(tested, 5000);
}

TEST(GroundG2, PoseToPlaneAndBackIsExact) {
    Dice dice(2);
    for (int i = 0; i < 20000; ++i) {
        const RectifiedRig rig = random_rig(dice);
        const GroundPose pose = random_pose(dice);
        const GroundPose back = pose_of(plane_of(pose, rig), rig);
        EXPECT_NEAR(back.pitch_rad, pose.pitch_rad, 1e-9);
        EXPECT_NEAR(back.roll_rad, pose.roll_rad, 1e-9);
        EXPECT_NEAR(back.height_m, pose.height_m, 1e-9);
    }
}

// Without roll: d = beta (v - v_h), v_h = cy - f tan(pitch), beta = b cos(pitch) / h.
TEST(GroundG3, WithoutRollThePlaneIsTheLineOfTheVDisparity) {
    Dice dice(3);
    for (int i = 0; i < 2000; ++i) {
        const RectifiedRig rig = random_rig(dice);
        GroundPose pose = random_pose(dice);
        pose.roll_rad = 0.0;
        const DisparityPlane plane = plane_of(pose, rig);
        EXPECT_EQ(plane.du, 0.0);
        const double horizon = rig.cy_px - rig.focal_px * std::tan(pose.pitch_rad);
        const double slope = rig.baseline_m * std::cos(pose.pitch_rad) / pose.height_m;
        EXPECT_NEAR(plane.dv, slope, 1e-12);
        for (const double v : {0.0, 200.0, 479.0})
            EXPECT_NEAR(plane.at(dice.between(0, 639), v), slope * (v - horizon) + rig.offset_px(), 1e-9);
        // With roll the horizon tilts: v_h(u) = cy - f tan(pitch)/cos(roll) - (u - cx) tan(roll).
        pose.roll_rad = det::radians(dice.between(-20, 20));
        const DisparityPlane rolled = plane_of(pose, rig);
        const double u = dice.between(0, 639);
        const double row = rig.cy_px - rig.focal_px * std::tan(pose.pitch_rad) / std::cos(pose.roll_rad) -
                           (u - rig.cx_px) * std::tan(pose.roll_rad);
        EXPECT_NEAR(rolled.at(u, row), rig.offset_px(), 1e-9);
    }
}

// Points of one height H lie at d = d_g h/(h - H): a plane through the same horizon as the ground's.
TEST(GroundG4, WedgeLimitsMeetAtTheHorizon) {
    Dice dice(4);
    for (int i = 0; i < 2000; ++i) {
        const RectifiedRig rig = random_rig(dice);
        const GroundPose pose = random_pose(dice);
        const DisparityPlane plane = plane_of(pose, rig);
        const double u = dice.between(0, 639);
        const double horizon = -(plane.du * u + plane.d0 - rig.offset_px()) / plane.dv;
        for (const double share : {-0.3, 0.15, 0.6}) {
            const auto limit = [&](double v) { return (plane.at(u, v) - rig.offset_px()) / (1.0 - share); };
            EXPECT_NEAR(limit(horizon), 0.0, 1e-9);
            const double below = horizon + dice.between(5, 300);
            EXPECT_NEAR(
                height_above_ground(pose.height_m, plane.at(u, below) - rig.offset_px(), limit(below)),
                share * pose.height_m, 1e-9);
        }
    }
}

TEST(GroundG5, ScalingTheBaselineScalesDisparityAndNothingElse) {
    Dice dice(5);
    for (int i = 0; i < 2000; ++i) {
        RectifiedRig rig = random_rig(dice);
        rig.cx_right_px = rig.cx_px;
        const GroundPose pose = random_pose(dice);
        const double factor = dice.between(0.3, 3.0);
        RectifiedRig scaled = rig;
        scaled.baseline_m *= factor;
        const DisparityPlane plane = plane_of(pose, rig);
        const DisparityPlane other = plane_of(pose, scaled);
        const double u = dice.between(0, 639);
        const double v = dice.between(0, 479);
        EXPECT_NEAR(other.at(u, v), factor * plane.at(u, v), 1e-9);
        const GroundPose back = pose_of(other, scaled);
        EXPECT_NEAR(back.pitch_rad, pose.pitch_rad, 1e-9);
        EXPECT_NEAR(back.height_m, pose.height_m, 1e-9);
        const double d_px = dice.between(5, 60);
        EXPECT_NEAR(height_above_ground(pose.height_m, other.at(u, v), factor * d_px),
                    height_above_ground(pose.height_m, plane.at(u, v), d_px), 1e-9);
    }
}

TEST(GroundG6, HalfResolutionHalvesDisparityAndKeepsThePose) {
    Dice dice(6);
    for (int i = 0; i < 2000; ++i) {
        const RectifiedRig rig = random_rig(dice);
        RectifiedRig half = rig;
        half.focal_px /= 2;
        half.cx_px /= 2;
        half.cy_px /= 2;
        half.cx_right_px /= 2;
        const GroundPose pose = random_pose(dice);
        const double u = dice.between(0, 639);
        const double v = dice.between(0, 479);
        EXPECT_NEAR(plane_of(pose, half).at(u / 2, v / 2), plane_of(pose, rig).at(u, v) / 2, 1e-9);
    }
}

// The Jacobian behind the sigmas, against finite differences of pose_of.
TEST(Ground, SigmasFollowTheCovarianceToFirstOrder) {
    Dice dice(7);
    for (int i = 0; i < 500; ++i) {
        const RectifiedRig rig = random_rig(dice);
        const DisparityPlane plane = plane_of(random_pose(dice), rig);
        double a[3][3];
        const double unit[3] = {1e-5, 1e-5, 1e-2};
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c)
                a[r][c] = unit[r] * dice.between(-1, 1);
        std::array<double, 9> covariance{};
        for (std::size_t r = 0; r < 3; ++r)
            for (std::size_t c = 0; c < 3; ++c)
                for (std::size_t k = 0; k < 3; ++k)
                    covariance[3 * r + c] += a[r][k] * a[c][k];
        // Var = sum over the columns of A of (directional derivative)^2.
        double pitch = 0.0;
        double roll = 0.0;
        double height = 0.0;
        for (int k = 0; k < 3; ++k) {
            constexpr double kStep = 1e-3;
            DisparityPlane more = plane;
            DisparityPlane less = plane;
            more.du += kStep * a[0][k];
            more.dv += kStep * a[1][k];
            more.d0 += kStep * a[2][k];
            less.du -= kStep * a[0][k];
            less.dv -= kStep * a[1][k];
            less.d0 -= kStep * a[2][k];
            const GroundPose high = pose_of(more, rig);
            const GroundPose low = pose_of(less, rig);
            pitch += std::pow((high.pitch_rad - low.pitch_rad) / (2 * kStep), 2);
            roll += std::pow((high.roll_rad - low.roll_rad) / (2 * kStep), 2);
            height += std::pow((high.height_m - low.height_m) / (2 * kStep), 2);
        }
        const GroundPose sigma = pose_sigma(plane, covariance, rig);
        EXPECT_NEAR(sigma.pitch_rad, std::sqrt(pitch), 1e-4 * std::sqrt(pitch) + 1e-12);
        EXPECT_NEAR(sigma.roll_rad, std::sqrt(roll), 1e-4 * std::sqrt(roll) + 1e-12);
        EXPECT_NEAR(sigma.height_m, std::sqrt(height), 1e-4 * std::sqrt(height) + 1e-12);
    }
}

}  // namespace
}  // namespace groundline
