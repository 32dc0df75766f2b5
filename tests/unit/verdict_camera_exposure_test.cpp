// The follower against two simulated cameras with control latency: it settles, and it does not fidget.
#include "verdict/camera_exposure.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <deque>

namespace groundline::verdict {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr FollowLimits kLimits;

TEST(CameraExposure, TableOfFirstSteps) {
    struct Case {
        ExposureValues left;
        ExposureValues right;
        bool set;
    };
    for (const Case& c : {Case{{5000, 10}, {5000, 10}, false},
                          {{5000, 10}, {5100, 10}, false},  // 2 %
                          {{5000, 10}, {5200, 10}, true},   // 4 %
                          {{5000, 10}, {5000, 11}, true},
                          {{5000, kUnknown}, {5000, 3}, false},  // nothing to take over
                          {{kUnknown, kUnknown}, {100, 3}, false},
                          {{5000, 10}, {kUnknown, kUnknown}, true},
                          {{5000, 0}, {5000, 0}, false}}) {
        const FollowStep step = follow({}, c.left, c.right, 0, kLimits);
        EXPECT_EQ(step.set.has_value(), c.set) << c.left.exposure_us << " " << c.right.exposure_us;
        if (step.set && !std::isnan(c.left.exposure_us)) {
            EXPECT_EQ(step.set->exposure_us, c.left.exposure_us);
        }
        EXPECT_EQ(step.state.commanded, c.set);
    }
}

// A right camera that takes a command over `latency` pairs later, in steps of `quantum`, up to `most`.
struct SlowCamera {
    ExposureValues value{20000, 4};
    int latency = 4;
    double quantum = 1.0;
    double most = 1e9;
    bool mute = false;  // says nothing of what it uses
    std::deque<std::pair<std::int64_t, ExposureValues>> due;
    int commands = 0;

    ExposureValues at(std::int64_t pair) {
        while (!due.empty() && due.front().first <= pair) {
            value.exposure_us =
                std::min(most, std::round(due.front().second.exposure_us / quantum) * quantum);
            value.gain = due.front().second.gain;
            due.pop_front();
        }
        return mute ? ExposureValues{} : value;
    }
    void command(std::int64_t pair, const ExposureValues& wanted) {
        due.emplace_back(pair + latency, wanted);
        ++commands;
    }
};

int run(SlowCamera& camera, double (*left_us)(std::int64_t), std::int64_t pairs) {
    FollowState state;
    for (std::int64_t pair = 0; pair < pairs; ++pair) {
        const FollowStep step = follow(state, {left_us(pair), 8}, camera.at(pair), pair, kLimits);
        state = step.state;
        if (step.set) camera.command(pair, *step.set);
    }
    camera.at(pairs + 100);
    return camera.commands;
}

TEST(CameraExposure, OneCommandIsEnoughForASteadyLeftCamera) {
    for (const bool mute : {false, true}) {
        SlowCamera camera;
        camera.mute = mute;
        EXPECT_EQ(run(
                      camera, [](std::int64_t) { return 8000.0; }, 1000),
                  1)
            << mute;
        EXPECT_EQ(camera.value.exposure_us, 8000);
        EXPECT_EQ(camera.value.gain, 8);
    }
}

TEST(CameraExposure, FollowsASlopeWithNoMoreThanOneCommandALatency) {
    SlowCamera camera;
    const auto slope = [](std::int64_t pair) { return 2000.0 + 100.0 * static_cast<double>(pair); };
    EXPECT_LE(run(camera, slope, 300), 300 / kLimits.latency_pairs + 1);
    EXPECT_GT(camera.commands, 10);
    EXPECT_NEAR(camera.value.exposure_us, 32000, 0.05 * 32000);
}

TEST(CameraExposure, WhatTheRightCameraCannotDoIsNotAskedAllTheTime) {
    SlowCamera camera;
    camera.most = 5000;
    EXPECT_EQ(run(
                  camera, [](std::int64_t) { return 8000.0; }, 600),
              4);  // at 0, 150, 300, 450
}

TEST(CameraExposure, LetsARightCameraThatWasResetFollowAgain) {
    SlowCamera camera;
    FollowState state;
    for (std::int64_t pair = 0; pair < 400; ++pair) {
        if (pair == 200) camera.value = {100, 1};  // by itself
        const FollowStep step = follow(state, {8000, 8}, camera.at(pair), pair, kLimits);
        state = step.state;
        if (step.set) camera.command(pair, *step.set);
    }
    EXPECT_EQ(camera.commands, 2);
    EXPECT_EQ(camera.value.exposure_us, 8000);
}

}  // namespace
}  // namespace groundline::verdict
