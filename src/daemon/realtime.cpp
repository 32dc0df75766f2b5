#include "daemon/realtime.hpp"

#include <fmt/format.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "settings/cpu_list.hpp"

namespace groundline::daemon {
namespace {

constexpr std::size_t kStackBytes = 128 * 1024;

// The pages below the stack pointer are there from now on, before a deadline depends on them.
[[gnu::noinline]] void touch_stack() {
    char pages[kStackBytes];
    volatile char* touched = pages;
    for (std::size_t at = 0; at < kStackBytes; at += 1024)
        touched[at] = 0;
}

void raise_soft_limit(int what) {
    rlimit limit{};
    if (getrlimit(static_cast<__rlimit_resource_t>(what), &limit) != 0) return;
    limit.rlim_cur = limit.rlim_max;
    setrlimit(static_cast<__rlimit_resource_t>(what), &limit);
}

}  // namespace

RealTime::RealTime(const settings::RealtimeSettings& settings) : settings_(settings) {
    if (settings_.on) {
        raise_soft_limit(RLIMIT_RTPRIO);
        rlimit limit{};
        getrlimit(RLIMIT_RTTIME, &limit);
        limit.rlim_cur = std::min(limit.rlim_max, kLongestRunUs);
        setrlimit(RLIMIT_RTTIME, &limit);
    }
    if (settings_.lock_memory) raise_soft_limit(RLIMIT_MEMLOCK);
}

void RealTime::adopt(pipeline::ThreadRole role) {
    using pipeline::ThreadRole;
    const bool capture = role == ThreadRole::kCapture;
    const bool processing = role == ThreadRole::kProcessing;
    const std::string& cpus = capture      ? settings_.capture_cpus
                              : processing ? settings_.process_cpus
                                           : settings_.sinks_cpus;
    if (!cpus.empty()) {
        cpu_set_t set;
        CPU_ZERO(&set);
        const std::vector<int> listed = settings::parse_cpu_list(cpus).value_or(std::vector<int>());
        for (const int cpu : listed)
            CPU_SET(static_cast<std::size_t>(cpu), &set);
        if (sched_setaffinity(0, sizeof set, &set) != 0) affinity_fault_.store(errno);
    }
    if (settings_.on) {
        sched_param priority{};
        priority.sched_priority = capture      ? settings_.capture_priority
                                  : processing ? settings_.process_priority
                                               : settings_.sinks_priority;
        if (sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &priority) == 0) {
            ++scheduled_;
            const std::size_t index = threads_count_.fetch_add(1);
            if (index < kMostThreads) threads_[index].store(gettid());
        } else {
            schedule_fault_.store(errno);
            ++refused_;
        }
    }
    touch_stack();
}

void RealTime::lock_memory() {
    if (!settings_.lock_memory) return;
    rlimit limit{};
    getrlimit(RLIMIT_MEMLOCK, &limit);
    // Root may lock more than its limit, but may also have lost that right: only the limit is sure.
    const int later = limit.rlim_cur == RLIM_INFINITY ? MCL_FUTURE : 0;
    memory_locked_ = mlockall(MCL_CURRENT | MCL_ONFAULT | later) == 0;
    if (!memory_locked_) lock_fault_ = errno;
}

void RealTime::give_up() {
    const sched_param ordinary{};
    // Only root may take the flag away again.
    constexpr int kOrdinary = SCHED_OTHER | SCHED_RESET_ON_FORK;
    const std::size_t count = std::min(threads_count_.load(), kMostThreads);
    for (std::size_t index = 0; index < count; ++index)
        if (const pid_t thread = threads_[index].load()) sched_setscheduler(thread, kOrdinary, &ordinary);
    ++refused_;
}

std::vector<std::string> RealTime::warnings() {
    std::vector<std::string> sentences;
    if (const int fault = schedule_fault_.exchange(0))
        sentences.push_back(
            fmt::format("real-time scheduling was refused ({}), so frames may be late while the computer is "
                        "busy; permit it "
                        "with LimitRTPRIO={} in the unit, or set realtime.scheduling: off",
                        std::strerror(fault), settings_.capture_priority));
    if (const int fault = affinity_fault_.exchange(0))
        sentences.push_back(
            fmt::format("a list of processors was refused ({}); this computer has processors 0 to {}: check "
                        "realtime.capture_cpus, realtime.process_cpus and realtime.sinks_cpus",
                        std::strerror(fault), sysconf(_SC_NPROCESSORS_CONF) - 1));
    if (const int fault = std::exchange(lock_fault_, 0))
        sentences.push_back(
            fmt::format("memory could not be locked ({}), so it may be swapped out; permit it with "
                        "LimitMEMLOCK=infinity in the unit, or set realtime.lock_memory: off",
                        std::strerror(fault)));
    return sentences;
}

}  // namespace groundline::daemon
