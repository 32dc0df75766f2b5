#include "cli/evaluate_command.hpp"

#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "cli/evaluate_set.hpp"
#include "cli/figures.hpp"
#include "cli/matcher_table.hpp"
#include "cli/terrain_table.hpp"
#include "cli/truth_sets.hpp"
#include "core/deterministic_math.hpp"
#include "core/error.hpp"
#include "core/evidence.hpp"

namespace groundline::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

// The figures a set is judged by, in the order of the suite's columns.
struct Metric {
    const char* group;
    const char* key;     // in JSON
    const char* column;  // in the suite's table
    double table_scale;  // shares are shown in per cent
    int decimals;
    Figure (*of)(const SetReport&);
};

Figure mean_pose(const SetReport& report, double sum) {
    if (report.pose.frames == 0) return std::nullopt;
    return sum / static_cast<double>(report.pose.frames);
}
Figure most_pose(const SetReport& report, double most) {
    return report.pose.frames == 0 ? Figure{} : Figure{most};
}

using R = const SetReport&;
const std::array kMetrics = {
    Metric{"disparity", "density", "density", 100, 1,
           [](R r) { return share(r.disparity.answered, r.disparity.scored); }},
    Metric{"disparity", "bad1", "bad-1", 100, 1,
           [](R r) { return share(r.disparity.bad1, r.disparity.answered); }},
    Metric{"disparity", "bad3", "bad-3", 100, 1,
           [](R r) { return share(r.disparity.bad3, r.disparity.answered); }},
    Metric{"disparity", "bad1_with_absent", "bad-1+abs", 100, 1,
           [](R r) {
               return share(r.disparity.bad1 + r.disparity.scored - r.disparity.answered, r.disparity.scored);
           }},
    Metric{"disparity", "bad3_with_absent", "bad-3+abs", 100, 1,
           [](R r) {
               return share(r.disparity.bad3 + r.disparity.scored - r.disparity.answered, r.disparity.scored);
           }},
    Metric{"disparity", "mean_abs_error_px", "error px", 1, 2,
           [](R r) {
               const Figure q8 = share(r.disparity.error_q8, r.disparity.answered);
               return q8 ? Figure{*q8 / 256.0} : Figure{};
           }},
    Metric{"terrain", "obstacle_recall", "obst found", 100, 1,
           [](R r) { return share(r.terrain.obstacle_found, r.terrain.obstacle); }},
    Metric{"terrain", "obstacle_called_free", "obst free", 100, 2,
           [](R r) { return share(r.terrain.obstacle_free, r.terrain.obstacle); }},
    Metric{"terrain", "ground_false_positive", "gnd alarm", 100, 1,
           [](R r) { return share(r.terrain.ground_alarmed, r.terrain.ground); }},
    Metric{"terrain", "ground_known", "gnd known", 100, 1,
           [](R r) { return share(r.terrain.ground_known, r.terrain.ground); }},
    Metric{"terrain", "drop_recall", "drop found", 100, 1,
           [](R r) { return share(r.terrain.drop_found, r.terrain.drop); }},
    Metric{"terrain", "drop_called_free", "drop free", 100, 2,
           [](R r) { return share(r.terrain.drop_free, r.terrain.drop); }},
    Metric{"pose", "pitch_deg_mean", "pitch deg", 1, 2,
           [](R r) { return mean_pose(r, det::degrees(r.pose.sum.pitch_rad)); }},
    Metric{"pose", "pitch_deg_max", nullptr, 1, 2,
           [](R r) { return most_pose(r, det::degrees(r.pose.most.pitch_rad)); }},
    Metric{"pose", "roll_deg_mean", "roll deg", 1, 2,
           [](R r) { return mean_pose(r, det::degrees(r.pose.sum.roll_rad)); }},
    Metric{"pose", "roll_deg_max", nullptr, 1, 2,
           [](R r) { return most_pose(r, det::degrees(r.pose.most.roll_rad)); }},
    Metric{"pose", "height_share_mean", "height %", 100, 1,
           [](R r) { return mean_pose(r, r.pose.sum.height_m); }},
    Metric{"pose", "height_share_max", nullptr, 100, 1,
           [](R r) { return most_pose(r, r.pose.most.height_m); }},
};

const Metric& metric(std::string_view key) {
    return *std::find_if(kMetrics.begin(), kMetrics.end(),
                         [&](const Metric& each) { return each.key == key; });
}

std::string shown(const Metric& which, const Figure& figure) {
    return figure ? fmt::format("{:.{}f}", *figure * which.table_scale, which.decimals) : "-";
}
std::string shown(const SetReport& report, std::string_view key) {
    const Metric& which = metric(key);
    return shown(which, which.of(report));
}

ordered_json to_json(const SetReport& report) {
    ordered_json root;
    root["frames"] = {{"evaluated", report.evaluated},
                      {"without_result", report.without_result},
                      {"without_truth", report.without_truth},
                      {"unreadable", report.unreadable}};
    root["remarks"] = report.remarks;
    for (const std::size_t verdict : {2, 1, 0})
        root["verdicts"][std::string(kVerdictNames[verdict])] = report.verdicts[verdict];
    root["disparity"] = {{"scored", report.disparity.scored},
                         {"answered", report.disparity.answered},
                         {"occluded", report.disparity.occluded},
                         {"occlusion_from", report.occlusion}};
    root["terrain"] = nullptr;
    if (!report.terrain_truth.empty())
        root["terrain"] = {{"truth", report.terrain_truth},
                           {"obstacle_pixels", report.terrain.obstacle},
                           {"ground_pixels", report.terrain.ground},
                           {"drop_pixels", report.terrain.drop}};
    root["pose"] = nullptr;
    if (!report.pose_truth.empty())
        root["pose"] = {{"truth", report.pose_truth}, {"frames", report.pose.frames}};
    for (const Metric& each : kMetrics)
        if (!root[each.group].is_null()) root[each.group][each.key] = number(each.of(report));
    return root;
}

void print_table(const SetReport& report) {
    fmt::print("frames       {} compared, {} without result, {} without truth, {} unreadable\n",
               report.evaluated, report.without_result, report.without_truth, report.unreadable);
    fmt::print("verdict      {} trusted, {} degraded, {} blind\n", report.verdicts[2], report.verdicts[1],
               report.verdicts[0]);
    fmt::print("disparity    {} pixels compared, {} occluded ones left out (told by: {})\n",
               report.disparity.scored, report.disparity.occluded, report.occlusion);
    fmt::print("  density    {} %\n", shown(report, "density"));
    fmt::print("  bad-1      {} % of the answered; {} % with absent counted bad\n", shown(report, "bad1"),
               shown(report, "bad1_with_absent"));
    fmt::print("  bad-3      {} % of the answered; {} % with absent counted bad\n", shown(report, "bad3"),
               shown(report, "bad3_with_absent"));
    fmt::print("  error      {} px, mean of the answered\n", shown(report, "mean_abs_error_px"));
    if (!report.terrain_truth.empty()) {
        fmt::print("obstacles    {} pixels (truth: {})\n", report.terrain.obstacle, report.terrain_truth);
        fmt::print("  found      {} %\n", shown(report, "obstacle_recall"));
        fmt::print("  shown free {} %\n", shown(report, "obstacle_called_free"));
        if (report.terrain.drop > 0)
            fmt::print("drops        {} pixels: {} % found, {} % shown free\n", report.terrain.drop,
                       shown(report, "drop_recall"), shown(report, "drop_called_free"));
        fmt::print("ground       {} pixels\n", report.terrain.ground);
        fmt::print("  false      {} % shown as obstacle or drop\n", shown(report, "ground_false_positive"));
        fmt::print("  known      {} %\n", shown(report, "ground_known"));
    }
    if (!report.pose_truth.empty()) {
        fmt::print("ground pose  {} frames (truth: {}), mean and largest difference\n", report.pose.frames,
                   report.pose_truth);
        fmt::print("  pitch      {} deg, {} deg\n", shown(report, "pitch_deg_mean"),
                   shown(report, "pitch_deg_max"));
        fmt::print("  roll       {} deg, {} deg\n", shown(report, "roll_deg_mean"),
                   shown(report, "roll_deg_max"));
        fmt::print("  height     {} %, {} %\n", shown(report, "height_share_mean"),
                   shown(report, "height_share_max"));
    }
}

void say_remarks(const SetReport& report, const std::string& prefix) {
    for (const std::string& remark : report.remarks)
        fmt::print(stderr, "groundline: {}{}\n", prefix, remark);
}

int status_of(const SetReport& report) {
    return static_cast<int>(report.unreadable > 0 ? ExitStatus::kInput : ExitStatus::kDone);
}

int evaluate_one(const EvaluateOptions& options) {
    const SetReport report = evaluate_set(options.truth, options.out);
    if (options.json) {
        ordered_json root = {{"truth", options.truth.string()}, {"out", options.out.string()}};
        root.update(to_json(report));
        fmt::print("{}\n", root.dump(2));
    } else {
        print_table(report);
    }
    std::fflush(stdout);
    say_remarks(report, "");
    return status_of(report);
}

// A new folder that goes away with everything in it.
class TemporaryFolder {
  public:
    TemporaryFolder() {
        std::string pattern = (fs::temp_directory_path() / "groundline-XXXXXX").string();
        if (::mkdtemp(pattern.data()) == nullptr)
            throw Refusal(ExitStatus::kFailed,
                          fmt::format("cannot make a temporary folder like '{}'; is TMPDIR "
                                      "writable?",
                                      pattern));
        path_ = pattern;
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    ~TemporaryFolder() {
        std::error_code ignored;
        fs::remove_all(path_, ignored);
    }
    const fs::path& path() const { return path_; }

  private:
    fs::path path_;
};

struct SuiteRow {
    std::string name;
    int status = 0;
    std::optional<SetReport> report;  // none: it could not be replayed or compared
    std::string problem;
};

SuiteRow evaluate_replayed(const EvaluateOptions& options, const fs::path& set) {
    SuiteRow row;
    row.name = set.filename().string();
    const TemporaryFolder folder;
    try {
        row.status = options.replay(set, folder.path() / row.name);
        if (row.status != 0) row.problem = fmt::format("its replay ended with status {}", row.status);
        if (row.status != 0 && row.status != static_cast<int>(ExitStatus::kInput)) return row;
        row.report = evaluate_set(set, folder.path() / row.name);
        if (row.status == 0) row.status = status_of(*row.report);
    } catch (const Refusal& refusal) {
        row.status = static_cast<int>(refusal.status());
        row.problem = refusal.what();
    }
    return row;
}

// Over the sets that have the figure; each set weighs alike.
Figure mean_of(const std::vector<SuiteRow>& rows, const Metric& which) {
    double sum = 0.0;
    int count = 0;
    for (const SuiteRow& row : rows) {
        if (!row.report) continue;
        const Figure figure = which.of(*row.report);
        if (!figure) continue;
        sum += *figure;
        ++count;
    }
    return count > 0 ? Figure{sum / count} : Figure{};
}

void print_suite(const std::vector<SuiteRow>& rows) {
    std::vector<std::vector<std::string>> lines = {{"set", "frames", "trust/degr/blind"}};
    for (const Metric& each : kMetrics)
        if (each.column != nullptr) lines[0].emplace_back(each.column);
    for (const SuiteRow& row : rows) {
        std::vector<std::string> line = {row.name};
        if (row.report) {
            line.push_back(std::to_string(row.report->evaluated));
            line.push_back(fmt::format("{}/{}/{}", row.report->verdicts[2], row.report->verdicts[1],
                                       row.report->verdicts[0]));
            for (const Metric& each : kMetrics)
                if (each.column != nullptr) line.push_back(shown(each, each.of(*row.report)));
        } else {
            line.resize(lines[0].size(), "-");
        }
        lines.push_back(std::move(line));
    }
    lines.push_back({"mean", "", ""});
    for (const Metric& each : kMetrics)
        if (each.column != nullptr) lines.back().push_back(shown(each, mean_of(rows, each)));

    fmt::print("{}", aligned(lines, 1));
    fmt::print(
        "in per cent unless a unit is named; +abs: absent counted bad; obst, gnd, drop: pixels that are so "
        "in the "
        "truth,\nand how many of them are found, shown as free, falsely alarmed, known\n");
}

ordered_json suite_json(const EvaluateOptions& options, const std::vector<SuiteRow>& rows) {
    ordered_json root = {{"suite", options.suite.string()}, {"sets", ordered_json::array()}};
    for (const SuiteRow& row : rows) {
        ordered_json set = {{"name", row.name}, {"status", row.status}};
        if (!row.problem.empty()) set["problem"] = row.problem;
        if (row.report) set.update(to_json(*row.report));
        root["sets"].push_back(std::move(set));
    }
    for (const Metric& each : kMetrics)
        root["mean"][each.group][each.key] = number(mean_of(rows, each));
    return root;
}

int evaluate_suite(const EvaluateOptions& options) {
    std::vector<SuiteRow> rows;
    int status = 0;
    for (const fs::path& set : truth_sets(options.suite, options.sets)) {
        rows.push_back(evaluate_replayed(options, set));
        const SuiteRow& row = rows.back();
        if (!row.problem.empty()) fmt::print(stderr, "groundline: {}: {}\n", row.name, row.problem);
        if (row.report) say_remarks(*row.report, row.name + ": ");
        if (status == 0) status = row.status;
        if (row.status == static_cast<int>(ExitStatus::kInterrupted)) {
            status = row.status;
            break;
        }
    }
    if (options.json)
        fmt::print("{}\n", suite_json(options, rows).dump(2));
    else
        print_suite(rows);
    return status;
}

}  // namespace

int run_evaluate(const EvaluateOptions& options) {
    if (options.matchers)
        return run_matcher_table({options.suite, options.sets, options.matcher_names, options.conditions,
                                  options.disparities, options.json});
    if (options.terrain)
        return run_terrain_table({options.suite.string(), options.sets, options.seeds, options.config,
                                  options.set, options.threads, options.json});
    return options.suite.empty() ? evaluate_one(options) : evaluate_suite(options);
}

}  // namespace groundline::cli
