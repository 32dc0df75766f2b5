// Which source the configuration asks for: the one place where the daemon's drivers are made.
#pragma once

#include "capture/open.hpp"
#include "settings/settings.hpp"

namespace groundline::daemon {

// Throws Refusal: kConfig where the settings do not name a source, else as the driver does.
capture::OpenedSource open_driver(const settings::CaptureSettings& settings);

// The calibration files named, in order; empty where none are.
std::vector<std::filesystem::path> calibration_files(const settings::CaptureSettings& settings);

}  // namespace groundline::daemon
