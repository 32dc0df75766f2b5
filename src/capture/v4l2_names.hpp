// How an operator names a V4L2 camera, and the node that is now.
#pragma once

#include <filesystem>
#include <string>

#include "capture/camera_driver.hpp"

namespace groundline::capture {

// Where names are looked up; another place in tests.
struct V4l2Places {
    std::filesystem::path devices = "/dev";
    std::filesystem::path classes = "/sys/class/video4linux";
};

// `name` is one of
//   /dev/...        any path: a node, a link of udev's
//   video2          a node in /dev
//   by-id/...       a link in /dev/v4l/by-id: the same camera at any port
//   by-path/...     a link in /dev/v4l/by-path: any camera at the same port
//   serial:TEXT     the USB camera with this serial number, its first node; no udev needed
// Fills `path`, or returns a fault: kAbsent for a serial number that no camera has, kRefused for one that two
// have (use by-path then) and for an empty name. Whether a path exists is left to opening it. Takes memory.
Fault find_v4l2_device(const std::string& name, const V4l2Places& places, std::string& path);

}  // namespace groundline::capture
