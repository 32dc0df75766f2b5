// Which clock a device's stamps are on, found by looking, and what they are on CLOCK_MONOTONIC.
#pragma once

#include <cstdint>
#include <optional>

namespace groundline::capture {

// A device says that its stamps are monotonic, says nothing (v4l2loopback), or says what is not so. Looked at
// is therefore the value: that of a picture just taken from the device lies between a second before and a
// quarter of one after now on the clock it is on, and the two clocks are decades apart. Pure.
class StampClock {
  public:
    enum class Clock : std::uint8_t { kUndecided, kMonotonic, kRealtime, kNone };
    struct Instant {
        std::int64_t mono_ns = 0;
        std::int64_t real_ns = 0;
    };
    struct Stamp {
        std::int64_t mono_ns = 0;
        bool devices_own = false;  // else it is the arrival
    };

    // The stamp of a picture that arrived at `now`. Nothing while undecided: it fits neither clock, as a
    // buffer left from before does; after kTries of these the device has no clock and arrivals stand in.
    // Decided, a stamp that lies further ahead of now or a minute and more before it (a wrapped or reset
    // counter) is replaced by the arrival.
    std::optional<Stamp> read(std::int64_t stamp_ns, Instant now);
    Clock clock() const { return clock_; }

    static constexpr int kTries = 8;

  private:
    Clock clock_ = Clock::kUndecided;
    int tries_ = 0;
};

}  // namespace groundline::capture
