// A camera driver module of another version than any program.
#include "capture/driver_module.hpp"

extern "C" const char* groundline_module_version() {
    return "0.0.0-other";
}

extern "C" groundline::capture::CameraDriver* groundline_module_driver(
    const groundline::capture::CameraSetup&) {
    return nullptr;
}
