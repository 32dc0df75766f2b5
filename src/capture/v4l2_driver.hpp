// A pair of cameras through V4L2: two devices, or one that gives both eyes side by side.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "capture/camera_driver.hpp"
#include "capture/camera_setup.hpp"
#include "capture/mjpeg.hpp"
#include "capture/v4l2_device.hpp"
#include "capture/v4l2_names.hpp"

namespace groundline::capture {

// See camera_driver.hpp. Pictures of both devices are dequeued in turn, so that neither can starve the other.
class V4l2Driver final : public CameraDriver {
  public:
    explicit V4l2Driver(CameraSetup setup, V4l2System& system = real_v4l2_system(), V4l2Places places = {});

    Fault open() override;
    Fault start() override;
    Waited wait(std::int64_t deadline_mono_ns, CameraFrame& frame, Fault& fault) override;
    Fault copy(const CameraFrame& frame, Eye eye, Luma into) override;
    void release(const CameraFrame& frame) override;
    void close() override;
    int buffers_to_hold() const override;
    std::string_view description() const override { return description_.view(); }
    std::int64_t left_out() const override;
    Fault set_exposure(Eye eye, const ExposureValues& wanted) override;
    ExposureValues read_exposure(Eye eye) override;

  private:
    // One camera and where its pictures are.
    struct Camera {
        Camera(V4l2System& system, const char* label, Eye its_eye) : device(system, label), eye(its_eye) {}
        V4l2Device device;
        Eye eye;
        std::vector<std::span<const std::uint8_t>> pictures;  // by buffer
    };
    // The camera an eye's picture comes from.
    Camera& camera_of(Eye eye) { return *cameras_[eye == Eye::kRight && cameras_.size() == 2 ? 1 : 0]; }
    Fault open_devices();
    Fault set_up_devices();
    Waited take(Camera& camera, bool polled_error, CameraFrame& frame, Fault& fault);
    Fault copy_jpeg(Camera& camera, const CameraFrame& frame, Columns columns, Luma into);

    CameraSetup setup_;
    V4l2System& system_;
    V4l2Places places_;
    std::vector<std::unique_ptr<Camera>> cameras_;
    std::size_t next_camera_ = 0;
    Fault told_by_wait_;  // what release() met
    Sentence description_;
    MjpegDecoder decoder_;
    // A side-by-side JPEG is decoded once, in here, and then copied from.
    std::vector<std::uint8_t> whole_;
    std::int64_t whole_sequence_ = -1;
};

}  // namespace groundline::capture
