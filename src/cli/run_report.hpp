// What a run says of itself: lines before and after it, and its summary.json.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "cli/run_statistics.hpp"
#include "core/counters.hpp"
#include "core/frame_source.hpp"
#include "core/rectified_rig.hpp"
#include "pipeline/pipeline.hpp"
#include "rig/calibration.hpp"
#include "settings/settings.hpp"

namespace groundline::cli {

// What is known before the first frame; borrowed.
struct RunFacts {
    const SourceInfo& info;
    const std::optional<rig::StereoCalibration>& calibration;
    const RectifiedRig& rig;
    const settings::Settings& settings;  // with the search range in force
    int threads = 1;
};

// What was found by the end; borrowed.
struct RunFindings {
    const RunStatistics& statistics;
    const Counters& counters;
    const pipeline::RunReport& report;
    std::size_t frame_memory_bytes = 0;
    double seconds = 0.0;
};

// Source, calibration, what the geometry allows, settings in force: to stdout.
void print_start(const RunFacts& facts);
// Frames, verdicts, ground, mask, stage times, memory: to stdout.
void print_end(const RunFindings& findings);

// The summary without and with what was found. Source, settings and results are a function of the input;
// threads, stages_ms and what depends on time are not.
nlohmann::ordered_json summary_of(const RunFacts& facts);
void add_findings(nlohmann::ordered_json& summary, const RunFindings& findings);

}  // namespace groundline::cli
