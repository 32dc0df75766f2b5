#include "cli/run_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/deterministic_math.hpp"
#include "rig/range.hpp"

namespace groundline::cli {
namespace {

using Json = nlohmann::ordered_json;

// At this width a terminal still shows the settings without breaking a word.
constexpr std::size_t kLineWidth = 100;

double median(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

double rounded(double value, double step) {
    return std::round(value / step) * step;
}

double milliseconds(std::int64_t nanoseconds) {
    return rounded(static_cast<double>(nanoseconds) * 1e-6, 1e-3);
}

}  // namespace

void print_start(const RunFacts& facts) {
    const SourceInfo& info = facts.info;
    const stereo::MatcherConfig& matcher = facts.settings.matcher;
    const int last_disparity = matcher.min_disparity + matcher.disparities - 1;
    fmt::print("source       {}: {} of {}x{}\n", info.name,
               info.length >= 0 ? fmt::format("{} pairs", info.length) : "pairs", info.width, info.height);
    if (facts.rig.calibrated) {
        const RectifiedRig& rig = facts.rig;
        const rig::RangeLimits limits = rig::range_limits(rig, matcher.min_disparity, matcher.disparities);
        fmt::print(
            "calibration  {} ({}): f {:.2f} px, centre {:.1f} {:.1f}, baseline {:.4f} m{}\n",
            facts.calibration->source, facts.calibration->format, rig.focal_px, rig.cx_px, rig.cy_px,
            rig.baseline_m,
            rig.offset_px() != 0.0 ? fmt::format(", disparity offset {:.3f} px", rig.offset_px()) : "");
        fmt::print(
            "range        disparities {} .. {}: nothing nearer than {:.2f} m is matched; a quarter pixel "
            "is {:.2f} m at 5 m and a tenth of the depth at {:.1f} m\n",
            matcher.min_disparity, last_disparity, limits.near_m, rig::depth_sigma_m(rig, 5.0, 0.25),
            limits.tenth_m);
    } else {
        fmt::print(
            "calibration  none: the pair is taken as rectified, heights are shares of the camera height, "
            "the verdict is degraded at best\nrange        disparities {} .. {}\n",
            matcher.min_disparity, last_disparity);
    }
    std::string line = "settings    ";
    for (const auto& [key, value] : settings::in_force(facts.settings)) {
        const std::string word = fmt::format(" {}={}", key, value);
        if (line.size() + word.size() > kLineWidth) {
            fmt::print("{}\n", line);
            line.assign(12, ' ');
        }
        line += word;
    }
    fmt::print("{}\n", line);
}

void print_end(const RunFindings& findings) {
    const RunStatistics& statistics = findings.statistics;
    const auto count = [&](Count which) { return findings.counters.get(which); };
    fmt::print("frames       {} read, {} delivered, {} bad, {} overwritten by newer ones; {:.2f} a second\n",
               count(Count::kFramesRead), count(Count::kResultsDelivered), count(Count::kFramesBad),
               count(Count::kFramesOverwritten) + count(Count::kResultsOverwritten),
               static_cast<double>(statistics.frames()) / findings.seconds);
    fmt::print("verdict      {} trusted, {} degraded, {} blind\n", statistics.verdicts(Verdict::kTrusted),
               statistics.verdicts(Verdict::kDegraded), statistics.verdicts(Verdict::kBlind));
    std::string reasons;
    for (std::size_t i = 0; i < kReasonNames.size(); ++i)
        if (const std::int64_t frames = statistics.reasons(static_cast<Reason>(i)); frames > 0)
            reasons += fmt::format("{}{} {}", reasons.empty() ? "" : ", ", kReasonNames[i], frames);
    if (!reasons.empty()) fmt::print("reasons      {} (frames)\n", reasons);
    if (const std::vector<double>& heights_m = statistics.heights_m(); !heights_m.empty()) {
        const auto [low, high] = std::minmax_element(heights_m.begin(), heights_m.end());
        fmt::print(
            "ground       camera height {:.3f} m ({:.3f} .. {:.3f}), pitch {:.2f} deg: medians of {} "
            "frames\n",
            median(heights_m), *low, *high, det::degrees(median(statistics.pitches_rad())), heights_m.size());
    }
    if (statistics.frames() > 0)
        fmt::print("mask         traversable {:.1f} %, obstacle {:.1f} %, drop {:.1f} %, unknown {:.1f} %\n",
                   100.0 * statistics.share(TerrainClass::kTraversable),
                   100.0 * statistics.share(TerrainClass::kObstacle),
                   100.0 * statistics.share(TerrainClass::kDrop),
                   100.0 * statistics.share(TerrainClass::kUnknown));
    for (std::size_t i = 0; i < kStageNames.size(); ++i)
        if (const LatencyHistogram& stage = findings.report.stages[i]; stage.count() > 0)
            fmt::print("{} {:9} p50 {:8.2f}  p99 {:8.2f}  max {:8.2f} ms\n",
                       i == 0 ? "stages      " : "            ", kStageNames[i],
                       milliseconds(stage.percentile_ns(0.50)), milliseconds(stage.percentile_ns(0.99)),
                       milliseconds(stage.max_ns()));
    if (const LatencyHistogram& latency = findings.report.latency; latency.count() > 0)
        fmt::print(
            "latency      p50 {:8.2f}  p99 {:8.2f}  max {:8.2f} ms, from a pair read to its result "
            "delivered\n",
            milliseconds(latency.percentile_ns(0.50)), milliseconds(latency.percentile_ns(0.99)),
            milliseconds(latency.max_ns()));
    fmt::print("memory       {:.1f} MB for frames, taken before the first one\n",
               static_cast<double>(findings.frame_memory_bytes) * 1e-6);
}

Json summary_of(const RunFacts& facts) {
    const RectifiedRig& rig = facts.rig;
    Json summary;
    summary["groundline"] = GROUNDLINE_VERSION;
    summary["source"] = facts.info.name;
    summary["width"] = rig.width;
    summary["height"] = rig.height;
    summary["calibration"] = nullptr;
    if (rig.calibrated)
        summary["calibration"] = {{"file", facts.calibration->source},
                                  {"format", facts.calibration->format},
                                  {"focal_px", rig.focal_px},
                                  {"cx_px", rig.cx_px},
                                  {"cy_px", rig.cy_px},
                                  {"baseline_m", rig.baseline_m},
                                  {"disparity_offset_px", rig.offset_px()}};
    summary["search"] = {{"min_disparity", facts.settings.matcher.min_disparity},
                         {"disparities", facts.settings.matcher.disparities}};
    summary["threads"] = facts.threads;
    Json& in_force = summary["settings"] = Json::object();
    for (const auto& [key, value] : settings::in_force(facts.settings))
        in_force[key] = value;
    return summary;
}

void add_findings(Json& summary, const RunFindings& findings) {
    const RunStatistics& statistics = findings.statistics;
    Json& counters = summary["counters"] = Json::object();
    for (std::size_t i = 0; i < kCountNames.size(); ++i)
        counters[std::string(kCountNames[i])] = findings.counters.get(static_cast<Count>(i));
    Json& verdicts = summary["verdicts"] = Json::object();
    for (std::size_t i = 0; i < kVerdictNames.size(); ++i)
        verdicts[std::string(kVerdictNames[i])] = statistics.verdicts(static_cast<Verdict>(i));
    Json& reasons = summary["reasons"] = Json::object();
    for (std::size_t i = 0; i < kReasonNames.size(); ++i)
        if (const std::int64_t frames = statistics.reasons(static_cast<Reason>(i)); frames > 0)
            reasons[std::string(kReasonNames[i])] = frames;
    Json& share = summary["share"] = Json::object();
    for (std::size_t i = 0; i < kTerrainClassNames.size(); ++i)
        share[std::string(kTerrainClassNames[i])] =
            rounded(statistics.share(static_cast<TerrainClass>(i)), 1e-6);
    summary["ground"] = nullptr;
    if (!statistics.heights_m().empty())
        summary["ground"] = {
            {"frames", statistics.heights_m().size()},
            {"median_height_m", rounded(median(statistics.heights_m()), 1e-4)},
            {"median_pitch_deg", rounded(det::degrees(median(statistics.pitches_rad())), 1e-3)}};
    const auto percentiles = [](const LatencyHistogram& histogram) {
        return Json{{"p50", milliseconds(histogram.percentile_ns(0.50))},
                    {"p99", milliseconds(histogram.percentile_ns(0.99))},
                    {"max", milliseconds(histogram.max_ns())}};
    };
    Json& stages = summary["stages_ms"] = Json::object();
    for (std::size_t i = 0; i < kStageNames.size(); ++i)
        if (const LatencyHistogram& stage = findings.report.stages[i]; stage.count() > 0)
            stages[std::string(kStageNames[i])] = percentiles(stage);
    summary["latency_ms"] = percentiles(findings.report.latency);
    summary["frame_memory_bytes"] = findings.frame_memory_bytes;
}

}  // namespace groundline::cli
