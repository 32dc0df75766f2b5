// `groundline synth`: writes a rendered scene with its exact truth into a folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace groundline::cli {

struct SynthOptions {
    std::string spec;                    // NAME[?key=value&...], as after `synthetic:`
    std::optional<std::int64_t> frames;  // instead of the scene's own number
    std::filesystem::path out;           // must not exist or be empty
    double tolerance_m = 0.20;           // of the classes
};

// Writes left/ right/ disp/ occluded/ class/ height/ (a PNG per frame, %06d from 0), calib.txt (KITTI P0:,
// P1:) and truth.json. Each file comes complete under its name or not at all; truth.json is last. Returns the
// exit status: 0, 1 when a file could not be written, 130 after Ctrl-C where `interrupted` says so. Throws
// Refusal before anything is written: kUsage for a bad scene or number, kInput for a folder that holds
// something else.
int run_synth(const SynthOptions& options);

}  // namespace groundline::cli
