#include "io/calibration/calibration_reader.hpp"

#include <fmt/format.h>

#include <array>

#include "core/error.hpp"
#include "io/calibration/formats.hpp"

namespace groundline::io {
namespace {

namespace fs = std::filesystem;

enum class Format { kOpenCv, kRos, kKalibr, kEuroc };

constexpr std::string_view kKnownFormats =
    "OpenCV stereo YAML or XML (M1 D1 M2 D2 R T), ROS camera_info, Kalibr camchain, EuRoC sensor.yaml, KITTI "
    "(P0: P1:) or Middlebury (cam0= cam1=)";

Format format_of(const YamlField& file) {
    if (file.has("T_BS") || file.has("sensor_type")) return Format::kEuroc;
    if (file.has("camera_matrix")) return Format::kRos;
    if (file.has("cam0")) return Format::kKalibr;
    if (looks_like_opencv(file)) return Format::kOpenCv;
    file.refuse(fmt::format("is none of the known calibration formats, expected {}", kKnownFormats));
}

rig::StereoCalibration read_yaml(const std::vector<SourceText>& sources) {
    std::vector<YamlField> files;
    files.reserve(sources.size());
    for (const SourceText& source : sources)
        files.emplace_back(source);
    const Format format = format_of(files.front());
    if (files.size() > 1 && format_of(files.back()) != format)
        files.back().refuse(fmt::format("is of another format than {}, expected two files of one kind",
                                        sources.front().path.string()));
    const auto need_files = [&](std::size_t count, const char* what) {
        if (files.size() != count) files.back().refuse(what);
    };
    switch (format) {
        case Format::kRos:
            need_files(
                2, "is a calibration of one camera, expected ROS camera_info of both: left.yaml,right.yaml");
            return read_ros_pair(files[0], files[1]);
        case Format::kEuroc:
            need_files(2, "is the sensor.yaml of one camera, expected two files: cam0's,cam1's");
            return read_euroc_pair(files[0], files[1]);
        case Format::kKalibr:
            need_files(1, "is a Kalibr camchain, which holds both cameras, expected this one file");
            return read_kalibr(files[0]);
        case Format::kOpenCv:
            break;
    }
    return read_opencv(files);
}

rig::StereoCalibration read_any(const std::vector<SourceText>& sources, bool colour_pair) {
    for (const SourceText& source : sources) {
        const bool kitti = looks_like_kitti(source);
        const bool middlebury = looks_like_middlebury(source);
        if (!kitti && !middlebury) continue;
        if (sources.size() > 1)
            refuse(source.path, 0, "holds both cameras, expected this file alone, not one of two");
        return kitti ? read_kitti(source, colour_pair) : read_middlebury(source);
    }
    return read_yaml(sources);
}

}  // namespace

rig::StereoCalibration read_calibration(const std::vector<fs::path>& files, int width, int height,
                                        bool colour_pair) {
    if (files.empty() || files.size() > 2)
        throw Refusal(ExitStatus::kConfig,
                      fmt::format("calibration: {} files given, expected one or two", files.size()));
    std::vector<SourceText> sources;
    sources.reserve(files.size());
    for (const fs::path& file : files)
        sources.push_back(load_text(file));
    rig::StereoCalibration calibration = read_any(sources, colour_pair);
    calibration.source = files.front().string();
    if (files.size() > 1) calibration.source += ", " + files.back().string();
    require_usable(calibration, width, height);
    return calibration;
}

std::vector<fs::path> find_calibration(const fs::path& source_folder) {
    const auto is_there = [](const fs::path& file) {
        std::error_code ignored;
        return fs::exists(file, ignored);
    };
    for (const char* name : {"calibration.yaml", "calib.txt"})
        if (is_there(source_folder / name)) return {source_folder / name};
    for (const char* up : {"", "..", "../.."}) {
        const fs::path file = (source_folder / up / "calib_cam_to_cam.txt").lexically_normal();
        if (is_there(file)) return {file};
    }
    constexpr std::array<std::array<const char*, 2>, 4> kPairs = {
        {{"left.yaml", "right.yaml"},
         {"mav0/cam0/sensor.yaml", "mav0/cam1/sensor.yaml"},
         {"cam0/sensor.yaml", "cam1/sensor.yaml"},
         {"intrinsics.yml", "extrinsics.yml"}}};
    for (const auto& pair : kPairs) {
        std::vector<fs::path> found;
        for (const char* name : pair)
            if (is_there(source_folder / name)) found.push_back(source_folder / name);
        if (!found.empty()) return found;
    }
    if (is_there(source_folder / "camchain.yaml")) return {source_folder / "camchain.yaml"};
    return {};
}

}  // namespace groundline::io
