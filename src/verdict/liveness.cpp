#include "verdict/liveness.hpp"

#include <algorithm>

namespace groundline::verdict {

Liveness judge_liveness(const Progress& progress, const LivenessState& state, std::int64_t now_mono_ns,
                        std::int64_t limit_ns) {
    const Progress& seen = state.seen;
    // The counters are read one after the other, so a sum may be ahead of its parts: never subtract.
    const bool for_processing = progress.captured > progress.capture_lost + progress.processed;
    const bool for_sinks = progress.processed > progress.results_lost + progress.delivered;
    // Coming back from a device is a move, though the loop has not turned yet.
    const bool captures =
        progress.capture_turns != seen.capture_turns || progress.in_device_call != seen.in_device_call;
    const std::array<bool, 6> good = {true,
                                      captures,
                                      progress.processed != seen.processed || !for_processing,
                                      progress.delivered != seen.delivered || !for_sinks,
                                      progress.health_beats != seen.health_beats,
                                      !progress.thread_stopped};
    Liveness result;
    result.state = {true, progress, state.good_mono_ns};
    for (std::size_t part = 0; part < good.size(); ++part) {
        std::int64_t& last = result.state.good_mono_ns[part];
        if (good[part] || !state.started) last = now_mono_ns;
        const bool in_device = progress.in_device_call && static_cast<Stuck>(part) == Stuck::kCapture;
        const std::int64_t part_limit_ns = in_device ? std::max(limit_ns, kLongestDeviceCallNs) : limit_ns;
        if (result.stuck != Stuck::kNone || now_mono_ns - last < part_limit_ns) continue;
        result.stuck = static_cast<Stuck>(part);
        result.still_ns = now_mono_ns - last;
    }
    return result;
}

}  // namespace groundline::verdict
