#include "capture/v4l2_driver.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

namespace groundline::capture {
namespace {

constexpr const char* kCutShort = "a picture is cut short or damaged";

}  // namespace

V4l2Driver::V4l2Driver(CameraSetup setup, V4l2System& system, V4l2Places places)
    : setup_(std::move(setup)), system_(system), places_(std::move(places)) {
    if (setup_.side_by_side()) {
        cameras_.push_back(std::make_unique<Camera>(system_, "stereo camera", Eye::kBoth));
    } else {
        cameras_.push_back(std::make_unique<Camera>(system_, "left camera", Eye::kLeft));
        cameras_.push_back(std::make_unique<Camera>(system_, "right camera", Eye::kRight));
    }
}

// All devices are found and opened before any is changed: one that waits for its partner must stay free for
// whoever else sets it up, as the writer of a loopback device does.
Fault V4l2Driver::open() {
    told_by_wait_ = {};
    next_camera_ = 0;
    whole_sequence_ = -1;
    description_ = {};
    Fault fault = open_devices();
    if (fault.ok()) fault = set_up_devices();
    if (!fault.ok()) close();
    return fault;
}

Fault V4l2Driver::open_devices() {
    std::array<std::string, 2> paths;
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
        const Eye eye = cameras_[i]->eye;
        const std::string& name = eye == Eye::kBoth   ? setup_.device
                                  : eye == Eye::kLeft ? setup_.left
                                                      : setup_.right;
        const Fault fault = find_v4l2_device(name, places_, paths[i]);
        if (!fault.ok()) return fault;
    }
    if (paths[0] == paths[1])
        return {
            CameraFault::kRefused,
            Sentence::of("capture.left and capture.right are both %s; name two cameras", paths[0].c_str())};
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
        const Fault fault = cameras_[i]->device.open(paths[i]);
        if (!fault.ok()) return fault;
    }
    return {};
}

Fault V4l2Driver::set_up_devices() {
    const bool both = setup_.side_by_side();
    const int width = both ? 2 * setup_.width : setup_.width;
    std::array<char, 256> text{};
    int length = 0;
    for (const auto& camera : cameras_) {
        V4l2Device& device = camera->device;
        const Fault fault = device.set_up(setup_, width, setup_.height);
        if (!fault.ok()) return fault;
        if (both && device.format() == PixelFormat::kY10P && setup_.width % 4 != 0)
            return {CameraFault::kRefused,
                    Sentence::of("%s: packed pixels come in fours; set capture.width to a multiple of 4",
                                 device.path().c_str())};
        camera->pictures.assign(static_cast<std::size_t>(device.buffers()), {});
        if (length < static_cast<int>(text.size()))
            length += std::snprintf(text.data() + length, text.size() - static_cast<std::size_t>(length),
                                    "%s%s (%s) %s %dx%d at %.4g Hz", length > 0 ? ", " : "",
                                    device.path().c_str(), device.driver(), name_of(device.format()).data(),
                                    width, setup_.height, device.rate_hz());
    }
    description_ = Sentence(text.data());
    if (both && cameras_[0]->device.format() == PixelFormat::kMjpeg)
        whole_.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(setup_.height));
    return {};
}

Fault V4l2Driver::start() {
    for (const auto& camera : cameras_) {
        const Fault fault = camera->device.start();
        if (!fault.ok()) return fault;
    }
    return {};
}

CameraDriver::Waited V4l2Driver::take(Camera& camera, bool polled_error, CameraFrame& frame, Fault& fault) {
    V4l2Picture picture;
    switch (camera.device.dequeue(picture, polled_error, fault)) {
        case V4l2Device::Dequeued::kNothing:
            return Waited::kNothing;
        case V4l2Device::Dequeued::kFault:
            return Waited::kFault;
        case V4l2Device::Dequeued::kPicture:
            break;
    }
    camera.pictures[static_cast<std::size_t>(picture.index)] = picture.bytes;
    frame.eye = camera.eye;
    frame.buffer = picture.index;
    frame.sequence = picture.sequence;
    frame.exposure_mono_ns = picture.exposure_mono_ns;
    frame.source = picture.source;
    frame.arrival_mono_ns = picture.arrival_mono_ns;
    frame.lost = picture.lost;
    frame.damaged = picture.damaged;
    return Waited::kFrame;
}

CameraDriver::Waited V4l2Driver::wait(std::int64_t deadline_mono_ns, CameraFrame& frame, Fault& fault) {
    std::array<pollfd, 2> fds{};
    for (;;) {
        if (!told_by_wait_.ok()) {
            fault = told_by_wait_;
            return Waited::kFault;
        }
        for (std::size_t i = 0; i < cameras_.size(); ++i) {
            Camera& camera = *cameras_[next_camera_];
            const bool polled_error = (fds[next_camera_].revents & (POLLERR | POLLHUP | POLLNVAL)) != 0;
            next_camera_ = (next_camera_ + 1) % cameras_.size();
            const Waited waited = take(camera, polled_error, frame, fault);
            if (waited != Waited::kNothing) return waited;
        }
        const std::int64_t now_ns = system_.mono_ns();
        if (deadline_mono_ns <= now_ns) return Waited::kNothing;
        const std::int64_t left_ns = std::min<std::int64_t>(deadline_mono_ns - now_ns, 1'000'000'000);
        for (std::size_t i = 0; i < cameras_.size(); ++i)
            fds[i] = {cameras_[i]->device.fd(), POLLIN, 0};
        const int ready =
            system_.poll({fds.data(), cameras_.size()}, static_cast<int>((left_ns + 999'999) / 1'000'000));
        if (ready <= 0) fds = {};  // time is up, or interrupted
    }
}

Fault V4l2Driver::copy_jpeg(Camera& camera, const CameraFrame& frame, Columns columns, Luma into) {
    const std::span<const std::uint8_t> jpeg = camera.pictures[static_cast<std::size_t>(frame.buffer)];
    const auto damaged = [&] {
        return Fault{CameraFault::kFailed, Sentence::of("%s: %s (%s)", camera.device.path().c_str(),
                                                        kCutShort, decoder_.problem())};
    };
    if (camera.eye != Eye::kBoth) return decoder_.decode(jpeg, into) ? Fault{} : damaged();
    const Luma whole(whole_.data(), 2 * setup_.width, setup_.height, 2 * setup_.width);
    if (whole_sequence_ != frame.sequence) {
        whole_sequence_ = -1;
        if (!decoder_.decode(jpeg, whole)) return damaged();
        whole_sequence_ = frame.sequence;
    }
    copy_pixels<std::uint8_t>({whole.data + columns.first, columns.count, whole.height, whole.stride}, into);
    return {};
}

Fault V4l2Driver::copy(const CameraFrame& frame, Eye eye, Luma into) {
    Camera& camera = camera_of(eye);
    const bool both = camera.eye == Eye::kBoth;
    const int width = both ? 2 * setup_.width : setup_.width;
    const Columns columns = !both               ? Columns{0, width}
                            : eye == Eye::kLeft ? left_half(width)
                                                : right_half(width);
    const PixelFormat format = camera.device.format();
    if (format == PixelFormat::kMjpeg) return copy_jpeg(camera, frame, columns, into);
    const RawPicture picture{camera.pictures[static_cast<std::size_t>(frame.buffer)], format, width,
                             setup_.height, camera.device.bytes_per_line()};
    if (unpack_luma(picture, columns, 0, into)) return {};
    return {CameraFault::kFailed, Sentence::of("%s: %s (%zu bytes)", camera.device.path().c_str(), kCutShort,
                                               picture.bytes.size())};
}

void V4l2Driver::release(const CameraFrame& frame) {
    Camera& camera = camera_of(frame.eye);
    const Fault fault = camera.device.requeue(frame.buffer);
    if (!fault.ok()) told_by_wait_ = fault;
}

void V4l2Driver::close() {
    for (const auto& camera : cameras_)
        camera->device.close();
}

int V4l2Driver::buffers_to_hold() const {
    int least = 1 << 20;
    for (const auto& camera : cameras_)
        least = std::min(least, camera->device.buffers());
    return std::max(1, least - 2);  // two are left to be filled
}

std::int64_t V4l2Driver::left_out() const {
    std::int64_t sum = 0;
    for (const auto& camera : cameras_)
        sum += camera->device.left_out();
    return sum;
}

Fault V4l2Driver::set_exposure(Eye eye, const ExposureValues& wanted) {
    return camera_of(eye).device.set_exposure(wanted);
}

ExposureValues V4l2Driver::read_exposure(Eye eye) {
    return camera_of(eye).device.read_exposure();
}

}  // namespace groundline::capture
