// libcamera's stamps are on CLOCK_BOOTTIME by its documentation; some of its handlers pass monotonic ones on.
#pragma once

#include <cstdint>

namespace groundline::capture {

// `stamp_ns` on CLOCK_MONOTONIC, given both clocks when the picture arrived. They differ by the time the
// computer has slept. A picture arrives within a second of its exposure, so the stamp lies at most that
// before one of them; where it does so before both, or before neither, it is taken as monotonic.
constexpr std::int64_t monotonic_stamp(std::int64_t stamp_ns, std::int64_t arrival_mono_ns,
                                       std::int64_t arrival_boot_ns) {
    constexpr std::int64_t kLatest = 1'000'000'000;
    const auto just_before = [&](std::int64_t arrival_ns) {
        return stamp_ns <= arrival_ns && arrival_ns - stamp_ns <= kLatest;
    };
    if (just_before(arrival_boot_ns) && !just_before(arrival_mono_ns))
        return stamp_ns - (arrival_boot_ns - arrival_mono_ns);
    return stamp_ns;
}

}  // namespace groundline::capture
