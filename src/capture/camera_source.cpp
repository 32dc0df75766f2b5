#include "capture/camera_source.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <utility>

#include "core/clock.hpp"

namespace groundline::capture {
namespace {

using verdict::CameraAction;
using verdict::CameraEvent;
using verdict::CameraState;

constexpr double kNsPerMs = 1e6;
constexpr std::int64_t kNoWait = 0;  // a deadline long past
// How often the cameras are asked what they expose, four controls of a millisecond each on USB: for people,
// and where the right one follows: an automatic takes about a second to settle.
constexpr std::int64_t kExposureLookNs = 1'000'000'000;
constexpr std::int64_t kExposureFollowNs = 500'000'000;
// Cameras at the edge of the tolerance go in and out of step by the second; the log need not.
constexpr std::int64_t kStepQuietNs = 5'000'000'000;
// A cable that goes bad loses pictures by the second as well: their sum is told.
constexpr std::int64_t kLossesQuietNs = 60'000'000'000;
// Mean and saturation are taken from every so many rows, which costs microseconds.
constexpr int kMeasuredRows = 8;
constexpr std::array<const char*, 2> kEyeNames = {"the left camera", "the right camera"};
constexpr const char* kStereoName = "the stereo camera";

class RealSourceClock final : public SourceClock {
  public:
    std::int64_t mono_ns() override { return now_mono_ns(); }
    std::int64_t utime_us() override { return now_utime_us(); }
    void sleep_until(std::int64_t mono_ns) override {
        const timespec until{static_cast<time_t>(mono_ns / 1'000'000'000),
                             static_cast<long>(mono_ns % 1'000'000'000)};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
    }
};

struct Light {
    double mean = 0.0;
    double saturated_share = 0.0;
};

Light light_of(ConstLuma image) {
    std::uint64_t sum = 0;
    std::uint64_t saturated = 0;
    std::uint64_t pixels = 0;
    for (int y = 0; y < image.height; y += kMeasuredRows) {
        const std::uint8_t* row = image.row(y);
        std::uint32_t row_sum = 0;
        std::uint32_t row_saturated = 0;
        for (int x = 0; x < image.width; ++x) {
            row_sum += row[x];
            row_saturated += row[x] == 255 ? 1U : 0U;
        }
        sum += row_sum;
        saturated += row_saturated;
        pixels += static_cast<std::uint64_t>(image.width);
    }
    const auto count = static_cast<double>(pixels);
    return {static_cast<double>(sum) / count, static_cast<double>(saturated) / count};
}

}  // namespace

SourceClock& real_source_clock() {
    static RealSourceClock clock;
    return clock;
}

CameraSource::CameraSource(CameraSourceConfig config, std::unique_ptr<CameraDriver> driver,
                           Counters& counters, SourceClock& clock)
    : config_(std::move(config)),
      driver_(std::move(driver)),
      counters_(counters),
      clock_(clock),
      pairing_(config_.pairing) {
    assert(config_.side_by_side || unambiguous(config_.pairing.tolerance_ns, config_.rate_hz));
    info_.name = config_.name;
    info_.width = config_.width;
    info_.height = config_.height;
    info_.live = true;
    info_.rate_hz = config_.rate_hz;
    error_.reserve(sizeof(Sentence));
}

CameraSource::~CameraSource() {
    driver_->close();
}

Pull CameraSource::next(StereoFrame& frame) {
    // Here no pair is kept waiting: the last is with whoever asked, the next is on its way.
    look_at_exposure();
    const std::int64_t deadline_ns = clock_.mono_ns() + kLongestWaitNs;
    for (;;) {
        if (life_.closed()) {
            const verdict::CameraStep step =
                verdict::step(life_, CameraEvent::tick(), clock_.mono_ns(), config_.limits);
            if (step.action == CameraAction::kOpen)
                open_devices();
            else
                clock_.sleep_until(std::min(deadline_ns, life_.retry_ns));
        } else {
            collect(deadline_ns);
            if (has_pair()) return deliver(frame);
            apply(CameraEvent::tick());
        }
        if (clock_.mono_ns() >= deadline_ns) break;
    }
    publish();
    return Pull::kIdle;
}

void CameraSource::open_devices() {
    left_out_seen_ = 0;
    out_of_step_told_ = false;
    follow_ = {};
    handed_over_ = false;
    exposure_look_ns_ = 0;
    follows_ = config_.follow_exposure && !config_.side_by_side;
    Fault fault = on_device([&] { return driver_->open(); });
    if (fault.ok()) {
        // One more than waits is in a pair, or at hand.
        pairing_.set_max_waiting(std::clamp(driver_->buffers_to_hold() - 1, 1, config_.pairing.max_waiting));
        fault = on_device([&] { return driver_->start(); });
    }
    if (fault.ok())
        apply(CameraEvent::opened());
    else
        on_fault(fault);
}

// Waits for a picture, then takes all that are ready.
void CameraSource::collect(std::int64_t deadline_ns) {
    std::int64_t until_ns = deadline_ns;
    Fault fault;
    for (int taken = 0; taken < kMostAtOnce; ++taken) {
        CameraFrame frame;
        const CameraDriver::Waited waited = driver_->wait(until_ns, frame, fault);
        if (waited != CameraDriver::Waited::kFrame) break;
        until_ns = kNoWait;
        admit(frame);
    }
    const std::int64_t left_out = driver_->left_out() - left_out_seen_;
    counters_.add(Count::kCameraLeftOut, static_cast<std::uint64_t>(left_out));
    left_out_seen_ += left_out;
    look_at_losses();
    if (fault.ok())
        look_at_step();
    else
        on_fault(fault);
}

void CameraSource::admit(const CameraFrame& frame) {
    const bool both = frame.eye == Eye::kBoth;
    for (std::size_t eye = 0; eye < 2; ++eye) {
        if (!both && eye != static_cast<std::size_t>(frame.eye)) continue;
        lost_[eye] += frame.lost;
        damaged_[eye] += frame.damaged ? 1 : 0;
    }
    if (frame.lost > 0) counters_.add(Count::kCameraGaps, static_cast<std::uint64_t>(frame.lost));
    if (frame.damaged) {
        counters_.add(Count::kCameraDamaged);
        driver_->release(frame);
        return;
    }
    // Out of step nothing is unpacked, so nothing is known to be unusable.
    const bool usable = both                     ? !unusable_[0] && !unusable_[1]
                        : pairing_.out_of_step() ? true
                                                 : !unusable_[static_cast<std::size_t>(frame.eye)];
    if (usable) apply(CameraEvent::picture(static_cast<int>(frame.eye)));
    if (!both) {
        hold_back(frame);
        return;
    }
    if (both_) {
        driver_->release(*both_);
        counters_.add(Count::kCameraSuperseded);
    }
    both_ = frame;
}

void CameraSource::hold_back(const CameraFrame& frame) {
    const auto free = std::find(holds_.begin(), holds_.end(), false) - holds_.begin();
    const auto slot = static_cast<std::size_t>(free);
    held_[slot] = frame;
    holds_[slot] = true;
    drop(pairing_.add({static_cast<int>(frame.eye), frame.exposure_mono_ns, static_cast<int>(free)}), true);
}

void CameraSource::drop(const Pairing::DroppedFrames& dropped, bool give_back) {
    std::int64_t superseded = 0;
    for (const Pairing::Dropped& each : dropped) {
        const auto slot = static_cast<std::size_t>(each.frame.token);
        holds_[slot] = false;
        if (give_back) driver_->release(held_[slot]);
        if (each.fate == Pairing::Fate::kSuperseded) {
            ++superseded;
            continue;
        }
        counters_.add(Count::kCameraSingles);
    }
    counters_.add(Count::kCameraSuperseded, static_cast<std::uint64_t>(superseded / 2));
}

bool CameraSource::has_pair() {
    if (life_.closed()) return false;
    if (config_.side_by_side) return both_.has_value();
    pair_ = pairing_.take();
    return pair_.has_value();
}

Pull CameraSource::deliver(StereoFrame& frame) {
    Pull pull = Pull::kBad;
    if (both_) {
        pull = copy_pair(*both_, *both_, frame);
        driver_->release(*both_);
        both_.reset();
    } else {
        const auto left = static_cast<std::size_t>(pair_->left.token);
        const auto right = static_cast<std::size_t>(pair_->right.token);
        pull = copy_pair(held_[left], held_[right], frame);
        for (const std::size_t slot : {left, right}) {
            driver_->release(held_[slot]);
            holds_[slot] = false;
        }
        pair_.reset();
    }
    if (pull == Pull::kFrame) {
        measure(frame);
        ++pairs_;
        handed_over_ = true;
    }
    look_at_unpacked(pull);
    publish();
    return pull;
}

void CameraSource::look_at_unpacked(Pull pull) {
    if (pull == Pull::kBad) {
        apply(CameraEvent::tick());
        return;
    }
    for (std::size_t eye = 0; eye < 2; ++eye)
        if (std::exchange(unusable_[eye], false)) apply(CameraEvent::picture(static_cast<int>(eye)));
}

Pull CameraSource::copy_pair(const CameraFrame& left, const CameraFrame& right, StereoFrame& frame) {
    FrameStamp& stamp = frame.stamp;
    stamp = {};
    stamp.sequence = pairs_;
    stamp.position = pairs_;
    stamp.exposure_mono_ns = left.exposure_mono_ns;
    stamp.skew_ns = right.exposure_mono_ns - left.exposure_mono_ns;
    stamp.source = right.source == StampSource::kArrival ? right.source : left.source;
    stamp.utime_us = clock_.utime_us() - (clock_.mono_ns() - left.exposure_mono_ns) / 1000;
    std::array<char, 64> name{};
    std::snprintf(name.data(), name.size(), "camera %lld %lld", static_cast<long long>(left.sequence),
                  static_cast<long long>(right.sequence));
    stamp.set_name(name.data());
    Fault fault = driver_->copy(left, Eye::kLeft, frame.left);
    std::size_t eye = 0;
    if (fault.ok()) {
        fault = driver_->copy(right, Eye::kRight, frame.right);
        eye = 1;
    }
    if (fault.ok()) return Pull::kFrame;
    unusable_[eye] = true;
    status_.last_fault = fault.sentence;
    error_.assign(fault.sentence.view());
    return Pull::kBad;
}

void CameraSource::measure(const StereoFrame& frame) {
    const Light left = light_of(frame.left);
    const Light right = light_of(frame.right);
    status_.mean = {left.mean, right.mean};
    status_.saturated_share = {left.saturated_share, right.saturated_share};
    status_.skew_ms = static_cast<double>(frame.stamp.skew_ns) / kNsPerMs;
    status_.drift_ppm = config_.side_by_side ? status_.drift_ppm : pairing_.drift_ppm();
}

void CameraSource::look_at_exposure() {
    const bool handed_over = std::exchange(handed_over_, false);
    const std::int64_t now_ns = clock_.mono_ns();
    if (!handed_over || config_.side_by_side || now_ns < exposure_look_ns_) return;
    exposure_look_ns_ = now_ns + (follows_ ? kExposureFollowNs : kExposureLookNs);
    const auto [left, right] = on_device(
        [&] { return std::pair(driver_->read_exposure(Eye::kLeft), driver_->read_exposure(Eye::kRight)); });
    status_.exposure_difference_ms = (right.exposure_us - left.exposure_us) / 1000.0;
    if (!follows_) return;
    const verdict::FollowStep step = verdict::follow(follow_, left, right, pairs_, config_.follow);
    follow_ = step.state;
    if (!step.set) return;
    const Fault fault = on_device([&] { return driver_->set_exposure(Eye::kRight, *step.set); });
    if (fault.ok()) return;
    status_.last_fault = fault.sentence;
    // What became of the device, the next wait() tells; a camera that failed at this alone is asked again.
    if (fault.kind != CameraFault::kRefused) return;
    follows_ = false;  // until it is opened again
    tell(false, fault.sentence);
}

void CameraSource::look_at_step() {
    const bool out_of_step = !config_.side_by_side && pairing_.out_of_step();
    status_.out_of_step = out_of_step;
    if (out_of_step) status_.skew_ms = static_cast<double>(pairing_.skew_ns()) / kNsPerMs;
    const std::int64_t now_ns = clock_.mono_ns();
    if (out_of_step == out_of_step_told_ || now_ns < step_quiet_until_ns_) return;
    out_of_step_told_ = out_of_step;
    step_quiet_until_ns_ = now_ns + kStepQuietNs;
    if (out_of_step)
        tell(false, Sentence::of("the cameras are out of step: their pictures are %.1f ms apart, more than "
                                 "capture.pair_tolerance_ms allows (%.1f); synchronise them, or allow more",
                                 std::abs(status_.skew_ms),
                                 static_cast<double>(config_.pairing.tolerance_ns) / kNsPerMs));
    else
        tell(true, Sentence("the cameras are in step again"));
}

void CameraSource::look_at_losses() {
    const std::int64_t now_ns = clock_.mono_ns();
    if (now_ns < losses_quiet_until_ns_) return;
    for (std::size_t eye = 0; eye < (config_.side_by_side ? 1 : 2); ++eye) {
        if (lost_[eye] == 0 && damaged_[eye] == 0) continue;
        tell(false,
             Sentence::of("%s lost %lld pictures and gave %lld damaged ones; look at its cable, its bus and "
                          "the load",
                          config_.side_by_side ? kStereoName : kEyeNames[eye],
                          static_cast<long long>(lost_[eye]), static_cast<long long>(damaged_[eye])));
        lost_[eye] = damaged_[eye] = 0;
        losses_quiet_until_ns_ = now_ns + kLossesQuietNs;
    }
}

void CameraSource::on_fault(const Fault& fault) {
    status_.last_fault = fault.sentence;
    apply(CameraEvent::failed(fault.kind));
}

Sentence CameraSource::stall_sentence() const {
    const int eye = life_.silent_eye;
    const char* who = config_.side_by_side ? "the stereo camera"
                      : eye == 2           ? "both cameras"
                                           : kEyeNames[static_cast<std::size_t>(eye)];
    const bool unusable = eye == 2 ? unusable_[0] || unusable_[1] : unusable_[static_cast<std::size_t>(eye)];
    return unusable ? Sentence::of(
                          "%s gave no picture that can be used for too long; closed, to be opened "
                          "again; the last was: %s",
                          who, error_.c_str())
                    : Sentence::of("%s gave no picture for too long; closed, to be opened again", who);
}

void CameraSource::apply(const CameraEvent& event) {
    const verdict::CameraStep step = verdict::step(life_, event, clock_.mono_ns(), config_.limits);
    const bool was_open = !life_.closed();
    life_ = step.life;
    if (step.action == CameraAction::kClose) {
        close_devices();
        if (was_open) {
            counters_.add(Count::kCameraRestarts);
        }
    }
    if (life_.state == CameraState::kStalled && step.action == CameraAction::kClose) {
        status_.last_fault = stall_sentence();
    }
    if (!step.say) return;
    if (life_.state == CameraState::kRunning)
        tell(true, Sentence(driver_->description()));
    else
        tell(false, status_.last_fault);
}

// The driver takes all buffers back by itself.
void CameraSource::close_devices() {
    drop(pairing_.reset(), false);
    if (both_) {
        counters_.add(Count::kCameraSuperseded);
        both_.reset();
    }
    status_.out_of_step = false;
    out_of_step_told_ = false;
    on_device([&] { driver_->close(); });
}

void CameraSource::tell(bool good, const Sentence& sentence) {
    notices_.push({good, sentence});
}

void CameraSource::take_notices(FunctionRef<void(const CameraNotice&)> each) {
    CameraNotice notice;
    while (notices_.pop(notice))
        each(notice);
}

void CameraSource::publish() {
    status_.state = life_.state;
    status_.fault = life_.fault;
    published_.store(status_);
}

}  // namespace groundline::capture
