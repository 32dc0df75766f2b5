#include "publish/lcm_publisher.hpp"

#include <algorithm>
#include <atomic>
#include <string_view>

#include "core/clock.hpp"
#include "core/error.hpp"
#include "publish/lcm_link.hpp"
#include "publish/messages.hpp"

namespace groundline::publish {
namespace {

constexpr std::string_view kLongestSuffix = "_VDISPARITY";

}  // namespace

std::string checked_prefix(const std::string& prefix) {
    const bool plain = std::ranges::all_of(prefix, [](char c) {
        return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' ||
               c == '.' || c == '/' || c == '-';
    });
    if (prefix.empty() || !plain || prefix.size() + kLongestSuffix.size() > kMaxChannelBytes)
        throw Refusal(ExitStatus::kConfig, "LCM channel prefix '" + prefix +
                                               "' cannot be used: expected 1 to " +
                                               std::to_string(kMaxChannelBytes - kLongestSuffix.size()) +
                                               " characters of A-Z a-z 0-9 _ . / -");
    return prefix;
}

struct LcmPublisher::Parts {
    explicit Parts(const LcmOptions& from)
        : options(from),
          mask_channel(checked_prefix(from.prefix) + "_MASK"),
          sectors_channel(from.prefix + "_SECTORS"),
          ground_channel(from.prefix + "_GROUND"),
          health_channel(from.prefix + "_HEALTH"),
          v_disparity_channel(from.prefix + std::string(kLongestSuffix)),
          preview_channel(from.prefix + "_PREVIEW"),
          grid_channel(from.prefix + "_GRID"),
          obstacles_channel(from.prefix + "_OBSTACLES"),
          link(resolve_url(from.url)),
          own_tracker(from.counters, from.stale_after_ns),
          tracker(from.tracker != nullptr ? *from.tracker : own_tracker),
          v_disparity(from.channels.v_disparity),
          preview(from.channels.preview) {}

    std::int64_t now() const { return options.clock != nullptr ? options.clock() : now_mono_ns(); }

    // Nothing to say (empty) is no failure.
    bool send(const std::string& channel, MessageEncoder::Bytes message) {
        if (message.empty()) return true;
        if (link.send(channel, message, now())) {
            ++sent;
            return true;
        }
        ++lost;
        if (options.counters != nullptr) options.counters->add(Count::kPublishFailures);
        return false;
    }

    bool health_due() const {
        return !health_sent || now() - last_health_mono_ns >= options.health_period_ns;
    }

    bool send_health() {
        const std::int64_t mono_ns = now();
        health_sent = true;
        last_health_mono_ns = mono_ns;
        if (!options.channels.health) return true;
        HealthReport report = tracker.report(now_utime_us(), mono_ns);
        report.lcm_open_failures = static_cast<std::int64_t>(link.open_failures());
        return send(health_channel, encoder.health(report));
    }

    LcmOptions options;
    std::string mask_channel;
    std::string sectors_channel;
    std::string ground_channel;
    std::string health_channel;
    std::string v_disparity_channel;
    std::string preview_channel;
    std::string grid_channel;
    std::string obstacles_channel;
    LcmLink link;
    HealthTracker own_tracker;
    HealthTracker& tracker;
    std::atomic<bool> v_disparity;
    std::atomic<bool> preview;
    MessageEncoder encoder;
    bool health_sent = false;
    std::int64_t last_health_mono_ns = 0;
    std::uint64_t sent = 0;
    std::uint64_t lost = 0;
};

LcmPublisher::LcmPublisher(const LcmOptions& options) : parts_(std::make_unique<Parts>(options)) {}
LcmPublisher::~LcmPublisher() = default;

bool LcmPublisher::consume(const FrameResult& result) {
    Parts& parts = *parts_;
    const Channels& channels = parts.options.channels;
    MessageEncoder& encoder = parts.encoder;
    const std::int64_t start_ns = parts.now();
    bool good = true;
    if (channels.mask) good &= parts.send(parts.mask_channel, encoder.mask(result));
    if (channels.sectors) good &= parts.send(parts.sectors_channel, encoder.sectors(result));
    if (channels.ground) good &= parts.send(parts.ground_channel, encoder.ground(result));
    if (parts.v_disparity.load(std::memory_order_relaxed))
        good &= parts.send(parts.v_disparity_channel, encoder.v_disparity(result));
    if (parts.preview.load(std::memory_order_relaxed))
        good &= parts.send(parts.preview_channel, encoder.preview(result));
    if (channels.grid) good &= parts.send(parts.grid_channel, encoder.grid(result));
    if (channels.obstacles) good &= parts.send(parts.obstacles_channel, encoder.obstacles(result));
    const std::int64_t end_ns = parts.now();
    parts.tracker.note(result, end_ns - start_ns, end_ns);
    if (parts.health_due()) good &= parts.send_health();
    return good;
}

void LcmPublisher::show(bool v_disparity, bool preview) {
    parts_->v_disparity.store(v_disparity, std::memory_order_relaxed);
    parts_->preview.store(preview, std::memory_order_relaxed);
}

bool LcmPublisher::tick() {
    Parts& parts = *parts_;
    if (!parts.health_due()) return true;
    const std::int64_t mono_ns = parts.now();
    bool good = parts.send_health();
    if (parts.options.channels.sectors && parts.tracker.silent(mono_ns))
        good &=
            parts.send(parts.sectors_channel, parts.encoder.sectors_without_frames(now_utime_us(), mono_ns));
    return good;
}

void LcmPublisher::set_host_health(const HostHealth& host) {
    parts_->tracker.add(host);
}

void LcmPublisher::stop() {
    parts_->tracker.stop();
    parts_->send_health();
}

const std::string& LcmPublisher::error() const {
    return parts_->link.error();
}
const std::string& LcmPublisher::url() const {
    return parts_->link.url();
}
std::uint64_t LcmPublisher::open_failures() const {
    return parts_->link.open_failures();
}
std::uint64_t LcmPublisher::sent() const {
    return parts_->sent;
}
std::uint64_t LcmPublisher::lost() const {
    return parts_->lost;
}
_lcm_t* LcmPublisher::handle() const {
    return parts_->link.handle();
}

}  // namespace groundline::publish
