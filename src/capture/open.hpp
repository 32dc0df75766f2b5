// Opens any SOURCE an operator can name.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/frame_source.hpp"
#include "core/rectified_rig.hpp"

namespace groundline::capture {

struct OpenedSource {
    std::unique_ptr<FrameSource> source;
    std::filesystem::path folder;     // where calibration is looked for; empty for a rendered source
    bool colour_pair = false;         // KITTI's colour cameras, whose calibration is P2 and P3
    std::string note;                 // one sentence about what of the source is left out, else empty
    std::optional<RectifiedRig> rig;  // of a rendered source, which needs no calibration file
};

// `words` as on the command line: "synthetic:SCENE[?...]", a folder, a video, or a left and a right image.
// Throws Refusal: kInput with the file and what was expected, kUsage for another number of words.
OpenedSource open_source(const std::vector<std::string>& words);

}  // namespace groundline::capture
