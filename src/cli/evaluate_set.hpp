// Compares one result folder with one truth folder.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "cli/evaluation.hpp"

namespace groundline::cli {

struct SetReport {
    std::int64_t evaluated = 0;        // frames with truth and result
    std::int64_t without_result = 0;   // truth that the result has no frame for
    std::int64_t without_truth = 0;    // result frames beyond the truth
    std::int64_t unreadable = 0;       // a file missing, broken or of another size
    std::vector<std::string> remarks;  // a sentence on each thing that is missing

    std::array<std::int64_t, 3> verdicts{};  // of the evaluated, by Verdict
    DisparityScore disparity;
    std::string occlusion;  // where it was taken from: "occluded/", "disparity truth", "none"

    TerrainScore terrain;
    std::string terrain_truth;  // "class/ and height/", "class/", "height/", "disparity truth"; empty: no
                                // terrain scores
    PoseScore pose;
    std::string pose_truth;  // "truth.json", "disparity truth"; empty: no pose scores
};

// `truth`: a folder as io::Truth reads it; truth.json holds the pose of each frame where it has "frames":
// [{"pitch_deg", "roll_deg", "height_m"}, ...]. `out`: what `groundline replay --out` wrote. The result file
// numbered N belongs to truth frame N. The calibration is the one in out's summary.json, else the one found
// in `truth`. Where the truth does not say what is occluded and more than half of its pixels have a
// disparity, mark_occluded() does. Throws Refusal: kInput where a folder or everything in it is missing or
// unreadable, kConfig for a calibration that is refused. A later frame that cannot be read is counted and
// remarked on.
SetReport evaluate_set(const std::filesystem::path& truth, const std::filesystem::path& out);

}  // namespace groundline::cli
