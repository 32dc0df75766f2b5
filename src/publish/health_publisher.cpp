#include "publish/health_publisher.hpp"

#include "core/clock.hpp"

namespace groundline::publish {

HealthPublisher::HealthPublisher(const LcmOptions& options)
    : health_channel_(checked_prefix(options.prefix) + "_HEALTH"),
      sectors_channel_(options.prefix + "_SECTORS"),
      sectors_(options.channels.sectors),
      counters_(options.counters),
      clock_(options.clock != nullptr ? options.clock : now_mono_ns),
      link_(resolve_url(options.url)) {}

bool HealthPublisher::publish(HealthReport report) {
    const std::int64_t mono_ns = clock_();
    report.lcm_open_failures = static_cast<std::int64_t>(link_.open_failures());
    bool good = send(health_channel_, encoder_.health(report), mono_ns);
    if (sectors_ && report.reasons.has(Reason::kNoFrames))
        good &= send(sectors_channel_, encoder_.sectors_without_frames(report.utime_us, mono_ns), mono_ns);
    return good;
}

bool HealthPublisher::send(const std::string& channel, MessageEncoder::Bytes message,
                           std::int64_t now_mono_ns) {
    if (link_.send(channel, message, now_mono_ns)) return true;
    if (counters_ != nullptr) counters_->add(Count::kPublishFailures);
    return false;
}

}  // namespace groundline::publish
