// From results to the bytes of the LCM messages: a function of the result alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "core/result.hpp"
#include "publish/health.hpp"

namespace groundline::publish {

// LCM sends up to this much in one UDP datagram, channel name and its NUL included; what is larger is cut
// into fragments, of which receivers with default socket buffers lose most.
inline constexpr std::size_t kMaxDatagramBytes = 65'499;
inline constexpr std::size_t kMaxChannelBytes = 63;
inline constexpr std::size_t kMaxMessageBytes = kMaxDatagramBytes - kMaxChannelBytes - 1;

// Used by one thread. All memory is taken at construction. Each function gives the encoded message, valid
// until the next call; it always fits kMaxMessageBytes. Where the verdict is blind no class, sector or ground
// of the result is shown, whatever it holds: the mask is unknown all over.
class MessageEncoder {
  public:
    using Bytes = std::span<const std::uint8_t>;

    MessageEncoder();
    ~MessageEncoder();

    Bytes mask(const FrameResult& result);
    Bytes sectors(const FrameResult& result);
    Bytes ground(const FrameResult& result);
    // Empty where the result has no histogram, or its disparities alone are more than a message holds.
    Bytes v_disparity(const FrameResult& result);
    Bytes preview(const FrameResult& result);
    // Empty where the result has no grid.
    Bytes grid(const FrameResult& result);
    Bytes obstacles(const FrameResult& result);
    Bytes health(const HealthReport& report);
    // The sectors_t that says that no pairs arrive; stamps are those of sending.
    Bytes sectors_without_frames(std::int64_t now_utime_us, std::int64_t now_mono_ns);

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

}  // namespace groundline::publish
