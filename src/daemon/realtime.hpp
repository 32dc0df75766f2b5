// Real time as far as the machine permits it: scheduling, processors, locked memory; and what was refused.
#pragma once

#include <sys/resource.h>
#include <sys/types.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <string>
#include <vector>

#include "pipeline/pipeline.hpp"
#include "settings/settings.hpp"

namespace groundline::daemon {

// Nothing here fails a start: a robot without real time is better than none. What was not permitted is said
// once in warnings() and, for as long as it lasts, in health.
class RealTime {
  public:
    // Sets the limits of the process. Makes no thread real-time yet.
    explicit RealTime(const settings::RealtimeSettings& settings);

    // On a thread of the pipeline, before its first frame: scheduling, processors, and the first 128 KB of
    // its stack touched. Writes no log. Threads that a library starts from such a thread are ordinary ones;
    // the processors they inherit, unless the driver sees to it (libcamera's does).
    void adopt(pipeline::ThreadRole role);

    // Once all threads and memory are there. Memory that is never touched stays untouched (MCL_ONFAULT).
    // Without the right to lock as much as one likes only what is there now is locked, because what comes
    // later could then be refused.
    void lock_memory();

    // The kernel says that a real-time thread ran for kLongestRun without ever waiting (SIGXCPU): makes all
    // of them ordinary, so that the rest of the computer lives.
    void give_up();

    bool scheduling() const { return scheduled_.load() > 0 && refused_.load() == 0; }
    bool memory_locked() const { return memory_locked_; }
    // One sentence each about what was refused since the last call. After all threads were adopted.
    std::vector<std::string> warnings();

    // Of processor time without a wait. The kernel's own guard leaves others 5 % long before.
    static constexpr rlim_t kLongestRunUs = 2'000'000;

  private:
    static constexpr std::size_t kMostThreads = 512;

    settings::RealtimeSettings settings_;
    std::array<std::atomic<pid_t>, kMostThreads> threads_{};
    std::atomic<std::size_t> threads_count_{0};
    std::atomic<int> scheduled_{0};
    std::atomic<int> refused_{0};
    std::atomic<int> schedule_fault_{0};  // errno of the last refusal of each kind
    std::atomic<int> affinity_fault_{0};
    int lock_fault_ = 0;
    bool memory_locked_ = false;
};

}  // namespace groundline::daemon
