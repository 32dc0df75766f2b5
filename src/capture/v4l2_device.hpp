// One V4L2 camera: set up, streaming from mapped buffers, and given back in full.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/camera_driver.hpp"
#include "capture/camera_setup.hpp"
#include "capture/pixel_formats.hpp"
#include "capture/stamp_clock.hpp"
#include "capture/v4l2_system.hpp"

namespace groundline::capture {

// One picture in one of the device's buffers, which is ours until requeue().
struct V4l2Picture {
    int index = 0;
    std::span<const std::uint8_t> bytes;  // what the driver filled
    std::int64_t sequence = 0;            // from 0 at the first good picture
    std::int64_t lost = 0;                // before this one
    std::int64_t exposure_mono_ns = 0;
    StampSource source = StampSource::kUnknown;
    std::int64_t arrival_mono_ns = 0;
    bool damaged = false;
};

// Single-planar capture with memory-mapped buffers. One thread. Every call names the device in its fault.
// After a fault of dequeue() or requeue() the device is dead: no buffer is queued on it again, only close()
// is left.
class V4l2Device {
  public:
    // `label` is what faults call it, "left camera". `system` is borrowed.
    V4l2Device(V4l2System& system, std::string label) : system_(system), label_(std::move(label)) {}
    ~V4l2Device() { close(); }
    V4l2Device(const V4l2Device&) = delete;
    V4l2Device& operator=(const V4l2Device&) = delete;

    // Opens `path` and checks that it captures; changes nothing on it.
    Fault open(const std::string& path);
    // Sets format, size (`width` by `height` of the whole picture), rate, flip and exposure of `setup`,
    // checks what came back, takes and maps buffers. Size, format and what `setup` asks by value must be met;
    // of the rate the nearest is taken: see rate_hz().
    Fault set_up(const CameraSetup& setup, int width, int height);
    // Queues all buffers and streams.
    Fault start();
    enum class Dequeued : std::uint8_t { kPicture, kNothing, kFault };
    // The next picture that is ready, without waiting. Before the first good one, empty, damaged and stale
    // buffers (stamped before start(), or on no clock yet) are left out and counted. `polled_error`: poll()
    // reported an error, so that nothing to dequeue is a fault.
    Dequeued dequeue(V4l2Picture& picture, bool polled_error, Fault& fault);
    Fault requeue(int index);
    // Stops, unmaps, closes; nothing where nothing is open.
    void close();

    int fd() const { return fd_; }
    bool dead() const { return dead_; }
    const std::string& path() const { return path_; }
    const char* driver() const { return driver_.data(); }
    PixelFormat format() const { return format_; }
    std::size_t bytes_per_line() const { return bytes_per_line_; }
    double rate_hz() const { return rate_hz_; }  // 0 where the device does not say
    int buffers() const { return static_cast<int>(buffers_.size()); }
    std::int64_t left_out() const { return left_out_; }
    StampClock::Clock clock() const { return clock_.clock(); }

    Fault set_exposure(const ExposureValues& wanted);
    ExposureValues read_exposure();

  private:
    struct Buffer {
        void* memory = nullptr;
        std::size_t length = 0;
    };
    struct Control {
        std::uint32_t id = 0;
        std::int32_t value = 0;
    };
    struct Offer {
        PixelFormat format = PixelFormat::kGrey;
        std::uint32_t bytes_per_line = 0;
        double rate_hz = 0.0;
    };

    int call(unsigned long request, void* argument);
    Fault fault(CameraFault kind, const char* what) const;
    Fault fault_of(int error, const char* what) const;
    Fault check_capabilities();
    Fault choose_format(const CameraSetup& setup, int width, int height);
    // The device's answer to one format; nothing where it gives another format or size, then in `other`.
    std::optional<Offer> try_format(PixelFormat format, const CameraSetup& setup, int width, int height,
                                    int& error, Sentence& other);
    double set_rate(double rate_hz);
    Fault set_controls(const CameraSetup& setup);
    Fault take_buffers();
    // 0, or the error.
    int set_control(const Control& wanted);
    // Sets the first of `choices` that the camera takes; it need not take any. A fault only if it is lost.
    Fault prefer(std::initializer_list<Control> choices);
    // As prefer(), but one must be taken: kRefused with `advice`, or what became of the device.
    Fault demand(std::initializer_list<Control> choices, const char* what, const char* advice);
    std::optional<std::int32_t> control(std::uint32_t id);

    V4l2System& system_;
    std::string label_;
    std::string path_;
    std::array<char, 32> driver_{};
    int fd_ = -1;
    bool streaming_ = false;
    bool dead_ = false;
    PixelFormat format_ = PixelFormat::kGrey;
    std::size_t bytes_per_line_ = 0;
    double rate_hz_ = 0.0;
    std::vector<Buffer> buffers_;

    StampClock clock_;
    std::int64_t started_mono_ns_ = 0;
    std::int64_t left_out_ = 0;
    bool good_seen_ = false;
    std::uint32_t device_sequence_ = 0;
    std::int64_t sequence_ = 0;
};

}  // namespace groundline::capture
