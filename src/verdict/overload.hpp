// Does processing keep up with the source, and if not, what is given up? Decides from counts of skipped pairs
// and from the time that pairs take, with hysteresis.
#pragma once

#include <cstdint>

namespace groundline::verdict {

// When pairs are looked at at half the resolution.
enum class HalfResolution : std::uint8_t {
    kNever,
    kWhenOverloaded,  // where skipping pairs does not suffice, or a pair's recorded mode says so
    kAlways,
};

struct OverloadLimits {
    std::int64_t window_ns = 1'000'000'000;
    // A newest-first hand-over skips a pair now and then from jitter alone; a fifth of all is no jitter, and
    // costs a robot at 1 m/s and 30 Hz 7 mm of reaction more.
    double enter_share = 0.2;
    double leave_share = 0.05;
    int enter_windows = 2;  // in a row
    int leave_windows = 5;

    bool may_halve = false;
    // Of an overload, in a row above enter_share: skipping alone had its time.
    int halve_windows = 3;
    // Full resolution fits where a pair would take at most this share of the source's period; the rest is for
    // jitter, of the source and of the machine.
    double fitting_share = 0.8;
    // No more than that is believed of what full resolution costs: four times the pixels, and matching twice
    // the disparities.
    double most_ratio = 8.0;
    // For so many waits full resolution is held to be too much; then it is tried all the same, because the
    // estimate may rest on a disturbance.
    int trial_waits = 12;
    // To which the wait doubles while returns fail, windows.
    int longest_wait = 80;
};

struct OverloadState {
    bool overloaded = false;
    bool half = false;  // what the next pair is to be looked at
    bool open = false;  // a window has begun
    std::int64_t window_mono_ns = 0;
    std::uint64_t taken = 0;
    std::uint64_t skipped = 0;
    std::int64_t busy_ns = 0;
    int windows = 0;  // in a row that speak against the present state of overload
    int lasting = 0;  // of the overload, in a row above enter_share

    int since = 0;         // windows at this resolution
    int fitting = 0;       // at half resolution, in a row, that say that full would fit
    int wait = 0;          // how many it takes
    bool proving = false;  // back at full resolution for less than a wait
    double full_ns = 0.0;  // what a pair took in the last window at full resolution
    double ratio = 0.0;    // that over what it took in the first window at half; 0 before its end
};

// Of a pair that was taken.
struct Taken {
    std::uint64_t skipped = 0;     // pairs before it that were not
    std::int64_t busy_ns = 0;      // what the pair taken before it kept the processing thread
    std::int64_t now_mono_ns = 0;  // when it was taken
};

// The state after a pair was taken. At the end of each window:
//
// - Overload: the share of skipped pairs is compared with the limit of the state at hand: enter_windows in a
//   row above enter_share begin an overload, leave_windows in a row at or below leave_share end it.
// - To half resolution: where the overload lasts, halve_windows in a row above enter_share. It stays an
//   overload, because something is given up, though hardly a pair may be skipped.
// - Back: at half resolution nothing is skipped, so skips cannot tell whether full would fit; time can. What
//   a pair takes now, times what full resolution took over half resolution about the change, against the
//   period of the source: `wait` windows in a row at or below fitting_share, and at or below leave_share of
//   skips, bring full resolution back. So do trial_waits waits without any such luck.
// - Against flapping: an overload within a wait of the return leads back at once and doubles the wait. So
//   under a steady load no more than a twentieth of the time goes into trying. Once a return has lasted for a
//   wait, the wait is leave_windows again.
OverloadState next_overload(const OverloadState& state, const Taken& pair, const OverloadLimits& limits);

}  // namespace groundline::verdict
