// `groundline replay`: recorded or rendered pairs through the pipeline, into files and onto LCM.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace groundline::cli {

struct ReplayOptions {
    std::vector<std::string> source;                 // a folder, a video, synthetic:SCENE, or two images
    std::vector<std::filesystem::path> calibration;  // empty: looked for beside the source
    std::filesystem::path config;                    // empty: none
    std::vector<std::string> set;                    // key=value
    std::optional<std::filesystem::path> out;        // no files without
    std::string rate = "max";                        // max, realtime, or pairs a second
    std::int64_t frames = -1;                        // -1: all
    int threads = 0;                                 // 0: one a processor
    std::string lcm_url;
    bool lcm = false;  // publish: --lcm-url was given
    bool loop = false;
    bool quiet = false;  // print nothing but errors
};

// Returns the exit status of error.hpp. Throws Refusal before the first frame, with nothing written.
int run_replay(const ReplayOptions& options);

}  // namespace groundline::cli
