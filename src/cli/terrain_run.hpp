// Runs the terrain stage and its baseline on rendered frames and on sets with truth, and judges both.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "cli/terrain_judge.hpp"
#include "cli/terrain_suite.hpp"
#include "settings/settings.hpp"

namespace groundline::cli {

enum class TerrainMethod : std::uint8_t { kOurs, kBaseline, kCount };
inline constexpr std::size_t kTerrainMethods = static_cast<std::size_t>(TerrainMethod::kCount);

struct JudgedFrame {
    std::string set;         // or scene
    std::int64_t frame = 0;  // position in the set, seed of the scene
    std::string spec;        // of the renderer; empty for a set
    double range_m = kJudgedRange;
    std::array<FrameScore, kTerrainMethods> scores;
};

// One rendered frame, or one set.
struct JudgedUnit {
    std::string name;
    bool done = false;    // false: interrupted before its end
    int status = 0;       // an exit status
    std::string problem;  // empty: it was run
    std::vector<std::string> remarks;
    std::vector<JudgedFrame> frames;
};

// A frame of the suite by a fresh processor. Throws Refusal(kConfig) for settings that cannot work.
JudgedUnit judge_rendered(const SuiteFrame& frame, const settings::Settings& settings);

// The frames of a folder with truth in their order, by one processor. Frames without a ground in their truth
// are left out with a remark. Looks at `stop` between frames. Throws Refusal where the set cannot be read.
JudgedUnit judge_set(const std::filesystem::path& set, const settings::Settings& settings,
                     const std::atomic<bool>& stop);

}  // namespace groundline::cli
