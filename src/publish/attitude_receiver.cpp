#include "publish/attitude_receiver.hpp"

#include <lcm/lcm.h>

#include <chrono>
#include <optional>
#include <string>
#include <thread>

#include "core/clock.hpp"
#include "groundline/attitude_t.hpp"
#include "publish/lcm_link.hpp"

namespace groundline::publish {
namespace {

// Older ones tell nothing about a picture still to come, younger ones come from a clock that is not ours.
constexpr std::int64_t kOldestUs = 1'000'000;
constexpr std::int64_t kAheadUs = 5'000;

// LCM takes the name of a channel for a regular expression.
std::string pattern_of(const std::string& name) {
    std::string pattern;
    for (const char letter : name)
        pattern += letter == '.' ? std::string("[.]") : std::string(1, letter);
    return pattern;
}

void receive_message(const lcm_recv_buf_t* message, const char* /*channel*/, void* user) {
    static_cast<AttitudeReceiver*>(user)->take(message->data, message->data_size);
}

}  // namespace

struct AttitudeReceiver::Parts {
    Parts(const LcmOptions& from, pipeline::AttitudeHandOver& to)
        : options(from),
          channel(pattern_of(checked_prefix(from.prefix)) + "_ATTITUDE"),
          link(std::in_place, resolve_url(from.url)),
          out(to) {}

    std::int64_t now() const { return options.clock != nullptr ? options.clock() : now_mono_ns(); }

    LcmOptions options;
    std::string channel;
    std::optional<LcmLink> link;
    pipeline::AttitudeHandOver& out;
    pipeline::AttitudeHistory history;
    bool subscribed = false;
    std::int64_t heard_mono_ns = 0;  // or subscribed
    attitude_t message{};
};

AttitudeReceiver::AttitudeReceiver(const LcmOptions& options, pipeline::AttitudeHandOver& out)
    : parts_(std::make_unique<Parts>(options, out)) {}
AttitudeReceiver::~AttitudeReceiver() = default;

_lcm_t* AttitudeReceiver::handle() const {
    return parts_->link->handle();
}

void AttitudeReceiver::receive(int wait_ms) {
    Parts& parts = *parts_;
    if (!parts.subscribed && parts.link->open(parts.now())) {
        parts.subscribed =
            lcm_subscribe(parts.link->handle(), parts.channel.c_str(), receive_message, this) != nullptr;
        parts.heard_mono_ns = parts.now();
    }
    const bool failed = parts.subscribed && lcm_handle_timeout(parts.link->handle(), wait_ms) < 0;
    if (!parts.subscribed || failed) std::this_thread::sleep_for(std::chrono::milliseconds(wait_ms));
    if (failed || (parts.subscribed && parts.now() - parts.heard_mono_ns >= kSilentNs)) {
        const std::string url = parts.link->url();  // emplace() ends the one it is taken from first
        parts.link.emplace(url);
        parts.subscribed = false;
    }
}

void AttitudeReceiver::take(const void* bytes, std::uint32_t size) {
    using Taken = pipeline::AttitudeHistory::Taken;
    Parts& parts = *parts_;
    attitude_t& message = parts.message;
    parts.heard_mono_ns = parts.now();
    Taken taken = Taken::kRefused;
    if (message.decode(bytes, 0, static_cast<int>(size)) == static_cast<int>(size)) {
        const std::int64_t utime_us = now_utime_us();
        // By age, because the wall clock may be set at any time and the monotonic one is that of the
        // pictures.
        if (message.utime >= utime_us - kOldestUs && message.utime <= utime_us + kAheadUs)
            taken = parts.history.add({parts.now() - 1000 * (utime_us - message.utime), message.pitch_rad,
                                       message.roll_rad, message.sigma_rad});
    }
    if (taken != Taken::kTooClose && parts.options.counters != nullptr)
        parts.options.counters->add(taken == Taken::kKept ? Count::kAttitudesTaken
                                                          : Count::kAttitudesRefused);
    if (taken != Taken::kKept) return;
    *parts.out.begin_write() = parts.history;
    parts.out.commit();
}

}  // namespace groundline::publish
