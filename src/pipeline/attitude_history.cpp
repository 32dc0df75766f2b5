#include "pipeline/attitude_history.hpp"

#include <algorithm>
#include <cmath>

namespace groundline::pipeline {
namespace {

AttitudeInput input(const AttitudeSample& sample) {
    return {true, sample.pitch_rad, sample.roll_rad, sample.sigma_rad};
}

}  // namespace

AttitudeHistory::Taken AttitudeHistory::add(const AttitudeSample& sample) {
    if (!std::isfinite(sample.pitch_rad) || !std::isfinite(sample.roll_rad) ||
        !std::isfinite(sample.sigma_rad) || sample.sigma_rad < 0.0)
        return Taken::kRefused;
    if (count_ > 0) {
        const std::int64_t apart_ns = sample.mono_ns - newest(0).mono_ns;
        if (apart_ns <= 0) return Taken::kRefused;
        if (apart_ns < kLeastApartNs) return Taken::kTooClose;
    }
    samples_[next_] = sample;
    next_ = (next_ + 1) % kSamples;
    count_ = std::min(count_ + 1, kSamples);
    return Taken::kKept;
}

AttitudeInput AttitudeHistory::at(std::int64_t mono_ns, std::int64_t max_gap_ns) const {
    if (count_ == 0) return {};
    std::size_t back = 0;  // of the newest sample that is not after the instant
    while (back < count_ && newest(back).mono_ns > mono_ns)
        ++back;
    const AttitudeSample* before = back < count_ ? &newest(back) : nullptr;
    const AttitudeSample* after = back > 0 ? &newest(back - 1) : nullptr;
    if (before != nullptr && after != nullptr && after->mono_ns - before->mono_ns <= max_gap_ns) {
        const double part = static_cast<double>(mono_ns - before->mono_ns) /
                            static_cast<double>(after->mono_ns - before->mono_ns);
        return {true, before->pitch_rad + part * (after->pitch_rad - before->pitch_rad),
                before->roll_rad + part * (after->roll_rad - before->roll_rad),
                std::max(before->sigma_rad, after->sigma_rad)};
    }
    const std::int64_t since_ns = before != nullptr ? mono_ns - before->mono_ns : max_gap_ns + 1;
    const std::int64_t until_ns = after != nullptr ? after->mono_ns - mono_ns : max_gap_ns + 1;
    if (std::min(since_ns, until_ns) > max_gap_ns) return {};
    return input(since_ns <= until_ns ? *before : *after);
}

}  // namespace groundline::pipeline
