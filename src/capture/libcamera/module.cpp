// What the program finds in this shared object; see driver_module.hpp.
#include <cstdlib>

#include "capture/driver_module.hpp"
#include "capture/libcamera/libcamera_driver.hpp"

#define GROUNDLINE_EXPORT extern "C" __attribute__((visibility("default")))

GROUNDLINE_EXPORT const char* groundline_module_version() {
    return GROUNDLINE_VERSION;
}

GROUNDLINE_EXPORT groundline::capture::CameraDriver* groundline_module_driver(
    const groundline::capture::CameraSetup& setup) {
    // Else it says its version at each try to open cameras that are not there yet. The operator may ask for
    // more.
    setenv("LIBCAMERA_LOG_LEVELS", "*:ERROR", 0);
    return new groundline::capture::LibcameraDriver(setup);
}
