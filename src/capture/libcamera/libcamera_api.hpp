// What differs between the versions of libcamera, 0.0.3 up to current, and nowhere else.
//
//   0.2.0  CameraConfiguration::transform became ::orientation; roles are given as a span
//   0.5.0  automatic exposure and gain are switched apart (ExposureTimeMode, AnalogueGainMode); AeEnable
//   stays
//          as a short form for both
//   Raspberry Pi's own builds have controls::rpi::SyncMode: cameras in step by software
#pragma once

#include <libcamera/libcamera.h>

#include <memory>

#include "capture/camera_setup.hpp"

#define GROUNDLINE_LIBCAMERA_AT_LEAST(major, minor) \
    (LIBCAMERA_VERSION_MAJOR > (major) ||           \
     (LIBCAMERA_VERSION_MAJOR == (major) && LIBCAMERA_VERSION_MINOR >= (minor)))

namespace groundline::capture::api {

inline std::unique_ptr<libcamera::CameraConfiguration> video_configuration(libcamera::Camera& camera) {
    return camera.generateConfiguration({libcamera::StreamRole::VideoRecording});
}

// How the picture is turned, and what the configuration holds of that.
#if GROUNDLINE_LIBCAMERA_AT_LEAST(0, 2)
inline libcamera::Orientation turned_by(Flip flip) {
    using libcamera::Orientation;
    constexpr Orientation kBy[] = {Orientation::Rotate0, Orientation::Rotate0Mirror,
                                   Orientation::Rotate180Mirror, Orientation::Rotate180};
    return kBy[static_cast<int>(flip)];
}
inline libcamera::Orientation& turn_of(libcamera::CameraConfiguration& configuration) {
    return configuration.orientation;
}
#else
inline libcamera::Transform turned_by(Flip flip) {
    using libcamera::Transform;
    constexpr Transform kBy[] = {Transform::Identity, Transform::HFlip, Transform::VFlip, Transform::HVFlip};
    return kBy[static_cast<int>(flip)];
}
inline libcamera::Transform& turn_of(libcamera::CameraConfiguration& configuration) {
    return configuration.transform;
}
#endif

// Ends the camera's own choice of what is set by hand.
inline void end_automatic([[maybe_unused]] bool exposure, [[maybe_unused]] bool gain,
                          libcamera::ControlList& controls) {
#if GROUNDLINE_LIBCAMERA_AT_LEAST(0, 5)
    if (exposure)
        controls.set(libcamera::controls::ExposureTimeMode, libcamera::controls::ExposureTimeModeManual);
    if (gain)
        controls.set(libcamera::controls::AnalogueGainMode, libcamera::controls::AnalogueGainModeManual);
#else
    if (exposure && gain) controls.set(libcamera::controls::AeEnable, false);
#endif
}

// The left camera leads, the right one follows it to within a fraction of a frame. False where this build of
// libcamera or the camera cannot.
inline bool keep_in_step([[maybe_unused]] const libcamera::Camera& camera, [[maybe_unused]] bool leads,
                         [[maybe_unused]] libcamera::ControlList& controls) {
#ifdef GROUNDLINE_LIBCAMERA_SYNC
    if (camera.controls().count(&libcamera::controls::rpi::SyncMode) == 0) return false;
    controls.set(libcamera::controls::rpi::SyncMode,
                 leads ? libcamera::controls::rpi::SyncModeServer : libcamera::controls::rpi::SyncModeClient);
    return true;
#else
    return false;
#endif
}

}  // namespace groundline::capture::api
