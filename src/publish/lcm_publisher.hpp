// The sink that tells other programs: one set of LCM messages per result, health at its own rate.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/counters.hpp"
#include "core/sink.hpp"
#include "publish/health.hpp"

struct _lcm_t;

namespace groundline::publish {

struct Channels {
    bool mask = true;
    bool sectors = true;
    bool ground = true;
    bool health = true;
    bool v_disparity = false;
    bool preview = false;
    bool grid = false;
    bool obstacles = false;
};

struct LcmOptions {
    std::string url;                    // empty: LCM_DEFAULT_URL, else LCM's default
    std::string prefix = "GROUNDLINE";  // channels are PREFIX_MASK, PREFIX_SECTORS, ...
    Channels channels;
    // Where kPublishFailures is raised and health reads its counts; may be null, else borrowed.
    Counters* counters = nullptr;
    // What results are noted in, for whoever reports on them elsewhere; borrowed. Null: one of the
    // publisher's own.
    HealthTracker* tracker = nullptr;
    std::int64_t health_period_ns = 100'000'000;
    // No result for that long means that pairs no longer arrive: five pairs at 10 Hz.
    std::int64_t stale_after_ns = 500'000'000;
    // Monotonic ns, for waiting and for durations; null means the computer's. Tests bring their own.
    std::int64_t (*clock)() = nullptr;
};

// A prefix as it is used; throws Refusal for one that is empty, too long or not of A-Z a-z 0-9 _ . / -.
std::string checked_prefix(const std::string& prefix);

// Used by one thread. All memory of ours is taken at construction; after that nothing of ours is allocated
// while messages go out (LCM itself takes a mutex and may allocate). When LCM cannot be opened, results are
// counted as not published and another attempt is made every second. No message is ever sent twice.
class LcmPublisher final : public Sink {
  public:
    // Throws Refusal for a malformed URL or a prefix that is empty, too long or not of A-Z a-z 0-9 _ . / -.
    explicit LcmPublisher(const LcmOptions& options);
    ~LcmPublisher() override;

    // Publishes the frame's messages, and health when it is due. False when any of them did not go out.
    bool consume(const FrameResult& result) override;
    const std::string& error() const override;

    // Any thread: what goes out from the next result on.
    void show(bool v_disparity, bool preview);

    // For times when no result comes, as often as one likes: health when it is due, and while pairs do not
    // arrive sectors_t saying so at the same rate. Never a mask. False when something did not go out.
    bool tick();
    // What health says from now on about things measured elsewhere.
    void set_host_health(const HostHealth& host);
    // Sends a last health that says stopping.
    void stop();

    const std::string& url() const;
    std::uint64_t open_failures() const;
    // Messages that LCM took, and those that were lost because it could not.
    std::uint64_t sent() const;
    std::uint64_t lost() const;
    // Where LCM is open, its handle, else nullptr: for subscribing on the same connection (memq:// in tests).
    _lcm_t* handle() const;

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

}  // namespace groundline::publish
