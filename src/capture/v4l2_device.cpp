#include "capture/v4l2_device.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

namespace groundline::capture {
namespace {

// Three that wait for the other eye, one in a pair, two for the device to fill.
constexpr std::uint32_t kWantedBuffers = 6;
constexpr std::uint32_t kLeastBuffers = 3;
// A rate this much below what was asked makes another format worth a try.
constexpr double kNearEnough = 0.9;
constexpr double kExposureUnitUs = 100.0;  // of V4L2_CID_EXPOSURE_ABSOLUTE

constexpr std::array<std::uint32_t, static_cast<std::size_t>(kPixelFormats)> kFourcc = {
    V4L2_PIX_FMT_GREY,  V4L2_PIX_FMT_NV12,  V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_UYVY,
    V4L2_PIX_FMT_Y10,   V4L2_PIX_FMT_Y10P,  V4L2_PIX_FMT_Y12,  V4L2_PIX_FMT_Y16,
    V4L2_PIX_FMT_RGB24, V4L2_PIX_FMT_BGR24, V4L2_PIX_FMT_MJPEG};

std::uint32_t fourcc_of(PixelFormat format) {
    return kFourcc[static_cast<std::size_t>(format)];
}

CameraFault kind_of(int error) {
    switch (error) {
        case ENOENT:
        case ENODEV:
        case ENXIO:
            return CameraFault::kAbsent;
        case EBUSY:
            return CameraFault::kBusy;
        case EACCES:
        case EPERM:
            return CameraFault::kRefused;
        default:
            return CameraFault::kFailed;
    }
}

const char* advice_for(int error) {
    switch (error) {
        case ENOENT:
            return "; is it plugged in?";
        case EBUSY:
            return "; another program uses it, end that one";
        case EACCES:
        case EPERM:
            return "; add this user to the group video";
        default:
            return "";
    }
}

// What a refused request says of the device, not of the value.
bool device_failed(int error) {
    return error == ENODEV || error == ENXIO || error == EIO || error == EPIPE || error == ETIMEDOUT;
}

// What goes for every other request as well. EIO and EPIPE do not: some cameras answer so to what they lack.
bool device_lost(int error) {
    return error == ENODEV || error == ENXIO || error == ETIMEDOUT;
}

v4l2_format format_request(PixelFormat format, int width, int height) {
    v4l2_format request{};
    request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    request.fmt.pix.width = static_cast<std::uint32_t>(width);
    request.fmt.pix.height = static_cast<std::uint32_t>(height);
    request.fmt.pix.pixelformat = fourcc_of(format);
    request.fmt.pix.field = V4L2_FIELD_NONE;
    return request;
}

v4l2_buffer buffer_request(std::uint32_t index) {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    return buffer;
}

StampSource source_of(const v4l2_buffer& buffer, bool devices_own) {
    // What kind of stamp it is, is said only together with its clock: without that, the bits for "end of
    // frame" are 0.
    if (!devices_own || (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC)
        return StampSource::kArrival;
    return (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE
               ? StampSource::kStartOfExposure
               : StampSource::kEndOfFrame;
}

}  // namespace

int V4l2Device::call(unsigned long request, void* argument) {
    int result = 0;
    do
        result = system_.ioctl(fd_, request, argument);
    while (result == -EINTR);
    return result;
}

Fault V4l2Device::fault(CameraFault kind, const char* what) const {
    return {kind, Sentence::of("%s %s %s", label_.c_str(), path_.c_str(), what)};
}

Fault V4l2Device::fault_of(int error, const char* what) const {
    return {kind_of(error), Sentence::of("%s %s: %s: %s%s", label_.c_str(), path_.c_str(), what,
                                         strerrordesc_np(error), advice_for(error))};
}

Fault V4l2Device::open(const std::string& path) {
    close();
    path_ = path;
    dead_ = false;
    left_out_ = 0;
    do
        fd_ = system_.open(path.c_str());
    while (fd_ == -EINTR);
    if (fd_ < 0) {
        const int error = -fd_;
        fd_ = -1;
        return fault_of(error, "cannot be opened");
    }
    return check_capabilities();
}

Fault V4l2Device::set_up(const CameraSetup& setup, int width, int height) {
    Fault result = choose_format(setup, width, height);
    if (result.ok()) result = set_controls(setup);
    if (result.ok()) result = take_buffers();
    return result;
}

Fault V4l2Device::check_capabilities() {
    v4l2_capability capability{};
    const int result = call(VIDIOC_QUERYCAP, &capability);
    if (result == -ENOTTY) return fault(CameraFault::kRefused, "is no video device; check its name");
    if (result < 0) return fault_of(-result, "does not say what it can do");
    std::memcpy(driver_.data(), capability.driver, std::min(sizeof capability.driver, driver_.size() - 1));
    const std::uint32_t can = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? capability.device_caps
                                                                                    : capability.capabilities;
    if ((can & V4L2_CAP_VIDEO_CAPTURE) == 0) {
        if ((can & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0)
            return fault(CameraFault::kRefused,
                         "is part of a camera system that needs libcamera; set capture.driver: libcamera");
        // A loopback device captures only while something writes to it: it may come.
        return fault(CameraFault::kAbsent,
                     "gives no pictures (it is an output, or holds metadata); check its name, or start what "
                     "writes to it");
    }
    if ((can & V4L2_CAP_STREAMING) == 0)
        return fault(CameraFault::kRefused, "cannot stream from mapped memory; it is of no use here");
    return {};
}

double V4l2Device::set_rate(double rate_hz) {
    v4l2_streamparm parameters{};
    parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (rate_hz > 0.0) {
        parameters.parm.capture.timeperframe.numerator = 1000;
        parameters.parm.capture.timeperframe.denominator =
            static_cast<std::uint32_t>(std::lround(rate_hz * 1000.0));
        if (call(VIDIOC_S_PARM, &parameters) < 0) return 0.0;
    } else if (call(VIDIOC_G_PARM, &parameters) < 0) {
        return 0.0;
    }
    const v4l2_fract& period = parameters.parm.capture.timeperframe;
    if (period.numerator == 0 || period.denominator == 0) return 0.0;
    return static_cast<double>(period.denominator) / static_cast<double>(period.numerator);
}

std::optional<V4l2Device::Offer> V4l2Device::try_format(PixelFormat format, const CameraSetup& setup,
                                                        int width, int height, int& error, Sentence& other) {
    v4l2_format request = format_request(format, width, height);
    const int result = call(VIDIOC_S_FMT, &request);
    if (result < 0) {
        error = -result;
        return std::nullopt;
    }
    const v4l2_pix_format& got = request.fmt.pix;
    const bool jpeg = format == PixelFormat::kMjpeg;
    if (got.pixelformat != fourcc_of(format) || got.width != static_cast<std::uint32_t>(width) ||
        got.height != static_cast<std::uint32_t>(height) ||
        (!jpeg && got.bytesperline < luma_row_bytes(format, width))) {
        char name[5] = {};
        std::memcpy(name, &got.pixelformat, 4);
        other = Sentence::of("%ux%u %s", got.width, got.height, name);
        return std::nullopt;
    }
    return Offer{format, got.bytesperline, set_rate(setup.rate_hz)};
}

Fault V4l2Device::choose_format(const CameraSetup& setup, int width, int height) {
    std::array<bool, static_cast<std::size_t>(kPixelFormats)> offered{};
    bool listed = false;
    for (std::uint32_t index = 0; index < 256; ++index) {
        v4l2_fmtdesc description{};
        description.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
        description.index = index;
        if (call(VIDIOC_ENUM_FMT, &description) < 0) break;
        listed = true;
        const auto* found = std::find(kFourcc.begin(), kFourcc.end(), description.pixelformat);
        if (found != kFourcc.end()) offered[static_cast<std::size_t>(found - kFourcc.begin())] = true;
    }
    std::optional<Offer> best;
    Sentence other;
    int error = 0;
    for (int i = 0; i < kPixelFormats; ++i) {
        const auto format = static_cast<PixelFormat>(i);
        if (setup.format ? format != *setup.format : listed && !offered[static_cast<std::size_t>(i)])
            continue;
        const std::optional<Offer> offer = try_format(format, setup, width, height, error, other);
        if (error == EBUSY || device_lost(error)) return fault_of(error, "cannot be set up");
        if (!offer) continue;
        if (!best || offer->rate_hz > best->rate_hz) best = offer;
        if (offer->rate_hz == 0.0 || offer->rate_hz >= kNearEnough * setup.rate_hz) {
            best = offer;
            break;
        }
    }
    if (!best && other.empty() && device_failed(error)) return fault_of(error, "cannot be set up");
    if (!best) {
        const Sentence wanted = Sentence::of(
            "does not give %dx%d %s%s%s; set capture.width, capture.height and capture.format to what it "
            "lists",
            width, height, setup.format ? name_of(*setup.format).data() : "in a format we know",
            other.empty() ? "" : ", it offers ", other.c_str());
        return fault(CameraFault::kRefused, wanted.c_str());
    }
    // Another format may have been tried since.
    best = try_format(best->format, setup, width, height, error, other);
    if (!best) return fault(CameraFault::kFailed, "gave a format and then another one when asked again");
    format_ = best->format;
    bytes_per_line_ = format_ == PixelFormat::kMjpeg ? 0 : best->bytes_per_line;
    rate_hz_ = best->rate_hz;
    return {};
}

int V4l2Device::set_control(const Control& wanted) {
    v4l2_control control{};
    control.id = wanted.id;
    control.value = wanted.value;
    return -std::min(0, call(VIDIOC_S_CTRL, &control));
}

Fault V4l2Device::prefer(std::initializer_list<Control> choices) {
    for (const Control& choice : choices) {
        const int error = set_control(choice);
        if (device_lost(error)) return fault_of(error, "does not answer");
        if (error == 0) break;
    }
    return {};
}

Fault V4l2Device::demand(std::initializer_list<Control> choices, const char* what, const char* advice) {
    for (const Control& choice : choices) {
        const int error = set_control(choice);
        if (error == 0) return {};
        if (device_failed(error)) return fault_of(error, what);
    }
    return fault(CameraFault::kRefused, Sentence::of("%s; %s", what, advice).c_str());
}

std::optional<std::int32_t> V4l2Device::control(std::uint32_t id) {
    v4l2_control control{};
    control.id = id;
    if (call(VIDIOC_G_CTRL, &control) < 0) return std::nullopt;
    return control.value;
}

Fault V4l2Device::set_controls(const CameraSetup& setup) {
    const auto flip = [&](std::uint32_t id, bool wanted) {
        return wanted ? demand({{id, 1}}, "cannot flip its picture", "set capture.flip: none")
                      : prefer({{id, 0}});
    };
    const bool both = setup.flip == Flip::kBoth;
    Fault result = flip(V4L2_CID_HFLIP, both || setup.flip == Flip::kHorizontal);
    if (result.ok()) result = flip(V4L2_CID_VFLIP, both || setup.flip == Flip::kVertical);
    // What is left to the camera is given back to it: it keeps what an earlier run has set. Not every camera
    // has all of these, and with none of them it is automatic anyway.
    if (result.ok() && !setup.exposure_us)
        result = prefer({{V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_APERTURE_PRIORITY},
                         {V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_AUTO}});
    if (result.ok() && !setup.gain) result = prefer({{V4L2_CID_AUTOGAIN, 1}});
    // Else some cameras lower their rate in the dark, each by itself.
    if (result.ok()) result = prefer({{V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0}});
    if (!result.ok()) return result;
    ExposureValues wanted;
    if (setup.exposure_us) wanted.exposure_us = *setup.exposure_us;
    if (setup.gain) wanted.gain = *setup.gain;
    return set_exposure(wanted);
}

Fault V4l2Device::set_exposure(const ExposureValues& wanted) {
    Fault result;
    if (!std::isnan(wanted.exposure_us)) {
        const auto value = static_cast<std::int32_t>(std::lround(wanted.exposure_us / kExposureUnitUs));
        result = prefer({{V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL}});
        if (result.ok())
            result = demand({{V4L2_CID_EXPOSURE_ABSOLUTE, std::max(1, value)}}, "does not take this exposure",
                            "set capture.exposure_us: auto and capture.follow_exposure: off");
    }
    if (result.ok() && !std::isnan(wanted.gain)) {
        const auto value = static_cast<std::int32_t>(std::lround(wanted.gain));
        result = prefer({{V4L2_CID_AUTOGAIN, 0}});
        if (result.ok())
            result =
                demand({{V4L2_CID_GAIN, value}, {V4L2_CID_ANALOGUE_GAIN, value}}, "does not take this gain",
                       "set capture.gain: auto and capture.follow_exposure: off");
    }
    return result;
}

ExposureValues V4l2Device::read_exposure() {
    ExposureValues values;
    if (const auto exposure = control(V4L2_CID_EXPOSURE_ABSOLUTE))
        values.exposure_us = kExposureUnitUs * *exposure;
    if (const auto gain = control(V4L2_CID_GAIN))
        values.gain = *gain;
    else if (const auto analogue = control(V4L2_CID_ANALOGUE_GAIN))
        values.gain = *analogue;
    return values;
}

Fault V4l2Device::take_buffers() {
    v4l2_requestbuffers request{};
    request.count = kWantedBuffers;
    request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    request.memory = V4L2_MEMORY_MMAP;
    int result = call(VIDIOC_REQBUFS, &request);
    if (result < 0) return fault_of(-result, "gives no buffers");
    if (request.count < kLeastBuffers)
        return fault(CameraFault::kFailed,
                     "gives too few buffers; on a Raspberry Pi raise cma= in config.txt");
    for (std::uint32_t index = 0; index < request.count; ++index) {
        v4l2_buffer buffer = buffer_request(index);
        result = call(VIDIOC_QUERYBUF, &buffer);
        if (result < 0) return fault_of(-result, "does not show its buffers");
        void* memory = system_.map(fd_, buffer.length, buffer.m.offset);
        if (memory == nullptr) return fault(CameraFault::kFailed, "does not let its buffers be mapped");
        buffers_.push_back({memory, buffer.length});
    }
    return {};
}

Fault V4l2Device::start() {
    clock_ = {};
    good_seen_ = false;
    sequence_ = 0;
    for (std::uint32_t index = 0; index < buffers_.size(); ++index) {
        v4l2_buffer buffer = buffer_request(index);
        const int result = call(VIDIOC_QBUF, &buffer);
        if (result < 0) return fault_of(-result, "does not take a buffer");
    }
    started_mono_ns_ = system_.mono_ns();
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    const int result = call(VIDIOC_STREAMON, &type);
    if (result == -ENOSPC)
        return fault(
            CameraFault::kFailed,
            "has no room on its USB bus; use another port, a smaller picture, a lower rate or mjpeg");
    if (result < 0) return fault_of(-result, "does not start");
    streaming_ = true;
    return {};
}

V4l2Device::Dequeued V4l2Device::dequeue(V4l2Picture& picture, bool polled_error, Fault& out) {
    // Bounded, so that a device that floods us with empty buffers cannot hold us here.
    for (std::size_t tries = 0; tries <= buffers_.size(); ++tries) {
        v4l2_buffer buffer = buffer_request(0);
        const int result = call(VIDIOC_DQBUF, &buffer);
        if (result == -EAGAIN && !polled_error) return Dequeued::kNothing;
        if (result < 0) {
            dead_ = true;
            out = result == -EAGAIN ? fault(CameraFault::kFailed, "reports an error and gives no picture")
                                    : fault_of(-result, "gave no picture");
            return Dequeued::kFault;
        }
        polled_error = false;
        if (buffer.index >= buffers_.size()) {
            dead_ = true;
            out = fault(CameraFault::kFailed, "gave a buffer that is not ours");
            return Dequeued::kFault;
        }
        const StampClock::Instant now{system_.mono_ns(), system_.real_ns()};
        const std::int64_t stamp_ns = static_cast<std::int64_t>(buffer.timestamp.tv_sec) * 1'000'000'000 +
                                      static_cast<std::int64_t>(buffer.timestamp.tv_usec) * 1000;
        const std::optional<StampClock::Stamp> stamp = clock_.read(stamp_ns, now);
        const bool damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0 || buffer.bytesused == 0;
        const bool has_clock = clock_.clock() != StampClock::Clock::kNone;
        const bool stale =
            !stamp || (has_clock && (!stamp->devices_own || stamp->mono_ns < started_mono_ns_));
        if (!good_seen_ && (damaged || stale)) {
            ++left_out_;
            out = requeue(static_cast<int>(buffer.index));
            if (!out.ok()) return Dequeued::kFault;
            continue;
        }
        const Buffer& memory = buffers_[buffer.index];
        picture.index = static_cast<int>(buffer.index);
        picture.bytes = {static_cast<const std::uint8_t*>(memory.memory),
                         std::min<std::size_t>(buffer.bytesused, memory.length)};
        // A device that does not count, or begins anew, has lost nothing that is known.
        const std::uint32_t step = good_seen_ ? buffer.sequence - device_sequence_ : 0;
        const bool counts = step > 0 && step < (1U << 31U);
        picture.lost = counts ? static_cast<std::int64_t>(step) - 1 : 0;
        if (good_seen_) sequence_ += counts ? step : 1;
        picture.sequence = sequence_;
        device_sequence_ = buffer.sequence;
        picture.exposure_mono_ns = stamp->mono_ns;
        picture.source = source_of(buffer, stamp->devices_own);
        picture.arrival_mono_ns = now.mono_ns;
        picture.damaged = damaged;
        good_seen_ = true;
        return Dequeued::kPicture;
    }
    return Dequeued::kNothing;
}

Fault V4l2Device::requeue(int index) {
    if (dead_ || fd_ < 0) return {};
    v4l2_buffer buffer = buffer_request(static_cast<std::uint32_t>(index));
    const int result = call(VIDIOC_QBUF, &buffer);
    if (result >= 0) return {};
    dead_ = true;
    return fault_of(-result, "does not take its buffer back");
}

void V4l2Device::close() {
    if (fd_ < 0) return;
    if (streaming_) {
        int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
        (void)call(VIDIOC_STREAMOFF, &type);
        streaming_ = false;
    }
    for (const Buffer& buffer : buffers_)
        (void)system_.unmap(buffer.memory, buffer.length);
    buffers_.clear();
    (void)system_.close(fd_);
    fd_ = -1;
}

}  // namespace groundline::capture
