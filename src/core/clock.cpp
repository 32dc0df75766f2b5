#include "core/clock.hpp"

#include <ctime>

namespace groundline {
namespace {

std::int64_t read_ns(clockid_t clock) {
    timespec time{};
    clock_gettime(clock, &time);
    return static_cast<std::int64_t>(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
}

}  // namespace

std::int64_t now_mono_ns() {
    return read_ns(CLOCK_MONOTONIC);
}

std::int64_t now_utime_us() {
    return read_ns(CLOCK_REALTIME) / 1000;
}

}  // namespace groundline
