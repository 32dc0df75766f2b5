// The two clocks in use: monotonic nanoseconds for durations, microseconds since the epoch for messages.
#pragma once

#include <cstdint>

namespace groundline {

// CLOCK_MONOTONIC in nanoseconds.
std::int64_t now_mono_ns();
// CLOCK_REALTIME in microseconds since the epoch (LCM's utime).
std::int64_t now_utime_us();

}  // namespace groundline
