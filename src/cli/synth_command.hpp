// `groundline synth`: writes a rendered scene with its exact truth into a folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace groundline::cli {

struct SynthOptions {
    std::string spec;                    // NAME[?key=value&...], as after `synthetic:`
    std::optional<std::int64_t> frames;  // instead of the scene's own number; the scene stays the same
    std::filesystem::path out;           // must not exist or be empty
    double tolerance_m = 0.20;           // of the classes
};

// Writes, with a PNG per frame, %06d from 0:
//   left/ (colour) right/ (luma)
//   disp/      16 bits, exact disparity x 256, 0 where there is sky or it does not fit; hidden points
//   included occluded/  8 bits, 255 where the right view does not show the point class/     8 bits, class ids
//   height/  16 bits, millimetres above the mean ground + 32768, 0 in the sky
// and calib.txt (KITTI P0:, P1:) and truth.json (the pose and ground plane of each frame), which comes last.
// Each file is complete under its name or not there. Returns the exit status: 0, or 130 after Ctrl-C with the
// frames so far complete. Throws Refusal before anything is written: kUsage for a bad scene or tolerance,
// kInput for a folder that holds something else or cannot be made; std::runtime_error for a failing disk.
int run_synth(const SynthOptions& options);

}  // namespace groundline::cli
