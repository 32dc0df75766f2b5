// Latencies in fixed buckets: constant memory and time, percentiles within 6.25 %.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstdint>

namespace groundline {

// Buckets are 1/16 of a power of two wide, from 0 ns to 2^62 ns. One thread writes, wait-free; others may
// read meanwhile and then miss at most what is being added.
class LatencyHistogram {
  public:
    void add(std::int64_t nanoseconds) {
        const std::uint64_t value = nanoseconds > 0 ? static_cast<std::uint64_t>(nanoseconds) : 0;
        raise(max_ns_, std::max(max_ns(), static_cast<std::int64_t>(value)));
        std::atomic<std::uint64_t>& bucket = buckets_[bucket_of(value)];
        raise(bucket, bucket.load(std::memory_order_relaxed) + 1);
        raise(count_, count() + 1);
    }
    std::uint64_t count() const { return count_.load(std::memory_order_relaxed); }
    std::int64_t max_ns() const { return max_ns_.load(std::memory_order_relaxed); }
    // Upper edge of the bucket that holds the value of rank ceil(share * count), at most max_ns(); 0 if
    // empty.
    std::int64_t percentile_ns(double share) const {
        const std::uint64_t count_now = count();
        if (count_now == 0) return 0;
        const double wanted = share * static_cast<double>(count_now);
        std::uint64_t rank = static_cast<std::uint64_t>(wanted);
        if (static_cast<double>(rank) < wanted) ++rank;
        rank = std::clamp<std::uint64_t>(rank, 1, count_now);
        std::uint64_t seen = 0;
        for (std::size_t bucket = 0; bucket < buckets_.size(); ++bucket) {
            seen += buckets_[bucket].load(std::memory_order_relaxed);
            if (seen >= rank) return std::min(max_ns(), upper_edge(bucket));
        }
        return max_ns();
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

    // Not a read-modify-write: there is one writer, and that would lock the bus once a stage and frame.
    template <typename Value>
    static void raise(std::atomic<Value>& value, Value to) {
        value.store(to, std::memory_order_relaxed);
    }

    std::array<std::atomic<std::uint64_t>, kBuckets> buckets_{};
    std::atomic<std::uint64_t> count_{0};
    std::atomic<std::int64_t> max_ns_{0};
};

}  // namespace groundline
