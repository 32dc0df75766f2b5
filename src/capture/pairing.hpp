// Which left picture belongs to which right one, by the time of their exposure.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "core/fixed_vector.hpp"

namespace groundline::capture {

// One picture of one eye; `token` is the caller's and comes back with its fate.
struct StampedFrame {
    int eye = 0;  // 0 left, 1 right
    std::int64_t stamp_ns = 0;
    int token = 0;
};

struct FramePair {
    StampedFrame left;
    StampedFrame right;
    std::int64_t skew_ns() const { return right.stamp_ns - left.stamp_ns; }
};

struct PairingConfig {
    // Farthest apart that two stamps of one instant may be; at most half the period of the pictures, see
    // unambiguous().
    std::int64_t tolerance_ns = 10'000'000;
    int max_waiting = 3;  // pictures of one eye that wait for the other, 1 to kMaxWaiting
};

// With a tolerance of more than half a period, a picture may be nearer to the next one of the other eye than
// to its own, and which pairs come out depends on the order of arrival.
constexpr bool unambiguous(std::int64_t tolerance_ns, double rate_hz) {
    return 2.0 * static_cast<double>(tolerance_ns) * rate_hz <= 1e9;
}

// Pairs pictures as they come, keeps the newest pair, and says of every other picture why it is not in one.
//
// A picture is paired with the nearest one of the other eye that still waits and is within the tolerance, at
// once: waiting for a nearer one would cost a period of latency, and with an unambiguous() tolerance there
// is none. Each eye's stamps grow, so what lies before a pair can be in no later one: pairs never cross
// and never go back.
//
// Pure: no clock, no memory but its own; a function of the frames in their order.
class Pairing {
  public:
    static constexpr int kMaxWaiting = 8;

    enum class Fate : std::uint8_t {
        kSingle,      // nothing of the other eye was near enough, or it came out of order
        kSuperseded,  // was paired, but a newer pair came before anybody took this one
    };
    struct Dropped {
        StampedFrame frame;
        Fate fate = Fate::kSingle;
    };
    // Never more than wait, plus the pair superseded, plus the frame itself.
    using DroppedFrames = FixedVector<Dropped, 2 * kMaxWaiting + 3>;

    explicit Pairing(const PairingConfig& config) : config_(config) {}

    // Takes a picture. What is returned is out of it and not needed any more.
    DroppedFrames add(const StampedFrame& frame);
    // Hands over the newest pair, once.
    std::optional<FramePair> take();
    // Forgets everything: what waits or is held is dropped as single. For a new start; the drift begins anew
    // too.
    DroppedFrames reset();
    void set_max_waiting(int frames) { config_.max_waiting = frames; }

    // Both eyes have delivered kOutOfStep pictures without a pair among them, and since then there were not
    // as many pairs in a row: cameras far apart meet by chance now and then.
    bool out_of_step() const { return out_of_step_; }
    // Of the last pair; of the nearest two pictures while out of step. 0 before there was any.
    std::int64_t skew_ns() const { return skew_ns_; }
    // How much faster the skew grows than time, in parts per million (1 ppm is 0.06 ms a minute): positive
    // where the right camera is the slower one. Median of the slopes between the medians of the last
    // kDriftPoints seconds (Theil and Sen), so that a third of the seconds may be wild. NaN before
    // kLeastDriftPoints seconds with pairs.
    double drift_ppm() const { return drift_ppm_; }

    static constexpr int kOutOfStep = 10;
    static constexpr int kDriftPoints = 32;
    static constexpr int kLeastDriftPoints = 8;

  private:
    using Waiting = FixedVector<StampedFrame, kMaxWaiting + 1>;
    // Median skew of a second.
    struct DriftPoint {
        std::int64_t at_ns = 0;
        std::int64_t skew_ns = 0;
    };

    void note_pair(const FramePair& pair);
    void add_drift_point(DriftPoint point);

    PairingConfig config_;
    std::array<Waiting, 2> waiting_;
    std::array<std::optional<std::int64_t>, 2> last_ns_;
    std::array<int, 2> since_pair_{};  // pictures
    int pairs_in_a_row_ = 0;
    bool out_of_step_ = false;
    std::optional<FramePair> newest_;
    std::int64_t skew_ns_ = 0;

    std::int64_t second_begins_ns_ = 0;
    FixedVector<std::int64_t, 64> second_;  // skews of the running second; more than these are not needed
    FixedVector<DriftPoint, kDriftPoints> drift_points_;
    double drift_ppm_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace groundline::capture
