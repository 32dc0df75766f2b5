#include "daemon/driver.hpp"

#include <string>
#include <vector>

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

}  // namespace

capture::OpenedSource open_driver(const settings::CaptureSettings& settings) {
    if (settings.driver == settings::CaptureDriver::kV4l2 ||
        settings.driver == settings::CaptureDriver::kLibcamera)
        throw Refusal(ExitStatus::kConfig,
                      "capture.driver: this program has no cameras; set files or synthetic");
    if (settings.source.empty())
        throw Refusal(ExitStatus::kConfig,
                      "capture.source is not set: name a recording (capture.driver: files) or a scene "
                      "(capture.driver: synthetic, capture.source: drive)");
    switch (settings.driver) {
        case settings::CaptureDriver::kFiles:
            return capture::open_source(parts(settings.source));
        case settings::CaptureDriver::kSynthetic:
            return capture::open_source({"synthetic:" + settings.source});
        default:
            break;
    }
    throw Refusal(ExitStatus::kConfig, "capture.driver: there is no such driver in this program");
}

std::vector<std::filesystem::path> calibration_files(const settings::CaptureSettings& settings) {
    const std::vector<std::string> names = parts(settings.calibration);
    return {names.begin(), names.end()};
}

}  // namespace groundline::daemon
