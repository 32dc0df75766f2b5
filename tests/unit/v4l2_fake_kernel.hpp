// A kernel with scripted V4L2 cameras in it, which notes every breach of the rules by whoever calls it.
#pragma once

#include <linux/videodev2.h>

#include <cerrno>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "capture/v4l2_system.hpp"

namespace groundline::capture::test {

inline constexpr std::int64_t kMs = 1'000'000;

struct FakeFormat {
    std::uint32_t fourcc = V4L2_PIX_FMT_GREY;
    std::uint32_t width = 64;
    std::uint32_t height = 48;
    double most_hz = 30.0;
    std::uint32_t bytes_per_line = 64;
};

// What a filled buffer says of itself.
struct FakePicture {
    std::int64_t stamp_ns = 0;
    std::uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    std::vector<std::uint8_t> bytes;
    int index = -1;
    std::uint32_t sequence = 0;
};

struct FakeCamera {
    std::uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
    std::vector<FakeFormat> formats = {{}};
    std::uint32_t most_buffers = 32;
    std::map<std::uint32_t, std::int32_t> controls;
    std::map<unsigned long, std::deque<int>> failures;  // next answers to a request: an errno each, 0 is none
    bool node = true;                                   // the path exists
    bool answers = true;                                // else every request is ENODEV
    bool poll_error = false;

    // The driver's state.
    int fd = -1;
    FakeFormat chosen;
    double rate_hz = 0.0;
    std::vector<std::vector<std::uint8_t>> buffers;
    std::set<int> queued;
    std::deque<FakePicture> ready;
    bool streaming = false;
    bool dead = false;  // a dequeue failed
    std::uint32_t sequence = 0;
    int mapped = 0;

    // A picture is taken: into a queued buffer if there is one, else it is lost.
    void expose(FakePicture picture) {
        picture.sequence = sequence++;
        if (!streaming || queued.empty()) return;
        picture.index = *queued.begin();
        queued.erase(queued.begin());
        auto& memory = buffers[static_cast<std::size_t>(picture.index)];
        std::copy_n(picture.bytes.begin(), std::min(memory.size(), picture.bytes.size()), memory.begin());
        ready.push_back(std::move(picture));
    }
    void expose(std::int64_t stamp_ns, std::uint8_t grey,
                std::uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC) {
        expose({stamp_ns, flags, std::vector<std::uint8_t>(chosen.bytes_per_line * chosen.height, grey)});
    }
};

class FakeKernel final : public V4l2System {
  public:
    FakeCamera& camera(const std::string& path) { return cameras_[path]; }
    // Runs `what` when the time has come, while somebody polls.
    void at(std::int64_t mono_ns, std::function<void()> what) { script_.emplace(mono_ns, std::move(what)); }

    // Lets time pass while nobody polls.
    void pass_to(std::int64_t mono_ns) {
        while (!script_.empty() && script_.begin()->first <= mono_ns)
            run_next();
        now_ns = std::max(now_ns, mono_ns);
    }

    std::int64_t now_ns = 1'000'000 * kMs;
    std::int64_t wall_minus_mono_ns = 1'700'000'000'000 * kMs;
    int interruptions = 0;  // that many calls are interrupted first
    std::vector<std::string> breaches;
    int opened = 0;
    int closed = 0;
    int mappings() const {
        int sum = 0;
        for (const auto& [path, camera] : cameras_)
            sum += camera.mapped;
        return sum;
    }

    int open(const char* path) override {
        if (interrupted()) return -EINTR;
        const auto found = cameras_.find(path);
        if (found == cameras_.end() || !found->second.node) return -ENOENT;
        FakeCamera& it = found->second;
        if (!it.answers) return -ENODEV;
        if (it.fd >= 0) return -EBUSY;
        it.fd = next_fd_++;
        it.dead = false;
        ++opened;
        return it.fd;
    }
    int close(int fd) override {
        FakeCamera* it = of(fd);
        if (it == nullptr) return -EBADF;
        if (it->mapped != 0) breaches.emplace_back("closed with buffers still mapped");
        if (it->streaming && it->answers) breaches.emplace_back("closed while streaming");
        it->fd = -1;
        stop(*it);
        ++closed;
        return 0;
    }
    void* map(int fd, std::size_t length, std::int64_t offset) override {
        FakeCamera* it = of(fd);
        if (it == nullptr) return nullptr;
        auto& memory = it->buffers[static_cast<std::size_t>(offset / 4096)];
        if (length != memory.size()) breaches.emplace_back("mapped with a wrong length");
        ++it->mapped;
        return memory.data();
    }
    int unmap(void* memory, std::size_t length) override {
        for (auto& [path, camera] : cameras_) {
            for (auto& buffer : camera.buffers) {
                if (buffer.data() != memory) continue;
                if (length != buffer.size()) breaches.emplace_back("unmapped with a wrong length");
                --camera.mapped;
                return 0;
            }
        }
        breaches.emplace_back("unmapped what was never mapped");
        return -EINVAL;
    }
    int poll(std::span<pollfd> fds, int timeout_ms) override {
        const std::int64_t until_ns = now_ns + timeout_ms * kMs;
        for (;;) {
            int ready = 0;
            for (pollfd& each : fds) {
                const FakeCamera* it = of(each.fd);
                each.revents = 0;
                if (it == nullptr)
                    each.revents = POLLNVAL;
                else if (it->poll_error || !it->answers)
                    each.revents = POLLERR;
                else if (!it->ready.empty())
                    each.revents = POLLIN;
                ready += each.revents != 0 ? 1 : 0;
            }
            if (ready > 0) return ready;
            if (script_.empty() || script_.begin()->first > until_ns) {
                now_ns = std::max(now_ns, until_ns);
                return 0;
            }
            run_next();
        }
    }
    int ioctl(int fd, unsigned long request, void* argument) override {
        if (interrupted()) return -EINTR;
        FakeCamera* it = of(fd);
        if (it == nullptr) {
            breaches.emplace_back("a request on a closed descriptor");
            return -EBADF;
        }
        if (!it->answers) {
            if (request == VIDIOC_QBUF && it->dead) breaches.emplace_back("queued on a dead device");
            if (request == VIDIOC_DQBUF || request == VIDIOC_QBUF) it->dead = true;
            if (request == VIDIOC_STREAMOFF) stop(*it);
            return -ENODEV;
        }
        const auto failing = it->failures.find(request);
        if (failing != it->failures.end() && !failing->second.empty()) {
            const int error = failing->second.front();
            failing->second.pop_front();
            if (error != 0) {
                if (request == VIDIOC_DQBUF || request == VIDIOC_QBUF) it->dead = true;
                return -error;
            }
        }
        return serve(*it, request, argument);
    }
    std::int64_t mono_ns() override { return now_ns; }
    std::int64_t real_ns() override { return now_ns + wall_minus_mono_ns; }

  private:
    void run_next() {
        now_ns = std::max(now_ns, script_.begin()->first);
        const auto what = std::move(script_.begin()->second);
        script_.erase(script_.begin());
        what();
    }
    bool interrupted() { return interruptions > 0 && interruptions-- > 0; }
    FakeCamera* of(int fd) {
        for (auto& [path, camera] : cameras_)
            if (fd >= 0 && camera.fd == fd) return &camera;
        return nullptr;
    }
    static void stop(FakeCamera& it) {
        it.streaming = false;
        it.queued.clear();
        it.ready.clear();
    }

    int serve(FakeCamera& it, unsigned long request, void* argument) {
        switch (request) {
            case VIDIOC_QUERYCAP: {
                auto& capability = *static_cast<v4l2_capability*>(argument);
                std::memcpy(capability.driver, "fake", 5);
                capability.capabilities = it.capabilities | V4L2_CAP_DEVICE_CAPS | V4L2_CAP_VIDEO_OUTPUT;
                capability.device_caps = it.capabilities;
                return 0;
            }
            case VIDIOC_ENUM_FMT: {
                auto& description = *static_cast<v4l2_fmtdesc*>(argument);
                if (description.index >= it.formats.size()) return -EINVAL;
                description.pixelformat = it.formats[description.index].fourcc;
                return 0;
            }
            case VIDIOC_S_FMT: {
                if (it.streaming) return -EBUSY;
                auto& pix = static_cast<v4l2_format*>(argument)->fmt.pix;
                it.chosen = it.formats.front();
                for (const FakeFormat& format : it.formats)
                    if (format.fourcc == pix.pixelformat) it.chosen = format;
                pix.pixelformat = it.chosen.fourcc;
                pix.width = it.chosen.width;
                pix.height = it.chosen.height;
                pix.bytesperline = it.chosen.bytes_per_line;
                pix.sizeimage = pix.bytesperline * pix.height * 2;
                return 0;
            }
            case VIDIOC_S_PARM: {
                auto& period = static_cast<v4l2_streamparm*>(argument)->parm.capture.timeperframe;
                it.rate_hz = std::min(it.chosen.most_hz, static_cast<double>(period.denominator) /
                                                             static_cast<double>(period.numerator));
                period = {1000, static_cast<std::uint32_t>(it.rate_hz * 1000.0)};
                return 0;
            }
            case VIDIOC_S_CTRL: {
                const auto& control = *static_cast<v4l2_control*>(argument);
                if (it.controls.count(control.id) == 0) return -EINVAL;
                it.controls[control.id] = control.value;
                return 0;
            }
            case VIDIOC_G_CTRL: {
                auto& control = *static_cast<v4l2_control*>(argument);
                if (it.controls.count(control.id) == 0) return -EINVAL;
                control.value = it.controls[control.id];
                return 0;
            }
            case VIDIOC_REQBUFS: {
                auto& wanted = *static_cast<v4l2_requestbuffers*>(argument);
                wanted.count = std::min(wanted.count, it.most_buffers);
                it.buffers.assign(wanted.count,
                                  std::vector<std::uint8_t>(4UL * it.chosen.width * it.chosen.height));
                return 0;
            }
            case VIDIOC_QUERYBUF: {
                auto& buffer = *static_cast<v4l2_buffer*>(argument);
                if (buffer.index >= it.buffers.size()) return -EINVAL;
                buffer.length = static_cast<std::uint32_t>(it.buffers[buffer.index].size());
                buffer.m.offset = buffer.index * 4096;
                return 0;
            }
            case VIDIOC_QBUF: {
                const auto& buffer = *static_cast<v4l2_buffer*>(argument);
                if (it.dead) breaches.emplace_back("queued on a dead device");
                if (!it.queued.insert(static_cast<int>(buffer.index)).second)
                    breaches.emplace_back("queued a buffer twice");
                for (const FakePicture& picture : it.ready)
                    if (picture.index == static_cast<int>(buffer.index))
                        breaches.emplace_back("queued a buffer that is not ours");
                return 0;
            }
            case VIDIOC_DQBUF: {
                if (!it.streaming) return -EINVAL;
                if (it.ready.empty()) return -EAGAIN;
                auto& buffer = *static_cast<v4l2_buffer*>(argument);
                const FakePicture& picture = it.ready.front();
                buffer.index = static_cast<std::uint32_t>(picture.index);
                buffer.bytesused = static_cast<std::uint32_t>(picture.bytes.size());
                buffer.flags = picture.flags;
                buffer.sequence = picture.sequence;
                buffer.timestamp.tv_sec = picture.stamp_ns / 1'000'000'000;
                buffer.timestamp.tv_usec = picture.stamp_ns % 1'000'000'000 / 1000;
                it.ready.pop_front();
                return 0;
            }
            case VIDIOC_STREAMON:
                it.streaming = true;
                it.sequence = 0;
                return 0;
            case VIDIOC_STREAMOFF:
                stop(it);
                return 0;
            default:
                return -ENOTTY;
        }
    }

    std::map<std::string, FakeCamera> cameras_;
    std::multimap<std::int64_t, std::function<void()>> script_;
    int next_fd_ = 3;
};

}  // namespace groundline::capture::test
