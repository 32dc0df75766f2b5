// Newest-first hand-over: a slow consumer costs frames, never latency.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "pipeline/hand_over.hpp"

namespace groundline::pipeline {

// Three slots; who owns which is said by one atomic word and two private indices:
//
//      producer            state_                consumer
//     [ write_ ]   <-->  [ middle | fresh ]  <-->  [ read_ ]
//
// commit() swaps write_ with the middle and marks it fresh; take() swaps read_ with the middle if it is
// fresh. {write_, middle, read_} is always a permutation of {0, 1, 2}, for each swap is one atomic exchange
// of the middle index. Both swaps are wait-free: a single exchange, no loop. A commit that finds the middle
// still fresh has overwritten a slot nobody took, and says so.
//
// take() reads the ticket `changes_` before it looks; a commit after that look changes the ticket, so the
// wait cannot sleep over it.
//
// Memory order: the exchange releases the slot just written and acquires the slot just received, so the
// filling happens before the reading and the reading before the next filling of the same slot.
// `Atomic` is another only where a test steps through the protocol.
template <typename T, template <typename> typename Atomic = std::atomic>
class TripleBuffer final : public HandOver<T> {
  public:
    explicit TripleBuffer(const std::array<T, 3>& slots) : slots_(slots) {}

    T* begin_write() override { return closed_.load(std::memory_order_relaxed) ? nullptr : &slots_[write_]; }

    bool commit() override {
        const std::uint32_t before = state_.exchange(write_ | kFresh, std::memory_order_acq_rel);
        write_ = before & kIndex;
        wake();
        return (before & kFresh) != 0;
    }

    void end_of_stream() override {
        ended_.store(true, std::memory_order_release);
        wake();
    }

    // Consumer. take() without waiting: nullptr where nothing came since the last one.
    T* newest() {
        if ((state_.load(std::memory_order_relaxed) & kFresh) == 0) return nullptr;
        read_ = state_.exchange(read_, std::memory_order_acq_rel) & kIndex;
        return &slots_[read_];
    }

    T* take() override {
        for (;;) {
            const std::uint32_t ticket = changes_.load(std::memory_order_acquire);
            const bool ended = ended_.load(std::memory_order_acquire);
            if (closed_.load(std::memory_order_acquire)) return nullptr;
            if (T* slot = newest()) return slot;
            if (ended) return nullptr;
            changes_.wait(ticket, std::memory_order_acquire);
        }
    }

    // The slot stays the consumer's until its next take(); there is nothing to give back.
    void release() override {}

    void close() override {
        closed_.store(true, std::memory_order_release);
        wake();
    }

  private:
    static constexpr std::uint32_t kIndex = 3;
    static constexpr std::uint32_t kFresh = 4;

    void wake() {
        changes_.fetch_add(1, std::memory_order_release);
        changes_.notify_one();
    }

    std::array<T, 3> slots_;
    alignas(64) Atomic<std::uint32_t> state_{1};
    alignas(64) Atomic<std::uint32_t> changes_{0};
    Atomic<bool> ended_{false};
    Atomic<bool> closed_{false};
    alignas(64) std::uint32_t write_ = 0;
    alignas(64) std::uint32_t read_ = 2;
};

}  // namespace groundline::pipeline
