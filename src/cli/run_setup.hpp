// From the words of the command line to what a processor needs: settings, calibration, configuration.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/rectified_rig.hpp"
#include "pipeline/processor.hpp"
#include "rig/calibration.hpp"
#include "settings/settings.hpp"

namespace groundline::cli {

// Defaults, then the file where one is named, then the key=value words. Throws Refusal as settings does.
settings::Settings load_settings(const std::filesystem::path& file, const std::vector<std::string>& words);

// A pair that is rectified as it comes, as rendered pairs are.
rig::StereoCalibration calibration_of(const RectifiedRig& rig);

// Fills in the number of disparities where it is left to the picture; `hint` as rig::auto_disparities().
void choose_disparities(int width, int hint, settings::Settings& settings);

// Throws Refusal(kConfig) as settings::terrain_config() does.
pipeline::ProcessorConfig processor_config(const settings::Settings& settings, bool colour);

}  // namespace groundline::cli
