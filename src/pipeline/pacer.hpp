// When the next recorded pair is due, so that a recording runs as if it were live.
#pragma once

#include <cstdint>

namespace groundline::pipeline {

// Pure arithmetic on stamps; the caller sleeps. Gaps and backward jumps of the stamps (a loop, a cut) are
// bridged with the last good step, at most kLongestStep, so a broken stamp cannot stop the replay.
class Pacer {
  public:
    static constexpr std::int64_t kLongestStepNs = 2'000'000'000;
    static constexpr std::int64_t kFirstGuessNs = 100'000'000;

    // What becomes of time that was lost by more than a step.
    enum class Late : std::uint8_t {
        kCatchUp,   // the pairs after it come at once until the recording's time is reached
        kLeaveOut,  // the pair is due now and the rest after it: nothing is ever due long ago
    };

    // `fixed_step_ns` 0: by the stamps.
    explicit Pacer(std::int64_t fixed_step_ns, Late late = Late::kCatchUp)
        : fixed_step_ns_(fixed_step_ns), late_(late) {}

    // Monotonic time at which the pair taken at `exposure_ns` is due; the first pair is due `now_ns`.
    std::int64_t due_ns(std::int64_t exposure_ns, std::int64_t now_ns) {
        if (!started_) {
            started_ = true;
            due_ns_ = now_ns;
        } else {
            const std::int64_t step = exposure_ns - last_exposure_ns_;
            if (fixed_step_ns_ == 0 && step > 0 && step <= kLongestStepNs) good_step_ns_ = step;
            advance(now_ns);
        }
        last_exposure_ns_ = exposure_ns;
        return due_ns_;
    }

    // The same for a pair that has no stamp, because it cannot be read: a good step after the last.
    std::int64_t due_without_stamp_ns(std::int64_t now_ns) {
        return due_ns(last_exposure_ns_ + good_step_ns_, now_ns);
    }

  private:
    void advance(std::int64_t now_ns) {
        const std::int64_t step = fixed_step_ns_ != 0 ? fixed_step_ns_ : good_step_ns_;
        due_ns_ += step;
        if (late_ == Late::kLeaveOut && due_ns_ < now_ns - step) due_ns_ = now_ns;
    }

    std::int64_t fixed_step_ns_;
    Late late_;
    std::int64_t good_step_ns_ = kFirstGuessNs;
    std::int64_t last_exposure_ns_ = 0;
    std::int64_t due_ns_ = 0;
    bool started_ = false;
};

}  // namespace groundline::pipeline
