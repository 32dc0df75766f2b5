#include "verdict/overload.hpp"

#include <algorithm>

namespace groundline::verdict {
namespace {

// What one window showed.
struct Window {
    double skipped_share;
    double pair_ns;    // that processing was busy with, on average
    double period_ns;  // of the source
};

void change_resolution(OverloadState& state, bool half) {
    state.half = half;
    state.overloaded = half;
    state.proving = !half;
    state.since = state.fitting = state.windows = state.lasting = 0;
}

void judge_overload(OverloadState& state, const Window& window, const OverloadLimits& limits) {
    const bool bad = window.skipped_share > limits.enter_share;
    state.lasting = state.overloaded && bad ? state.lasting + 1 : 0;
    const bool against = state.overloaded ? window.skipped_share <= limits.leave_share : bad;
    state.windows = against ? state.windows + 1 : 0;
    if (state.windows < (state.overloaded ? limits.leave_windows : limits.enter_windows)) return;
    state.overloaded = !state.overloaded;
    state.windows = 0;
}

void judge_full(OverloadState& state, const Window& window, const OverloadLimits& limits) {
    judge_overload(state, window, limits);
    if (!limits.may_halve) return;
    const bool relapse = state.proving && state.overloaded;
    if (relapse || state.lasting >= limits.halve_windows) {
        if (relapse) state.wait = std::min(2 * state.wait, limits.longest_wait);
        change_resolution(state, true);
        state.full_ns = window.pair_ns;
        state.ratio = 0.0;
    } else if (state.proving && state.since >= state.wait) {
        state.proving = false;
        state.wait = limits.leave_windows;
    }
}

void judge_half(OverloadState& state, const Window& window, const OverloadLimits& limits) {
    if (state.ratio <= 0.0)
        state.ratio = std::clamp(state.full_ns / std::max(window.pair_ns, 1.0), 1.0, limits.most_ratio);
    const bool calm = window.skipped_share <= limits.leave_share;
    const bool fits = calm && window.pair_ns * state.ratio <= limits.fitting_share * window.period_ns;
    state.fitting = fits ? state.fitting + 1 : 0;
    if (state.fitting >= state.wait || (calm && state.since >= limits.trial_waits * state.wait))
        change_resolution(state, false);
}

}  // namespace

OverloadState next_overload(const OverloadState& state, const Taken& pair, const OverloadLimits& limits) {
    OverloadState next = state;
    if (!next.open) {
        next.open = true;
        next.window_mono_ns = pair.now_mono_ns;
        next.wait = limits.leave_windows;
    }
    ++next.taken;
    next.skipped += pair.skipped;
    next.busy_ns += pair.busy_ns;
    const std::int64_t elapsed_ns = pair.now_mono_ns - next.window_mono_ns;
    if (elapsed_ns < limits.window_ns) return next;

    const auto taken = static_cast<double>(next.taken);
    const auto skipped = static_cast<double>(next.skipped);
    const Window window{skipped / (skipped + taken), static_cast<double>(next.busy_ns) / taken,
                        static_cast<double>(elapsed_ns) / (skipped + taken)};
    ++next.since;
    if (next.half)
        judge_half(next, window, limits);
    else
        judge_full(next, window, limits);
    next.window_mono_ns = pair.now_mono_ns;
    next.taken = 0;
    next.skipped = 0;
    next.busy_ns = 0;
    return next;
}

}  // namespace groundline::verdict
