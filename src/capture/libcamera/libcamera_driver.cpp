#include "capture/libcamera/libcamera_driver.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <linux/dma-buf.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <map>
#include <string>
#include <utility>

#include "capture/libcamera/camera_names.hpp"
#include "capture/libcamera/libcamera_api.hpp"
#include "capture/libcamera/monotonic_stamp.hpp"
#include "capture/pixel_formats.hpp"
#include "capture/stamp_clock.hpp"

namespace groundline::capture {
namespace {

constexpr int kBuffers =
    6;  // four may wait for their partner while one is filled and one is queued behind it
constexpr std::size_t kMostBuffers = 32;

struct FormatName {
    libcamera::PixelFormat theirs;
    PixelFormat ours;
};

// In the order in which they are taken; of YUV420 only the plane of luma is read, which is NV12's.
const std::array kFormats = {
    FormatName{libcamera::formats::R8, PixelFormat::kGrey},
    FormatName{libcamera::formats::NV12, PixelFormat::kNv12},
    FormatName{libcamera::formats::YUV420, PixelFormat::kNv12},
    FormatName{libcamera::formats::YUYV, PixelFormat::kYuyv},
    FormatName{libcamera::formats::UYVY, PixelFormat::kUyvy},
    FormatName{libcamera::formats::BGR888, PixelFormat::kRgb24},  // named from the highest byte down
    FormatName{libcamera::formats::RGB888, PixelFormat::kBgr24},
};

std::int64_t clock_ns(clockid_t clock) {
    timespec now{};
    clock_gettime(clock, &now);
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

// The pictures of one camera's buffers in this process's memory.
class Mappings {
  public:
    Mappings() = default;
    Mappings(const Mappings&) = delete;
    Mappings& operator=(const Mappings&) = delete;
    ~Mappings() { clear(); }

    void clear() {
        for (const auto& [fd, mapped] : mapped_)
            munmap(mapped.data(), mapped.size());
        mapped_.clear();
    }
    // The first plane of the buffer; empty where it cannot be mapped, and then errno says why.
    std::span<const std::uint8_t> first_plane(const libcamera::FrameBuffer& buffer) {
        const libcamera::FrameBuffer::Plane& plane = buffer.planes().front();
        const int fd = plane.fd.get();
        const std::size_t offset =
            plane.offset == libcamera::FrameBuffer::Plane::kInvalidOffset ? 0 : plane.offset;
        const std::size_t length = offset + plane.length;
        auto found = mapped_.find(fd);
        if (found == mapped_.end()) {
            void* memory = mmap(nullptr, length, PROT_READ, MAP_SHARED, fd, 0);
            if (memory == MAP_FAILED) return {};
            found = mapped_.emplace(fd, std::span(static_cast<std::uint8_t*>(memory), length)).first;
        }
        if (found->second.size() < length) {
            errno = EINVAL;
            return {};
        }
        return found->second.subspan(offset, plane.length);
    }

  private:
    std::map<int, std::span<std::uint8_t>> mapped_;
};

// While one lives the processor's caches agree with what the camera wrote. Memory that is no dma-buf refuses,
// and needs nothing.
class Reading {
  public:
    explicit Reading(int fd) : fd_(fd) { tell(DMA_BUF_SYNC_START); }
    Reading(const Reading&) = delete;
    Reading& operator=(const Reading&) = delete;
    ~Reading() { tell(DMA_BUF_SYNC_END); }

  private:
    void tell(std::uint64_t what) const {
        dma_buf_sync sync{what | DMA_BUF_SYNC_READ};
        ioctl(fd_, DMA_BUF_IOCTL_SYNC, &sync);
    }
    int fd_;
};

std::string listed(const std::vector<libcamera::PixelFormat>& formats) {
    std::vector<std::string> names(formats.size());
    std::transform(formats.begin(), formats.end(), names.begin(),
                   [](const libcamera::PixelFormat& format) { return format.toString(); });
    return names.empty() ? "none" : fmt::format("{}", fmt::join(names, " "));
}

}  // namespace

// libcamera allows one in a process at a time.
struct LibcameraDriver::Manager {
    libcamera::CameraManager cameras;
    bool started = false;

    ~Manager() {
        if (started) cameras.stop();
    }
};

// One of libcamera's cameras, and what crosses from its thread.
class LibcameraDriver::Camera {
  public:
    Camera(Eye eye, const char* label) : eye_(eye), label_(label) {}
    Camera(const Camera&) = delete;
    Camera& operator=(const Camera&) = delete;
    ~Camera() { close(); }

    Fault open(std::shared_ptr<libcamera::Camera> camera, const CameraSetup& setup, int woken);
    Fault start(const CameraSetup& setup);
    void close();

    // Of one picture that libcamera has filled.
    struct Filled {
        int buffer;
        std::int64_t arrival_mono_ns;
        std::int64_t arrival_boot_ns;
    };
    bool take(Filled& filled) { return filled_.pop(filled); }
    bool gone() const { return gone_.load(std::memory_order_relaxed); }
    // False where the stamp says that the picture was left over from before.
    bool describe(const Filled& filled, CameraFrame& frame);
    Fault copy(int buffer, Columns columns, Luma into);
    Fault requeue(int buffer);

    void set_exposure(const ExposureValues& wanted) {
        if (!std::isnan(wanted.exposure_us)) wanted_.exposure_us = wanted.exposure_us;
        if (!std::isnan(wanted.gain)) wanted_.gain = wanted.gain;
    }
    ExposureValues used() const { return used_; }
    Eye eye() const { return eye_; }
    int buffers() const { return static_cast<int>(requests_.size()); }
    std::string description(double rate_hz) const;

  private:
    Fault configure(const CameraSetup& setup, int width);
    void completed(libcamera::Request* request);
    bool has(const libcamera::ControlId& control) const { return camera_->controls().count(&control) != 0; }
    void put_exposure(libcamera::ControlList& controls);
    Fault failed(const char* what, int error) const {
        return {error == -ENODEV || gone() ? CameraFault::kAbsent
                : error == -EBUSY          ? CameraFault::kBusy
                                           : CameraFault::kFailed,
                Sentence::of("%s (%s): %s: %s", label_, id_.c_str(), what, std::strerror(-error))};
    }

    Eye eye_;
    const char* label_;
    std::string id_;
    int woken_ = -1;
    std::shared_ptr<libcamera::Camera> camera_;
    std::unique_ptr<libcamera::CameraConfiguration> configuration_;
    std::unique_ptr<libcamera::FrameBufferAllocator> allocator_;
    std::vector<std::unique_ptr<libcamera::Request>> requests_;
    std::vector<std::span<const std::uint8_t>> planes_;
    std::vector<std::size_t> bytes_;  // that the picture in each buffer has
    Mappings mappings_;
    PixelFormat format_ = PixelFormat::kGrey;
    StampClock clock_;
    std::int64_t last_sequence_ = -1;
    ExposureValues wanted_;  // not yet given to the camera
    ExposureValues used_;
    bool started_ = false;
    std::atomic<bool> gone_{false};
    boost::lockfree::spsc_queue<Filled, boost::lockfree::capacity<kMostBuffers>> filled_;
};

Fault LibcameraDriver::Camera::open(std::shared_ptr<libcamera::Camera> camera, const CameraSetup& setup,
                                    int woken) {
    camera_ = std::move(camera);
    id_ = camera_->id();
    woken_ = woken;
    gone_ = false;
    clock_ = {};
    last_sequence_ = -1;
    used_ = {};
    wanted_ = {};
    if (setup.exposure_us) wanted_.exposure_us = *setup.exposure_us;
    if (setup.gain) wanted_.gain = *setup.gain;
    if (const int error = camera_->acquire(); error != 0) {
        const Fault fault = failed("another program has it, or it cannot be taken", error);
        camera_.reset();
        return fault;
    }
    const int width = eye_ == Eye::kBoth ? 2 * setup.width : setup.width;
    if (Fault fault = configure(setup, width); !fault.ok()) return fault;
    libcamera::Stream* const stream = configuration_->at(0).stream();
    allocator_ = std::make_unique<libcamera::FrameBufferAllocator>(camera_);
    if (const int count = allocator_->allocate(stream); count < 0)
        return failed("no memory for pictures", count);
    const auto& buffers = allocator_->buffers(stream);
    if (buffers.size() > kMostBuffers) return failed("takes more buffers than can be held", -ENOBUFS);
    for (std::size_t i = 0; i < buffers.size(); ++i) {
        const std::span<const std::uint8_t> plane = mappings_.first_plane(*buffers[i]);
        if (plane.empty()) return failed("pictures cannot be mapped", -errno);
        planes_.push_back(plane);
        bytes_.push_back(0);
        std::unique_ptr<libcamera::Request> request = camera_->createRequest(i);
        if (!request) return failed("no request", -ENOMEM);
        if (const int error = request->addBuffer(stream, buffers[i].get()); error != 0)
            return failed("no request with a buffer", error);
        requests_.push_back(std::move(request));
    }
    camera_->requestCompleted.connect(this, [this](libcamera::Request* request) { completed(request); });
    camera_->disconnected.connect(this, [this] {
        gone_ = true;
        eventfd_write(woken_, 1);
    });
    return {};
}

Fault LibcameraDriver::Camera::configure(const CameraSetup& setup, int width) {
    const libcamera::Size size(static_cast<unsigned>(width), static_cast<unsigned>(setup.height));
    std::string instead;
    for (const FormatName& name : kFormats) {
        if (setup.format && *setup.format != name.ours) continue;
        configuration_ = api::video_configuration(*camera_);
        if (!configuration_ || configuration_->empty()) return failed("gives no video", -EINVAL);
        libcamera::StreamConfiguration& stream = configuration_->at(0);
        stream.pixelFormat = name.theirs;
        stream.size = size;
        stream.bufferCount = kBuffers;
        api::turn_of(*configuration_) = api::turned_by(setup.flip);
        if (configuration_->validate() == libcamera::CameraConfiguration::Invalid) continue;
        if (stream.pixelFormat != name.theirs) continue;
        if (stream.size != size) {
            instead = stream.size.toString();
            continue;
        }
        if (api::turn_of(*configuration_) != api::turned_by(setup.flip))
            return {CameraFault::kRefused,
                    Sentence::of("%s (%s) cannot flip its picture; set capture.flip to none", label_,
                                 id_.c_str())};
        if (const int error = camera_->configure(configuration_.get()); error != 0)
            return failed("refuses its configuration", error);
        format_ = name.ours;
        return {};
    }
    if (!instead.empty())
        return {
            CameraFault::kRefused,
            Sentence::of("%s (%s) does not give %dx%d but %s; set capture.width and capture.height to what "
                         "it gives",
                         label_, id_.c_str(), width, setup.height, instead.c_str())};
    const std::vector<libcamera::PixelFormat> theirs = configuration_
                                                           ? configuration_->at(0).formats().pixelformats()
                                                           : std::vector<libcamera::PixelFormat>{};
    return {CameraFault::kRefused, Sentence::of("%s (%s) has no format that can be read; it has: %s", label_,
                                                id_.c_str(), listed(theirs).c_str())};
}

void LibcameraDriver::Camera::put_exposure(libcamera::ControlList& controls) {
    const bool exposure = !std::isnan(wanted_.exposure_us) && has(libcamera::controls::ExposureTime);
    const bool gain = !std::isnan(wanted_.gain) && has(libcamera::controls::AnalogueGain);
    if (exposure || gain) api::end_automatic(exposure, gain, controls);
    if (exposure)
        controls.set(libcamera::controls::ExposureTime,
                     static_cast<std::int32_t>(std::lround(wanted_.exposure_us)));
    if (gain) controls.set(libcamera::controls::AnalogueGain, static_cast<float>(wanted_.gain));
    wanted_ = {};
}

Fault LibcameraDriver::Camera::start(const CameraSetup& setup) {
    libcamera::ControlList controls(camera_->controls());
    if (has(libcamera::controls::FrameDurationLimits)) {
        const auto duration_us = static_cast<std::int64_t>(1e6 / setup.rate_hz);
        const std::array<std::int64_t, 2> limits{duration_us, duration_us};
        controls.set(libcamera::controls::FrameDurationLimits,
                     libcamera::Span<const std::int64_t, 2>(limits.data(), limits.size()));
    }
    if (eye_ != Eye::kBoth) api::keep_in_step(*camera_, eye_ == Eye::kLeft, controls);
    put_exposure(controls);
    if (const int error = camera_->start(&controls); error != 0) return failed("does not start", error);
    started_ = true;
    for (const auto& request : requests_)
        if (const int error = camera_->queueRequest(request.get()); error != 0)
            return failed("takes no request", error);
    return {};
}

// On libcamera's thread.
void LibcameraDriver::Camera::completed(libcamera::Request* request) {
    if (request->status() == libcamera::Request::RequestCancelled) return;  // the camera is being stopped
    filled_.push({static_cast<int>(request->cookie()), clock_ns(CLOCK_MONOTONIC), clock_ns(CLOCK_BOOTTIME)});
    eventfd_write(woken_, 1);
}

bool LibcameraDriver::Camera::describe(const Filled& filled, CameraFrame& frame) {
    const auto index = static_cast<std::size_t>(filled.buffer);
    const libcamera::Request& request = *requests_[index];
    const libcamera::FrameMetadata& metadata = request.buffers().begin()->second->metadata();
    libcamera::ControlList& said = requests_[index]->metadata();
    const auto sensor_stamp = said.get(libcamera::controls::SensorTimestamp);
    if (const auto exposure_us = said.get(libcamera::controls::ExposureTime))
        used_.exposure_us = *exposure_us;
    if (const auto gain = said.get(libcamera::controls::AnalogueGain)) used_.gain = *gain;
    bytes_[index] = planes_[index].size();
    if (!metadata.planes().empty() && metadata.planes().front().bytesused > 0)
        bytes_[index] = std::min<std::size_t>(bytes_[index], metadata.planes().front().bytesused);
    frame.eye = eye_;
    frame.buffer = filled.buffer;
    frame.sequence = metadata.sequence;
    frame.arrival_mono_ns = filled.arrival_mono_ns;
    frame.lost = last_sequence_ >= 0 ? std::max<std::int64_t>(0, frame.sequence - last_sequence_ - 1) : 0;
    frame.damaged = metadata.status != libcamera::FrameMetadata::FrameSuccess;
    const std::int64_t given_ns =
        sensor_stamp ? *sensor_stamp : static_cast<std::int64_t>(metadata.timestamp);
    const auto stamp = clock_.read(monotonic_stamp(given_ns, filled.arrival_mono_ns, filled.arrival_boot_ns),
                                   {filled.arrival_mono_ns, clock_ns(CLOCK_REALTIME)});
    if (!stamp) return false;
    last_sequence_ = frame.sequence;
    frame.exposure_mono_ns = stamp->mono_ns;
    frame.source = !stamp->devices_own ? StampSource::kArrival
                   : sensor_stamp      ? StampSource::kStartOfExposure
                                       : StampSource::kUnknown;
    return true;
}

Fault LibcameraDriver::Camera::copy(int buffer, Columns columns, Luma into) {
    const auto index = static_cast<std::size_t>(buffer);
    const libcamera::StreamConfiguration& stream = configuration_->at(0);
    const Reading reading(requests_[index]->buffers().begin()->second->planes().front().fd.get());
    const RawPicture picture{planes_[index].first(bytes_[index]), format_,
                             static_cast<int>(stream.size.width), static_cast<int>(stream.size.height),
                             stream.stride};
    if (unpack_luma(picture, columns, 0, into)) return {};
    return {CameraFault::kFailed,
            Sentence::of("%s (%s): a picture is cut short (%zu bytes)", label_, id_.c_str(), bytes_[index])};
}

Fault LibcameraDriver::Camera::requeue(int buffer) {
    libcamera::Request& request = *requests_[static_cast<std::size_t>(buffer)];
    request.reuse(libcamera::Request::ReuseBuffers);
    put_exposure(request.controls());
    if (const int error = camera_->queueRequest(&request); error != 0)
        return failed("takes no request", error);
    return {};
}

void LibcameraDriver::Camera::close() {
    if (!camera_) return;
    if (started_) camera_->stop();
    started_ = false;
    camera_->requestCompleted.disconnect(this);
    camera_->disconnected.disconnect(this);
    requests_.clear();
    mappings_.clear();
    planes_.clear();
    bytes_.clear();
    allocator_.reset();
    configuration_.reset();
    camera_->release();
    camera_.reset();
    filled_.reset();
}

std::string LibcameraDriver::Camera::description(double rate_hz) const {
    const libcamera::StreamConfiguration& stream = configuration_->at(0);
    return fmt::format("{} {} {} at {:.4g} Hz", id_, stream.pixelFormat.toString(), stream.size.toString(),
                       rate_hz);
}

LibcameraDriver::LibcameraDriver(CameraSetup setup) : setup_(std::move(setup)) {
    woken_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (setup_.side_by_side()) {
        cameras_.push_back(std::make_unique<Camera>(Eye::kBoth, "stereo camera"));
    } else {
        cameras_.push_back(std::make_unique<Camera>(Eye::kLeft, "left camera"));
        cameras_.push_back(std::make_unique<Camera>(Eye::kRight, "right camera"));
    }
}

LibcameraDriver::~LibcameraDriver() {
    close();
    if (woken_ >= 0) ::close(woken_);
}

LibcameraDriver::Camera& LibcameraDriver::camera_of(Eye eye) const {
    return *cameras_[eye == Eye::kRight && cameras_.size() == 2 ? 1 : 0];
}

Fault LibcameraDriver::open() {
    const LentProcessors lent(processors_);
    Fault fault = open_cameras();
    if (!fault.ok()) close();
    return fault;
}

Fault LibcameraDriver::open_cameras() {
    told_by_wait_ = {};
    left_out_ = 0;
    next_camera_ = 0;
    if (woken_ < 0)
        return {CameraFault::kFailed, Sentence("no eventfd: the process has too many open files")};
    manager_ = std::make_unique<Manager>();
    if (const int error = manager_->cameras.start(); error != 0)
        return {CameraFault::kFailed, Sentence::of("libcamera does not start: %s", std::strerror(-error))};
    manager_->started = true;
    const std::vector<std::shared_ptr<libcamera::Camera>> at_hand = manager_->cameras.cameras();
    std::vector<std::string> ids(at_hand.size());
    std::transform(at_hand.begin(), at_hand.end(), ids.begin(),
                   [](const auto& camera) { return camera->id(); });
    std::vector<std::string> said;
    std::string first_id;
    for (const auto& camera : cameras_) {
        const std::string& name = camera->eye() == Eye::kBoth   ? setup_.device
                                  : camera->eye() == Eye::kLeft ? setup_.left
                                                                : setup_.right;
        std::size_t index = 0;
        if (Fault fault = find_camera(name, ids, index); !fault.ok()) return fault;
        if (ids[index] == first_id)
            return {CameraFault::kRefused,
                    Sentence::of("capture.left and capture.right are both %s; name two cameras",
                                 first_id.c_str())};
        first_id = ids[index];
        if (Fault fault = camera->open(at_hand[index], setup_, woken_); !fault.ok()) return fault;
        said.push_back(camera->description(setup_.rate_hz));
    }
    description_ = Sentence(fmt::format("{}", fmt::join(said, ", ")));
    return {};
}

Fault LibcameraDriver::start() {
    const LentProcessors lent(processors_);
    for (const auto& camera : cameras_)
        if (Fault fault = camera->start(setup_); !fault.ok()) return fault;
    return {};
}

CameraDriver::Waited LibcameraDriver::wait(std::int64_t deadline_mono_ns, CameraFrame& frame, Fault& fault) {
    for (;;) {
        if (!told_by_wait_.ok()) {
            fault = told_by_wait_;
            return Waited::kFault;
        }
        for (std::size_t i = 0; i < cameras_.size(); ++i) {
            Camera& camera = *cameras_[next_camera_];
            next_camera_ = (next_camera_ + 1) % cameras_.size();
            if (camera.gone()) {
                fault = {CameraFault::kAbsent, Sentence("a camera was taken away")};
                return Waited::kFault;
            }
            for (Camera::Filled filled{}; camera.take(filled);) {
                if (camera.describe(filled, frame)) return Waited::kFrame;
                ++left_out_;
                told_by_wait_ = camera.requeue(filled.buffer);
            }
        }
        const std::int64_t left_ns = deadline_mono_ns - clock_ns(CLOCK_MONOTONIC);
        if (left_ns <= 0) return Waited::kNothing;
        pollfd woken{woken_, POLLIN, 0};
        poll(&woken, 1, static_cast<int>(std::min<std::int64_t>((left_ns + 999'999) / 1'000'000, 1000)));
        eventfd_t count = 0;
        eventfd_read(woken_, &count);
    }
}

Fault LibcameraDriver::copy(const CameraFrame& frame, Eye eye, Luma into) {
    Camera& camera = camera_of(eye);
    const int width = setup_.width;
    const Columns columns = camera.eye() != Eye::kBoth ? Columns{0, width}
                            : eye == Eye::kLeft        ? left_half(2 * width)
                                                       : right_half(2 * width);
    return camera.copy(frame.buffer, columns, into);
}

void LibcameraDriver::release(const CameraFrame& frame) {
    const Fault fault = camera_of(frame.eye).requeue(frame.buffer);
    if (!fault.ok()) told_by_wait_ = fault;
}

void LibcameraDriver::close() {
    for (const auto& camera : cameras_)
        camera->close();
    manager_.reset();
}

int LibcameraDriver::buffers_to_hold() const {
    int least = static_cast<int>(kMostBuffers);
    for (const auto& camera : cameras_)
        least = std::min(least, camera->buffers());
    return std::max(1, least - 2);  // two are left to be filled
}

Fault LibcameraDriver::set_exposure(Eye eye, const ExposureValues& wanted) {
    camera_of(eye).set_exposure(wanted);
    return {};
}

ExposureValues LibcameraDriver::read_exposure(Eye eye) {
    return camera_of(eye).used();
}

}  // namespace groundline::capture
