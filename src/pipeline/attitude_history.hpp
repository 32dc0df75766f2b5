// The last attitudes that another sensor measured, and the one at an instant between them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/attitude.hpp"
#include "pipeline/triple_buffer.hpp"

namespace groundline::pipeline {

struct AttitudeSample {
    std::int64_t mono_ns = 0;
    double pitch_rad = 0.0;
    double roll_rad = 0.0;
    double sigma_rad = 0.0;  // one standard deviation of either
};

// A plain value of fixed size, so that one thread can hand all of it to another. No allocation.
class AttitudeHistory {
  public:
    static constexpr std::size_t kSamples = 64;
    // Closer ones are left out, so that 64 reach back a quarter of a second: longer than a camera needs to
    // deliver a picture of then.
    static constexpr std::int64_t kLeastApartNs = 4'000'000;

    enum class Taken : std::uint8_t {
        kKept,
        kTooClose,  // to the last one kept: nothing lost
        kRefused,   // older than the last one, or not numbers
    };
    Taken add(const AttitudeSample& sample);

    // The attitude at that instant: between the two samples about it that are at most `max_gap_ns` apart
    // (linear), else of the sample nearest to it, if that is within max_gap_ns. Not valid where there is
    // none.
    AttitudeInput at(std::int64_t mono_ns, std::int64_t max_gap_ns) const;

  private:
    const AttitudeSample& newest(std::size_t back) const {
        return samples_[(next_ + kSamples - 1 - back) % kSamples];
    }

    std::array<AttitudeSample, kSamples> samples_{};
    std::size_t next_ = 0;
    std::size_t count_ = 0;
};

// From the thread that receives attitudes to the one that captures pairs.
using AttitudeHandOver = TripleBuffer<AttitudeHistory>;

}  // namespace groundline::pipeline
