// Latencies in fixed buckets: constant memory and time, percentiles within 6.25 %.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

namespace groundline {

// Buckets are 1/16 of a power of two wide, from 0 ns to 2^62 ns. One writer; readers take a copy.
class LatencyHistogram {
  public:
    void add(std::int64_t nanoseconds) {
        const std::uint64_t value = nanoseconds > 0 ? static_cast<std::uint64_t>(nanoseconds) : 0;
        ++buckets_[bucket_of(value)];
        ++count_;
        max_ns_ = std::max(max_ns_, static_cast<std::int64_t>(value));
    }
    std::uint64_t count() const { return count_; }
    std::int64_t max_ns() const { return max_ns_; }
    // Upper edge of the bucket that holds the value of rank ceil(share * count), at most max_ns(); 0 if
    // empty.
    std::int64_t percentile_ns(double share) const {
        if (count_ == 0) return 0;
        const double wanted = share * static_cast<double>(count_);
        std::uint64_t rank = static_cast<std::uint64_t>(wanted);
        if (static_cast<double>(rank) < wanted) ++rank;
        rank = std::clamp<std::uint64_t>(rank, 1, count_);
        std::uint64_t seen = 0;
        for (std::size_t bucket = 0; bucket < buckets_.size(); ++bucket) {
            seen += buckets_[bucket];
            if (seen >= rank) return std::min(max_ns_, upper_edge(bucket));
        }
        return max_ns_;
    }

  private:
    static constexpr unsigned kSubBits = 4;
    static constexpr std::size_t kBuckets = (62 - kSubBits + 1) << kSubBits;

    static std::size_t bucket_of(std::uint64_t value) {
        if (value < (1U << kSubBits)) return value;
        const unsigned octave = static_cast<unsigned>(std::bit_width(value)) - 1 - kSubBits;
        const std::size_t bucket = ((octave + 1ULL) << kSubBits) + ((value >> octave) - (1U << kSubBits));
        return std::min(bucket, kBuckets - 1);
    }
    static std::int64_t upper_edge(std::size_t bucket) {
        if (bucket < (1U << kSubBits)) return static_cast<std::int64_t>(bucket);
        const std::size_t octave = (bucket >> kSubBits) - 1;
        const std::uint64_t mantissa = (bucket & ((1U << kSubBits) - 1)) + (1U << kSubBits);
        return static_cast<std::int64_t>(((mantissa + 1) << octave) - 1);
    }

    std::array<std::uint64_t, kBuckets> buckets_{};
    std::uint64_t count_ = 0;
    std::int64_t max_ns_ = 0;
};

}  // namespace groundline
