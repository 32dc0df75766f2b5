// What the program finds in this shared object; see driver_module.hpp.
#include "capture/driver_module.hpp"
#include "capture/libcamera/libcamera_driver.hpp"

#define GROUNDLINE_EXPORT extern "C" __attribute__((visibility("default")))

GROUNDLINE_EXPORT const char* groundline_module_version() {
    return GROUNDLINE_VERSION;
}

GROUNDLINE_EXPORT groundline::capture::CameraDriver* groundline_module_driver(
    const groundline::capture::CameraSetup& setup) {
    return new groundline::capture::LibcameraDriver(setup);
}
