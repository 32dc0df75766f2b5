#include "pipeline/worker_pool.hpp"

#include <pthread.h>

#include <string>
#include <system_error>

namespace groundline::pipeline {

WorkerPool::WorkerPool(int lanes, const std::function<void()>& on_start) {
    threads_.reserve(static_cast<std::size_t>(lanes > 1 ? lanes - 1 : 0));
    try {
        for (int lane = 1; lane < lanes; ++lane) {
            threads_.emplace_back([this, lane, on_start] {
                if (on_start) on_start();
                work(lane);
            });
            pthread_setname_np(threads_.back().native_handle(), ("gl-worker" + std::to_string(lane)).c_str());
        }
    } catch (const std::system_error& fault) {
        end();  // those that run already would be waited for without end
        throw std::system_error(fault.code(), "cannot start " + std::to_string(lanes) + " threads");
    }
}

WorkerPool::~WorkerPool() {
    end();
}

void WorkerPool::end() {
    ending_.store(true, std::memory_order_relaxed);
    job_.fetch_add(1, std::memory_order_release);
    job_.notify_all();
}

void WorkerPool::for_each(int count, Task task) {
    if (threads_.empty() || count <= 1) {
        for (int index = 0; index < count; ++index)
            task(index, 0);
        return;
    }
    task_ = &task;
    count_ = count;
    next_.store(0, std::memory_order_relaxed);
    // Each worker checks out of each job, so none can still look at this job when the next is set up.
    busy_.store(static_cast<std::uint32_t>(threads_.size()), std::memory_order_relaxed);
    job_.fetch_add(1, std::memory_order_release);
    job_.notify_all();
    run_share(0);
    for (std::uint32_t busy = busy_.load(std::memory_order_acquire); busy != 0;
         busy = busy_.load(std::memory_order_acquire))
        busy_.wait(busy, std::memory_order_acquire);
}

void WorkerPool::work(int lane) {
    // Jobs are counted from 0 and the pool does not start one before its constructor ends, but a thread may
    // arrive here after the first job was set up: it must not take that job for the initial state.
    std::uint32_t done = 0;
    for (;;) {
        job_.wait(done, std::memory_order_acquire);
        const std::uint32_t job = job_.load(std::memory_order_acquire);
        if (job == done) continue;
        if (ending_.load(std::memory_order_relaxed)) return;
        run_share(lane);
        done = job;
        if (busy_.fetch_sub(1, std::memory_order_acq_rel) == 1) busy_.notify_one();
    }
}

void WorkerPool::run_share(int lane) {
    const int count = count_;
    const Task& task = *task_;
    for (int index = next_.fetch_add(1, std::memory_order_relaxed); index < count;
         index = next_.fetch_add(1, std::memory_order_relaxed))
        task(index, lane);
}

}  // namespace groundline::pipeline
