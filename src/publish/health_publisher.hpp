// Sends what health says, on a connection of its own: also while the thread that publishes results is stuck.
#pragma once

#include <cstdint>
#include <string>

#include "publish/health.hpp"
#include "publish/lcm_link.hpp"
#include "publish/lcm_publisher.hpp"
#include "publish/messages.hpp"

namespace groundline::publish {

// Used by one thread, which LCM may hold up. All memory of ours is taken at construction.
class HealthPublisher {
  public:
    // Of `options` url, prefix, channels.sectors, counters and clock count. Throws Refusal for a malformed
    // URL or prefix.
    explicit HealthPublisher(const LcmOptions& options);

    // Sends the report, and where it says that no pairs come a sectors_t that says so too. False when
    // something did not go out: counted, with a sentence in error().
    bool publish(HealthReport report);
    const std::string& error() const { return link_.error(); }

  private:
    bool send(const std::string& channel, MessageEncoder::Bytes message, std::int64_t now_mono_ns);

    std::string health_channel_;
    std::string sectors_channel_;
    bool sectors_;
    Counters* counters_;
    std::int64_t (*clock_)();
    LcmLink link_;
    MessageEncoder encoder_;
};

}  // namespace groundline::publish
