// One connection to LCM that opens when it can: a robot without network at boot must still see.
#pragma once

#include <cstdint>
#include <span>
#include <string>

struct _lcm_t;

namespace groundline::publish {

// What LCM is opened with: `argument` if not empty, else the environment's LCM_DEFAULT_URL if not empty, else
// LCM's own default, which does not leave the computer (ttl=0).
std::string resolve_url(const std::string& argument);

// The IPv4 multicast group of a URL whose messages stay on this computer (udpm:// with ttl=0, or without
// ttl), else empty: what may be routed to the loopback interface.
std::string loopback_group(const std::string& url);

// Used by one thread; make one link for each thread that sends. Never throws after construction.
class LcmLink {
  public:
    static constexpr std::int64_t kRetryNs = 1'000'000'000;

    // Opens nothing yet. Throws Refusal (configuration) for a URL that is not PROVIDER://... with a provider
    // that LCM has.
    explicit LcmLink(std::string url);
    ~LcmLink();
    LcmLink(const LcmLink&) = delete;
    LcmLink& operator=(const LcmLink&) = delete;

    // Opens the link if it is closed and the last attempt is at least kRetryNs ago; true if it is open now.
    // Takes well under a millisecond where nothing is tried, and with udpm:// also where it is.
    bool open(std::int64_t now_mono_ns);
    // Hands bytes to LCM, opening the link as open() does. False when they were not sent. After kRetryNs of
    // nothing but failures the link is closed, to be opened afresh.
    bool send(const std::string& channel, std::span<const std::uint8_t> message, std::int64_t now_mono_ns);

    bool is_open() const { return lcm_ != nullptr; }
    // LCM's own handle while open, else nullptr; owned by the link. For subscriptions on the same connection.
    _lcm_t* handle() const { return lcm_; }
    const std::string& url() const { return url_; }
    std::uint64_t open_failures() const { return open_failures_; }
    // One sentence about what is wrong now; empty while all is well.
    const std::string& error() const { return error_; }

  private:
    void close();
    std::string why_not_open() const;

    std::string url_;
    _lcm_t* lcm_ = nullptr;
    bool tried_ = false;
    std::int64_t last_try_mono_ns_ = 0;
    bool failing_ = false;
    std::int64_t failing_since_mono_ns_ = 0;
    std::uint64_t open_failures_ = 0;
    std::string error_;
};

}  // namespace groundline::publish
