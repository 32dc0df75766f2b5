// From settings and a source to what a pipeline needs: what `groundline` and `groundlined` set up alike.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "capture/open.hpp"
#include "core/arena.hpp"
#include "core/counters.hpp"
#include "core/frame_source.hpp"
#include "core/rectified_rig.hpp"
#include "pipeline/processor.hpp"
#include "publish/lcm_publisher.hpp"
#include "rig/calibration.hpp"
#include "settings/settings.hpp"

namespace groundline::setup {

// Defaults, then the file where one is named, then the key=value words. Throws Refusal as settings does.
settings::Settings load_settings(const std::filesystem::path& file, const std::vector<std::string>& words);

// A pair that is rectified as it comes, as rendered pairs are.
rig::StereoCalibration calibration_of(const RectifiedRig& rig);

// Of the pairs of `opened`: `files` where any are named, else the rendered scene's own, else what lies beside
// the pictures; nothing where none is found. Throws Refusal as io::read_calibration() does.
std::optional<rig::StereoCalibration> load_calibration(std::vector<std::filesystem::path> files,
                                                       const capture::OpenedSource& opened);

// Fills in the number of disparities where it is left to the picture; `hint` as rig::auto_disparities().
void choose_disparities(int width, int hint, settings::Settings& settings);

// For pairs of that source; `colour`: it has colour and something draws it. The mask of the robot's own parts
// is read into the arena. Pairs are looked at at half the resolution where that is set for all of them;
// whoever lets overload decide says so in the result. Throws Refusal(kConfig) as settings::terrain_config()
// and io::read_body_mask() do.
pipeline::ProcessorConfig processor_config(const settings::Settings& settings, const SourceInfo& source,
                                           bool colour, Arena& arena);

// `counters` is borrowed.
publish::LcmOptions lcm_options(const settings::Settings& settings, Counters& counters);

}  // namespace groundline::setup
