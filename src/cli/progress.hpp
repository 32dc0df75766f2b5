// Shows on a terminal how far a long run is.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>

#include "core/counters.hpp"

namespace groundline::cli {

// Writes to stderr once a second while it lives, if stderr is a terminal. `frames` expected, -1 unknown.
class Progress {
  public:
    Progress(const Counters& counters, std::int64_t frames);
    ~Progress();
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

  private:
    void show();

    const Counters& counters_;
    std::int64_t frames_;
    std::int64_t begin_ns_;
    std::mutex mutex_;
    std::condition_variable ended_;
    bool done_ = false;
    std::thread thread_;
};

}  // namespace groundline::cli
