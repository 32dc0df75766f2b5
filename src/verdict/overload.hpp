// Does processing keep up with the source? Decides from counts of skipped pairs, with hysteresis.
#pragma once

#include <cstdint>

namespace groundline::verdict {

struct OverloadLimits {
    std::int64_t window_ns = 1'000'000'000;
    // A newest-first hand-over skips a pair now and then from jitter alone; a fifth of all is no jitter, and
    // costs a robot at 1 m/s and 30 Hz 7 mm of reaction more.
    double enter_share = 0.2;
    double leave_share = 0.05;
    int enter_windows = 2;  // in a row
    int leave_windows = 5;
};

struct OverloadState {
    bool overloaded = false;
    bool open = false;  // a window has begun
    std::int64_t window_mono_ns = 0;
    std::uint64_t taken = 0;
    std::uint64_t skipped = 0;
    int windows = 0;  // in a row that speak against the present state
};

// The state after a pair was taken at `now_mono_ns` and `skipped` pairs before it were not. At the end of
// each window the share of skipped pairs is compared with the limit of the state at hand: enter_windows in a
// row above enter_share begin an overload, leave_windows in a row at or below leave_share end it.
OverloadState next_overload(const OverloadState& state, std::uint64_t skipped, std::int64_t now_mono_ns,
                            const OverloadLimits& limits);

}  // namespace groundline::verdict
