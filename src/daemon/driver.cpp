#include "daemon/driver.hpp"

#include <memory>
#include <string>
#include <utility>

#include "capture/driver_module.hpp"
#include "capture/v4l2_driver.hpp"
#include "core/error.hpp"

namespace groundline::daemon {
namespace {

// Parts between commas; none of an empty text.
std::vector<std::string> parts(const std::string& text) {
    std::vector<std::string> found;
    for (std::size_t start = 0; start < text.size();) {
        const std::size_t end = std::min(text.find(',', start), text.size());
        found.push_back(text.substr(start, end - start));
        start = end + 1;
    }
    return found;
}

OpenedDriver open_cameras(const settings::Settings& settings, std::unique_ptr<capture::CameraDriver> driver,
                          Counters& counters) {
    auto source = std::make_unique<capture::CameraSource>(settings::camera_source_config(settings),
                                                          std::move(driver), counters);
    OpenedDriver cameras;
    cameras.cameras = source.get();
    cameras.opened.source = std::move(source);
    return cameras;
}

// Recorded or rendered pairs.
OpenedDriver open_recorded(const settings::CaptureSettings& settings) {
    if (settings.source.empty())
        throw Refusal(ExitStatus::kConfig,
                      "capture.source is not set: name a recording (capture.driver: files) or a scene "
                      "(capture.driver: synthetic, capture.source: drive)");
    OpenedDriver recorded;
    recorded.opened = capture::open_source(settings.driver == settings::CaptureDriver::kSynthetic
                                               ? std::vector{"synthetic:" + settings.source}
                                               : parts(settings.source));
    return recorded;
}

}  // namespace

OpenedDriver open_driver(const settings::Settings& settings, Counters& counters) {
    const settings::CaptureSettings& capture = settings.capture;
    switch (capture.driver) {
        case settings::CaptureDriver::kV4l2:
            return open_cameras(settings, std::make_unique<capture::V4l2Driver>(capture.camera), counters);
        case settings::CaptureDriver::kLibcamera:
            return open_cameras(settings,
                                capture::load_driver("libcamera", capture.camera, capture::module_folders()),
                                counters);
        case settings::CaptureDriver::kFiles:
        case settings::CaptureDriver::kSynthetic:
            break;
    }
    return open_recorded(capture);
}

std::vector<std::filesystem::path> calibration_files(const settings::CaptureSettings& settings) {
    const std::vector<std::string> names = parts(settings.calibration);
    return {names.begin(), names.end()};
}

}  // namespace groundline::daemon
