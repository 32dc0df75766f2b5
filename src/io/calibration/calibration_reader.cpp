#include "io/calibration/calibration_reader.hpp"

#include "core/error.hpp"

namespace groundline::io {

rig::StereoCalibration read_calibration(const std::vector<std::filesystem::path>&, int, int, bool) {
    throw Refusal(ExitStatus::kConfig, "calibration: no reader yet");
}

std::vector<std::filesystem::path> find_calibration(const std::filesystem::path&) {
    return {};
}

}  // namespace groundline::io
