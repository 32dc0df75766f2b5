#include "verdict/overload.hpp"

namespace groundline::verdict {

OverloadState next_overload(const OverloadState& state, std::uint64_t skipped, std::int64_t now_mono_ns,
                            const OverloadLimits& limits) {
    OverloadState next = state;
    if (!next.open) {
        next.open = true;
        next.window_mono_ns = now_mono_ns;
    }
    ++next.taken;
    next.skipped += skipped;
    if (now_mono_ns - next.window_mono_ns < limits.window_ns) return next;

    const double share = static_cast<double>(next.skipped) / static_cast<double>(next.skipped + next.taken);
    const bool against = next.overloaded ? share <= limits.leave_share : share > limits.enter_share;
    next.windows = against ? next.windows + 1 : 0;
    if (next.windows >= (next.overloaded ? limits.leave_windows : limits.enter_windows)) {
        next.overloaded = !next.overloaded;
        next.windows = 0;
    }
    next.window_mono_ns = now_mono_ns;
    next.taken = 0;
    next.skipped = 0;
    return next;
}

}  // namespace groundline::verdict
