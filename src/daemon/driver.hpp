// Which source the configuration asks for: the one place where the daemon's drivers are made.
#pragma once

#include <filesystem>
#include <vector>

#include "capture/camera_source.hpp"
#include "capture/open.hpp"
#include "core/counters.hpp"
#include "settings/settings.hpp"

namespace groundline::daemon {

struct OpenedDriver {
    capture::OpenedSource opened;
    capture::CameraSource* cameras = nullptr;  // the source, where it is one of live cameras
};

// Live cameras are not opened yet: they may come later. Throws Refusal: kConfig where the settings do not
// name a source or its driver is not installed, else as the driver does. `counters` is borrowed by the
// source.
OpenedDriver open_driver(const settings::Settings& settings, Counters& counters);

// The calibration files named, in order; empty where none are.
std::vector<std::filesystem::path> calibration_files(const settings::CaptureSettings& settings);

}  // namespace groundline::daemon
