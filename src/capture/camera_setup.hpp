// What an operator asks of a pair of cameras.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "capture/pixel_formats.hpp"

namespace groundline::capture {

enum class Flip : std::uint8_t {
    kNone,
    kHorizontal,
    kVertical,
    kBoth,  // a camera mounted upside down
};

// Either `device` (both eyes side by side in its picture) or `left` and `right`. How a device is named is the
// driver's matter; for V4L2 see v4l2_names.hpp.
struct CameraSetup {
    std::string device;
    std::string left;
    std::string right;
    int width = 640;  // of one eye
    int height = 480;
    std::optional<PixelFormat> format;  // unset: the first that gives size and rate
    double rate_hz = 30.0;
    std::optional<double> exposure_us;  // unset: the camera's own automatic
    std::optional<double> gain;         // in the camera's units; unset: automatic
    Flip flip = Flip::kNone;

    bool side_by_side() const { return !device.empty(); }
};

}  // namespace groundline::capture
