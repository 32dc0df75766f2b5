// A live source of stereo pairs: a pair of cameras that may be absent, late, out of step, or go and come
// back.
#pragma once

#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "capture/camera_driver.hpp"
#include "capture/pairing.hpp"
#include "core/counters.hpp"
#include "core/frame_source.hpp"
#include "core/function_ref.hpp"
#include "core/snapshot.hpp"
#include "verdict/camera_exposure.hpp"
#include "verdict/camera_policy.hpp"

namespace groundline::capture {

struct CameraSourceConfig {
    std::string name;  // of the source, for people
    int width = 640;   // of one eye, as the driver was told
    int height = 480;
    double rate_hz = 30.0;
    bool side_by_side = false;
    PairingConfig pairing;  // its tolerance unambiguous() at the rate
    verdict::CameraLimits limits;
    bool follow_exposure = false;  // the right camera takes the left one's; two devices only
    verdict::FollowLimits follow;
};

// For health, next to the counters. NaN where not measured; eyes are left, right.
struct CameraStatus {
    verdict::CameraState state = verdict::CameraState::kAbsent;
    verdict::CameraFault fault = verdict::CameraFault::kNone;  // why it is closed
    bool out_of_step = false;  // both eyes deliver, but nothing pairs: verdict Reason::kUnsynchronised
    double skew_ms =
        std::numeric_limits<double>::quiet_NaN();  // right minus left; how far apart while out of step
    double drift_ppm =
        std::numeric_limits<double>::quiet_NaN();  // see pairing.hpp; 1 ppm is 0.06 ms a minute
    double exposure_difference_ms = std::numeric_limits<double>::quiet_NaN();  // right minus left
    std::array<double, 2> mean{std::numeric_limits<double>::quiet_NaN(),
                               std::numeric_limits<double>::quiet_NaN()};  // grey levels, newest pair
    std::array<double, 2> saturated_share{std::numeric_limits<double>::quiet_NaN(),
                                          std::numeric_limits<double>::quiet_NaN()};  // pixels at 255
    Sentence last_fault;  // of a device or of a picture; stays when it is over
};

// Something an operator should read once.
struct CameraNotice {
    bool good = false;  // it works (again); else a warning
    Sentence sentence;
};

// Time, and waiting for it; a simulated one in tests.
class SourceClock {
  public:
    SourceClock() = default;
    SourceClock(const SourceClock&) = delete;
    SourceClock& operator=(const SourceClock&) = delete;
    virtual ~SourceClock() = default;
    virtual std::int64_t mono_ns() = 0;
    virtual std::int64_t utime_us() = 0;
    virtual void sleep_until(std::int64_t mono_ns) = 0;
};
SourceClock& real_source_clock();

// Joins a driver, the pairing, the life-cycle policy and the exposure follower. next(), error(), rewind() and
// the destructor belong to one thread, the capture thread; status() is for any thread, take_notices() for one
// other one.
//
// - The constructor opens nothing: cameras may be absent when the program starts. The size is the configured
// one.
// - next() waits at most kLongestWaitNs, then says kIdle. Only calls that set a device up or close it may
// take
//   longer, as long as the kernel does; in_device_call() says so meanwhile. Of all that is ready it takes the
//   newest pair; the rest is counted. kBad is a pair with a picture that cannot be unpacked (a damaged JPEG);
//   it never says kEnd.
// - A pair's stamp: exposure_mono_ns of the left picture, skew_ns to the right one, source kArrival if either
// is dated
//   by arrival, utime_us by the wall clock now; sequence and position count the pairs handed out.
// - While it runs, nothing is allocated, locked or logged (libjpeg apart, see mjpeg.hpp).
class CameraSource final : public FrameSource {
  public:
    static constexpr std::int64_t kLongestWaitNs = 80'000'000;

    // `counters` and `clock` are borrowed.
    CameraSource(CameraSourceConfig config, std::unique_ptr<CameraDriver> driver, Counters& counters,
                 SourceClock& clock = real_source_clock());
    ~CameraSource() override;

    const SourceInfo& info() const override { return info_; }
    Pull next(StereoFrame& frame) override;
    const std::string& error() const override { return error_; }
    bool rewind() override { return false; }

    CameraStatus status() const { return published_.load(); }
    // The capture thread is in the driver, opening, starting or closing devices or at their exposure: a
    // camera that hangs on its bus holds it there for seconds, 5 of them for each control on USB. Any thread.
    bool in_device_call() const { return in_device_call_.load(std::memory_order_acquire); }
    // Calls `each` for every notice since the last time, oldest first. Where nobody asks, the oldest 32 are
    // kept.
    void take_notices(FunctionRef<void(const CameraNotice&)> each);

  private:
    // Pictures held between wait() and release(): those that wait for the other eye, a pair, the one at hand.
    static constexpr std::size_t kMostHeld = 2 * Pairing::kMaxWaiting + 4;
    // Taken at one go: more than any device has buffers.
    static constexpr int kMostAtOnce = 64;

    void open_devices();
    void collect(std::int64_t deadline_ns);
    void admit(const CameraFrame& frame);
    void hold_back(const CameraFrame& frame);
    void drop(const Pairing::DroppedFrames& dropped, bool give_back);
    bool has_pair();
    Pull deliver(StereoFrame& frame);
    void look_at_unpacked(Pull pull);
    Pull copy_pair(const CameraFrame& left, const CameraFrame& right, StereoFrame& frame);
    void measure(const StereoFrame& frame);
    void look_at_exposure();
    void look_at_step();
    void look_at_losses();
    void on_fault(const Fault& fault);
    Sentence stall_sentence() const;
    void apply(const verdict::CameraEvent& event);
    void close_devices();
    // Does `call` on the driver while in_device_call() is true.
    template <typename Call>
    auto on_device(Call&& call) {
        struct Mark {
            explicit Mark(std::atomic<bool>& its_flag) : flag(its_flag) {
                flag.store(true, std::memory_order_release);
            }
            Mark(const Mark&) = delete;
            Mark& operator=(const Mark&) = delete;
            ~Mark() { flag.store(false, std::memory_order_release); }
            std::atomic<bool>& flag;
        };
        const Mark mark(in_device_call_);
        return call();
    }
    void tell(bool good, const Sentence& sentence);
    void publish();

    CameraSourceConfig config_;
    std::unique_ptr<CameraDriver> driver_;
    Counters& counters_;
    SourceClock& clock_;
    SourceInfo info_;
    std::string error_;
    verdict::CameraLife life_;
    Pairing pairing_;
    std::array<CameraFrame, kMostHeld> held_;
    std::array<bool, kMostHeld> holds_{};
    std::optional<FramePair> pair_;    // taken from the pairing, tokens into held_
    std::optional<CameraFrame> both_;  // the newest side-by-side picture
    // The eye's last picture could not be unpacked: what comes is no sign of life until one can be again.
    std::array<bool, 2> unusable_{};
    std::int64_t pairs_ = 0;          // handed out
    std::int64_t left_out_seen_ = 0;  // of the driver, counted already
    bool out_of_step_told_ = false;
    std::int64_t step_quiet_until_ns_ = 0;
    // Since last told, by eye: missing by the devices' own numbers, and damaged by their own word.
    std::array<std::int64_t, 2> lost_{};
    std::array<std::int64_t, 2> damaged_{};
    std::int64_t losses_quiet_until_ns_ = 0;
    bool handed_over_ = false;           // a pair, by the last next()
    std::int64_t exposure_look_ns_ = 0;  // when to ask the cameras again what they expose
    bool follows_ = false;
    verdict::FollowState follow_;
    CameraStatus status_;
    Snapshot<CameraStatus> published_;
    std::atomic<bool> in_device_call_{false};
    boost::lockfree::spsc_queue<CameraNotice, boost::lockfree::capacity<32>> notices_;
};

}  // namespace groundline::capture
