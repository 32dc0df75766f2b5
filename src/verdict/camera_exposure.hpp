// The right camera takes over the left one's exposure and gain: two automatics never agree.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

namespace groundline::verdict {

// NaN where a device has no such control or does not say.
struct ExposureValues {
    double exposure_us = std::numeric_limits<double>::quiet_NaN();
    double gain = std::numeric_limits<double>::quiet_NaN();  // in the cameras' own units
};

struct FollowLimits {
    // Smaller differences are left alone: 3 % of exposure are under two grey levels in 50.
    double least_change = 0.03;
    // Pairs from a command to its effect, and to be sure of it: sensors take 3 to 4.
    int latency_pairs = 6;
    // A command that had no effect (limits, steps of the other device) is repeated no sooner.
    int repeat_pairs = 150;
};

struct FollowState {
    bool commanded = false;
    ExposureValues command;         // the last
    std::int64_t command_pair = 0;  // when
};

struct FollowStep {
    FollowState state;
    std::optional<ExposureValues> set;  // for the right camera; NaN: leave that one alone
};

// `left` and `right` are what the cameras use at pair `pair`. Compared is with what the right one says, where
// it says anything, else with what it was told last. Pure.
FollowStep follow(const FollowState& state, const ExposureValues& left, const ExposureValues& right,
                  std::int64_t pair, const FollowLimits& limits);

}  // namespace groundline::verdict
