// The threads that share one frame's work: a Parallel with a fixed number of lanes.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <thread>
#include <vector>

#include "core/parallel.hpp"

namespace groundline::pipeline {

// lanes - 1 threads beside the caller, which works too as lane 0. Threads live as long as the pool and sleep
// on a futex between jobs. for_each allocates nothing and takes no mutex.
class WorkerPool final : public Parallel {
  public:
    // `lanes` at least 1. Throws std::system_error where the system gives no thread.
    // `on_start`, where given, is called once on each thread of the pool.
    explicit WorkerPool(int lanes, const std::function<void()>& on_start = {});
    ~WorkerPool() override;

    int lanes() const override { return static_cast<int>(threads_.size()) + 1; }
    void for_each(int count, FunctionRef<void(int index, int lane)> task) override;

  private:
    using Task = FunctionRef<void(int, int)>;

    void work(int lane);
    void run_share(int lane);
    void end();

    // The job: written by the caller before `job_` changes, read by the workers after.
    const Task* task_ = nullptr;
    int count_ = 0;
    alignas(64) std::atomic<int> next_{0};
    alignas(64) std::atomic<std::uint32_t> job_{0};
    alignas(64) std::atomic<std::uint32_t> busy_{0};
    std::atomic<bool> ending_{false};
    // Last, so that the threads are joined before what they look at ends.
    std::vector<std::jthread> threads_;
};

}  // namespace groundline::pipeline
