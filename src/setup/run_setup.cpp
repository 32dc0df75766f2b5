#include "setup/run_setup.hpp"

#include "io/body_mask.hpp"
#include "io/calibration/calibration_reader.hpp"
#include "rig/range.hpp"

namespace groundline::setup {

settings::Settings load_settings(const std::filesystem::path& file, const std::vector<std::string>& words) {
    settings::Settings settings;
    if (!file.empty()) settings::load_file(settings, file);
    for (const std::string& word : words)
        settings::set_word(settings, word);
    return settings;
}

rig::StereoCalibration calibration_of(const RectifiedRig& rig) {
    rig::StereoCalibration calibration;
    calibration.rectified = true;
    for (rig::CameraModel* camera : {&calibration.left, &calibration.right}) {
        camera->width = rig.width;
        camera->height = rig.height;
        camera->fx = camera->fy = rig.focal_px;
        camera->cy = rig.cy_px;
    }
    calibration.left.cx = rig.cx_px;
    calibration.right.cx = rig.cx_right_px;
    calibration.translation_m = {-rig.baseline_m, 0.0, 0.0};
    calibration.source = "the scene";
    calibration.format = "rendered";
    return calibration;
}

std::optional<rig::StereoCalibration> load_calibration(std::vector<std::filesystem::path> files,
                                                       const capture::OpenedSource& opened) {
    const SourceInfo& info = opened.source->info();
    if (opened.rig && files.empty()) return calibration_of(*opened.rig);
    if (files.empty() && !opened.folder.empty()) files = io::find_calibration(opened.folder);
    if (files.empty()) return std::nullopt;
    return io::read_calibration(files, info.width, info.height, opened.colour_pair);
}

void choose_disparities(int width, int hint, settings::Settings& settings) {
    if (settings.auto_disparities) settings.matcher.disparities = rig::auto_disparities(width, hint);
}

pipeline::ProcessorConfig processor_config(const settings::Settings& settings, const SourceInfo& source,
                                           bool colour, Arena& arena) {
    pipeline::ProcessorConfig config;
    config.matcher = settings.matcher;
    config.terrain = settings::terrain_config(settings);
    config.grid = settings.grid;
    config.limits = settings::verdict_limits(settings);
    config.colour = colour;
    config.live = source.live;
    if (settings.overload.half_resolution == verdict::HalfResolution::kAlways)
        config.half_resolution = verdict::HalfResolution::kAlways;
    config.body = io::read_body_mask(settings.mount.body_mask, source.width, source.height, arena);
    return config;
}

publish::LcmOptions lcm_options(const settings::Settings& settings, Counters& counters) {
    publish::LcmOptions options;
    options.url = settings.publish.url;
    options.prefix = settings.publish.prefix;
    options.channels.v_disparity = settings.publish.v_disparity;
    options.channels.preview = settings.publish.preview;
    options.channels.grid = settings.grid.on;
    options.channels.obstacles = settings.publish.obstacles;
    options.counters = &counters;
    return options;
}

}  // namespace groundline::setup
