// Every loss has a counter with a name, raised where it happens.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string_view>

namespace groundline {

enum class Count : std::uint8_t {
    kFramesRead,         // pairs a source delivered
    kFramesBad,          // pairs a source could not read
    kFramesOverwritten,  // dropped before processing: a newer pair came
    kFramesProcessed,
    kFramesHalved,        // of those, at half the resolution
    kResolutionChanges,   // from full to half resolution or back
    kResultsOverwritten,  // dropped before the sinks: a newer result came
    kResultsDelivered,    // handed to all sinks
    kSinkFailures,
    kDisparityClamped,  // values outside what a disparity file can hold
    kPublishFailures,
    kHealthOverwritten,  // health reports dropped before they were sent: a newer one came
    kCameraGaps,         // pictures missing by a camera's own numbers
    kCameraDamaged,      // pictures that the camera itself calls damaged
    kCameraLeftOut,      // stale or empty buffers after a start
    kCameraSingles,      // pictures without one of the other eye
    kCameraSuperseded,   // pairs that a newer one replaced before they were read
    kCameraRestarts,     // cameras closed for a fault or because they stalled
    kAttitudesTaken,     // attitudes handed to the capture thread
    kAttitudesRefused,   // attitudes of another time, out of order or not numbers
    kCount,
};
inline constexpr std::array<std::string_view, static_cast<std::size_t>(Count::kCount)> kCountNames = {
    "frames_read",       "frames_bad",         "frames_overwritten",  "frames_processed",
    "frames_halved",     "resolution_changes", "results_overwritten", "results_delivered",
    "sink_failures",     "disparity_clamped",  "publish_failures",    "health_overwritten",
    "camera_gaps",       "camera_damaged",     "camera_left_out",     "camera_singles",
    "camera_superseded", "camera_restarts",    "attitudes_taken",     "attitudes_refused"};

// Raised from any thread, wait-free; a reader sees each counter on its own, not a common instant.
class Counters {
  public:
    void add(Count which, std::uint64_t amount = 1) {
        values_[static_cast<std::size_t>(which)].fetch_add(amount, std::memory_order_relaxed);
    }
    std::uint64_t get(Count which) const {
        return values_[static_cast<std::size_t>(which)].load(std::memory_order_relaxed);
    }

  private:
    std::array<std::atomic<std::uint64_t>, static_cast<std::size_t>(Count::kCount)> values_{};
};

}  // namespace groundline
