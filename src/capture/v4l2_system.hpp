// The few system calls a V4L2 camera needs, so that a test can stand in for the kernel.
#pragma once

#include <poll.h>

#include <cstddef>
#include <cstdint>
#include <span>

namespace groundline::capture {

// Each returns what the system call does, but the error itself, negated, instead of -1. Interrupted calls
// come back as -EINTR: whoever calls tries again.
class V4l2System {
  public:
    V4l2System() = default;
    V4l2System(const V4l2System&) = delete;
    V4l2System& operator=(const V4l2System&) = delete;
    virtual ~V4l2System() = default;

    virtual int open(const char* path) = 0;  // to read and write, not blocking, closed on exec
    virtual int close(int fd) = 0;
    virtual int ioctl(int fd, unsigned long request, void* argument) = 0;
    virtual void* map(int fd, std::size_t length, std::int64_t offset) = 0;  // nullptr where it fails
    virtual int unmap(void* memory, std::size_t length) = 0;
    virtual int poll(std::span<pollfd> fds, int timeout_ms) = 0;
    virtual std::int64_t mono_ns() = 0;  // CLOCK_MONOTONIC
    virtual std::int64_t real_ns() = 0;  // CLOCK_REALTIME
};

// The kernel's. Any thread.
V4l2System& real_v4l2_system();

}  // namespace groundline::capture
