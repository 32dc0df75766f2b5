// Does every thread still make progress? Decides from counters whether the watchdog may be fed.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace groundline::verdict {

// Counts since the start. Each thread raises its own; a reader sees each one by itself.
struct Progress {
    std::uint64_t capture_turns = 0;  // of the capture loop, which goes on turning when no pairs come
    std::uint64_t captured = 0;       // pairs handed to processing
    std::uint64_t capture_lost = 0;   // of those, overwritten before processing took them
    std::uint64_t processed = 0;      // of those, handed to the sinks
    std::uint64_t results_lost = 0;   // of those, overwritten before the sinks took them
    std::uint64_t delivered = 0;      // of those, through all sinks
    std::uint64_t health_beats = 0;   // rounds of the thread that sends health
    bool in_device_call = false;      // capture is inside a call that opens, starts or closes devices
    bool thread_stopped = false;      // the kernel shows some thread of the process as stopped
};

// A kernel may take this long over such a call: a bus that has to time out three times over at 5 to 10 s
// each.
inline constexpr std::int64_t kLongestDeviceCallNs = 30'000'000'000;

enum class Stuck : std::uint8_t { kNone, kCapture, kProcessing, kSinks, kHealth, kOther };
inline constexpr std::array<std::string_view, 6> kStuckNames = {
    "", "capture", "processing", "sinks", "health", "the log, attitudes or a library"};

// What is remembered between two looks: when each part last moved or had nothing to do.
struct LivenessState {
    bool started = false;
    Progress seen;
    std::array<std::int64_t, 6> good_mono_ns{};  // by Stuck
};

struct Liveness {
    Stuck stuck = Stuck::kNone;  // the first in the order of Stuck that did not move for `limit_ns`
    std::int64_t still_ns = 0;   // for how long that part did not move
    LivenessState state;         // for the next look
};

// Capture and health must always move. Processing and sinks must move while something waits for them; without
// pairs (a camera is absent, and the capture loop turns) they are in order as they stand. Inside a device
// call capture has kLongestDeviceCallNs, if that is longer. Of the other threads (the log's, attitudes',
// libraries') there is no count of what they do; they may wait for as long as they like, but not be stopped.
// A look that comes late finds what moved in between.
Liveness judge_liveness(const Progress& progress, const LivenessState& state, std::int64_t now_mono_ns,
                        std::int64_t limit_ns);

}  // namespace groundline::verdict
