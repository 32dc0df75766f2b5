// Lossless hand-over: a slow consumer makes the producer wait.
#pragma once

#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <cstddef>
#include <cstdint>

#include "pipeline/hand_over.hpp"

namespace groundline::pipeline {

// Slots travel as indices through two single-producer single-consumer queues, in order:
//
//   producer --full_--> consumer
//   producer <--free_-- consumer
template <typename T, std::size_t kSlots>
class Ring final : public HandOver<T> {
  public:
    explicit Ring(const std::array<T, kSlots>& slots) : slots_(slots) {
        for (std::uint32_t index = 0; index < kSlots; ++index)
            free_.push(index);
    }

    T* begin_write() override {
        if (closed_.load(std::memory_order_acquire)) return nullptr;
        if (!writing_ && !wait_for(free_, freed_, write_)) return nullptr;
        writing_ = true;
        return &slots_[write_];
    }

    bool commit() override {
        writing_ = false;
        full_.push(write_);
        wake(filled_);
        return false;
    }

    void end_of_stream() override {
        ended_.store(true, std::memory_order_release);
        wake(filled_);
    }

    T* take() override { return wait_for(full_, filled_, read_) ? &slots_[read_] : nullptr; }

    void release() override {
        free_.push(read_);
        wake(freed_);
    }

    void close() override {
        closed_.store(true, std::memory_order_release);
        wake(filled_);
        wake(freed_);
    }

  private:
    using Queue = boost::lockfree::spsc_queue<std::uint32_t, boost::lockfree::capacity<kSlots>>;
    using Ticket = std::atomic<std::uint32_t>;

    // The ticket is read before the queue is looked at: whatever is pushed later changes it, so the wait
    // cannot sleep over a push. Likewise the end is read before the queue: what was pushed before it is seen.
    bool wait_for(Queue& queue, Ticket& changes, std::uint32_t& index) {
        for (;;) {
            const std::uint32_t ticket = changes.load(std::memory_order_acquire);
            const bool ended = ended_.load(std::memory_order_acquire) && &queue == &full_;
            if (closed_.load(std::memory_order_acquire)) return false;
            if (queue.pop(index)) return true;
            if (ended) return false;
            changes.wait(ticket, std::memory_order_acquire);
        }
    }
    static void wake(Ticket& changes) {
        changes.fetch_add(1, std::memory_order_release);
        changes.notify_one();
    }

    std::array<T, kSlots> slots_;
    Queue full_;
    Queue free_;
    Ticket filled_{0};
    Ticket freed_{0};
    std::atomic<bool> ended_{false};
    std::atomic<bool> closed_{false};
    alignas(64) std::uint32_t write_ = 0;
    bool writing_ = false;  // write_ is taken and not yet handed over
    alignas(64) std::uint32_t read_ = 0;
};

}  // namespace groundline::pipeline
