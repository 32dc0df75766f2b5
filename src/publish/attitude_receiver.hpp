// Receives the camera's attitude over LCM and hands it on.
#pragma once

#include <cstdint>
#include <memory>

#include "pipeline/attitude_history.hpp"
#include "publish/lcm_publisher.hpp"

namespace groundline::publish {

// Used by one thread, which LCM may hold up.
class AttitudeReceiver {
  public:
    static constexpr std::int64_t kSilentNs = 5'000'000'000;

    // Of `options` url, prefix, counters and clock count. Throws Refusal for a malformed URL or prefix.
    AttitudeReceiver(const LcmOptions& options, pipeline::AttitudeHandOver& out);
    ~AttitudeReceiver();

    // Waits up to `wait_ms` for attitudes, opening LCM where it is not open (then it only waits), and hands
    // over what came, counted as kAttitudesTaken. LCM is opened afresh after an error, and after kSilentNs
    // without a message: a connection does not notice that its network went and came back. What cannot be
    // used (of another time than now, out of order, not numbers, malformed) is counted as kAttitudesRefused.
    void receive(int wait_ms);
    // Takes in one message, as LCM delivers it.
    void take(const void* bytes, std::uint32_t size);

    // LCM's handle where it is open, else nullptr.
    _lcm_t* handle() const;

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

}  // namespace groundline::publish
