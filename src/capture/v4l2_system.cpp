#include "capture/v4l2_system.hpp"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>

#include "core/clock.hpp"

namespace groundline::capture {
namespace {

int result_of(int returned) {
    return returned < 0 ? -errno : returned;
}

class RealSystem final : public V4l2System {
  public:
    int open(const char* path) override { return result_of(::open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC)); }
    int close(int fd) override { return result_of(::close(fd)); }
    int ioctl(int fd, unsigned long request, void* argument) override {
        return result_of(::ioctl(fd, request, argument));
    }
    void* map(int fd, std::size_t length, std::int64_t offset) override {
        void* memory = ::mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, offset);
        return memory == MAP_FAILED ? nullptr : memory;
    }
    int unmap(void* memory, std::size_t length) override { return result_of(::munmap(memory, length)); }
    int poll(std::span<pollfd> fds, int timeout_ms) override {
        return result_of(::poll(fds.data(), fds.size(), timeout_ms));
    }
    std::int64_t mono_ns() override { return now_mono_ns(); }
    std::int64_t real_ns() override { return now_utime_us() * 1000; }
};

}  // namespace

V4l2System& real_v4l2_system() {
    static RealSystem system;
    return system;
}

}  // namespace groundline::capture
