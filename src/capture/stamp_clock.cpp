#include "capture/stamp_clock.hpp"

namespace groundline::capture {
namespace {

// The kernel's test driver vivid stamps the end of a frame before it has come, by most of a period.
constexpr std::int64_t kAheadNs = 250'000'000;
constexpr std::int64_t kFreshNs = 1'000'000'000;
constexpr std::int64_t kOldestNs = 60'000'000'000;

bool within(std::int64_t stamp_ns, std::int64_t now_ns, std::int64_t oldest_ns) {
    return stamp_ns <= now_ns + kAheadNs && stamp_ns >= now_ns - oldest_ns;
}

}  // namespace

std::optional<StampClock::Stamp> StampClock::read(std::int64_t stamp_ns, Instant now) {
    if (clock_ == Clock::kUndecided) {
        if (within(stamp_ns, now.mono_ns, kFreshNs))
            clock_ = Clock::kMonotonic;
        else if (within(stamp_ns, now.real_ns, kFreshNs))
            clock_ = Clock::kRealtime;
        else if (++tries_ == kTries)
            clock_ = Clock::kNone;
        else
            return std::nullopt;
    }
    const std::int64_t shift_ns = clock_ == Clock::kRealtime ? now.real_ns - now.mono_ns : 0;
    const std::int64_t mono_ns = stamp_ns - shift_ns;
    if (clock_ == Clock::kNone || !within(mono_ns, now.mono_ns, kOldestNs)) return Stamp{now.mono_ns, false};
    return Stamp{mono_ns, true};
}

}  // namespace groundline::capture
