#include "cli/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>

#include "core/clock.hpp"

namespace groundline::cli {

Progress::Progress(const Counters& counters, std::int64_t frames)
    : counters_(counters), frames_(frames), begin_ns_(now_mono_ns()), thread_([this] { show(); }) {}

Progress::~Progress() {
    {
        const std::lock_guard lock(mutex_);
        done_ = true;
    }
    ended_.notify_one();
    thread_.join();
}

void Progress::show() {
    if (isatty(STDERR_FILENO) == 0) return;
    std::unique_lock lock(mutex_);
    while (!ended_.wait_for(lock, std::chrono::seconds(1), [this] { return done_; })) {
        const std::uint64_t done = counters_.get(Count::kResultsDelivered);
        const double seconds = static_cast<double>(now_mono_ns() - begin_ns_) * 1e-9;
        fmt::print(stderr, "\r{} frames{}, {:.1f} a second  ", done,
                   frames_ >= 0 ? fmt::format(" of {}", frames_) : "", static_cast<double>(done) / seconds);
    }
    fmt::print(stderr, "\r\x1b[K");
}

}  // namespace groundline::cli
