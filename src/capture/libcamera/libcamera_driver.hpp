// A pair of cameras through libcamera, both in this process as libcamera wants it.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "capture/camera_driver.hpp"
#include "capture/camera_setup.hpp"
#include "capture/libcamera/processors.hpp"

namespace groundline::capture {

// See camera_driver.hpp; cameras are named as in camera_names.hpp. Pictures come on libcamera's own thread
// and cross to the caller's without a lock. Formats: R8, NV12, YUV420, YUYV, UYVY, BGR888, RGB888. Requests
// are used again and again; libcamera itself takes memory for the controls and metadata of each. Its threads
// run where the thread that made this object may run, whatever the one that opens the cameras is bound to.
class LibcameraDriver final : public CameraDriver {
  public:
    explicit LibcameraDriver(CameraSetup setup);
    ~LibcameraDriver() override;

    Fault open() override;
    Fault start() override;
    Waited wait(std::int64_t deadline_mono_ns, CameraFrame& frame, Fault& fault) override;
    Fault copy(const CameraFrame& frame, Eye eye, Luma into) override;
    void release(const CameraFrame& frame) override;
    void close() override;
    int buffers_to_hold() const override;
    std::string_view description() const override { return description_.view(); }
    std::int64_t left_out() const override { return left_out_; }
    Fault set_exposure(Eye eye, const ExposureValues& wanted) override;
    ExposureValues read_exposure(Eye eye) override;

  private:
    class Camera;
    struct Manager;

    Camera& camera_of(Eye eye) const;
    Fault open_cameras();

    CameraSetup setup_;
    Processors processors_;
    std::unique_ptr<Manager> manager_;
    std::vector<std::unique_ptr<Camera>> cameras_;
    std::size_t next_camera_ = 0;
    int woken_ = -1;  // eventfd: a picture came, or a camera went
    Fault told_by_wait_;
    std::int64_t left_out_ = 0;
    Sentence description_;
};

}  // namespace groundline::capture
