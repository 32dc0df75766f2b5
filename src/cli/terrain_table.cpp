#include "cli/terrain_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <string_view>
#include <thread>

#include "cli/figures.hpp"
#include "cli/interrupt.hpp"
#include "cli/step_progress.hpp"
#include "cli/terrain_baseline.hpp"
#include "cli/terrain_run.hpp"
#include "cli/terrain_suite.hpp"
#include "cli/truth_sets.hpp"
#include "core/deterministic_math.hpp"
#include "core/error.hpp"
#include "pipeline/worker_pool.hpp"
#include "setup/run_setup.hpp"

namespace groundline::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::array<const char*, kTerrainMethods> kMethodNames = {"groundline", "baseline"};

using P = const TerrainPool&;
struct Metric {
    const char* key;     // in JSON
    const char* title;   // in the table; none: JSON only
    double table_scale;  // shares are shown in per cent
    int decimals;
    Figure (*of)(P);
};
Figure counted(int part, int whole) {
    return whole == 0 ? Figure{} : Figure{part};
}
const std::array kMetrics = {
    Metric{"obstacle_recall", "obst", 100, 2,
           [](P p) { return share(p.seen.obstacle_found, p.seen.obstacle); }},
    Metric{"obstacle_called_free", "o.free", 100, 3,
           [](P p) { return share(p.seen.obstacle_free, p.seen.obstacle); }},
    Metric{"ground_flagged", "g.alarm", 100, 3,
           [](P p) { return share(p.seen.ground_alarmed, p.seen.ground); }},
    Metric{"ground_known", "g.known", 100, 2, [](P p) { return share(p.seen.ground_known, p.seen.ground); }},
    Metric{"drop_recall", "drop", 100, 2, [](P p) { return share(p.seen.drop_found, p.seen.drop); }},
    Metric{"drop_called_free", "d.free", 100, 2, [](P p) { return share(p.seen.drop_free, p.seen.drop); }},
    Metric{"pitch_deg_median", "pitch", 1, 3, [](P p) { return median_of(p.pitch_deg); }},
    Metric{"pitch_deg_max", "max", 1, 2, [](P p) { return most_of(p.pitch_deg); }},
    Metric{"roll_deg_median", "roll", 1, 3, [](P p) { return median_of(p.roll_deg); }},
    Metric{"roll_deg_max", "max", 1, 2, [](P p) { return most_of(p.roll_deg); }},
    Metric{"height_share_median", "height", 100, 2, [](P p) { return median_of(p.height_share); }},
    Metric{"height_share_max", "max", 100, 1, [](P p) { return most_of(p.height_share); }},
    Metric{"false_obstacles", "f.obst", 1, 0, [](P p) { return counted(p.false_obstacles, p.empty_frames); }},
    Metric{"frames_with_false_obstacles", "f.frames", 1, 0,
           [](P p) { return counted(p.alarmed_frames, p.empty_frames); }},
    Metric{"ditches_shown", "ditch", 100, 1, [](P p) { return share(p.ditches_shown, p.ditches); }},
    Metric{"ditches_before_lip", "b.lip", 100, 1,
           [](P p) { return share(p.ditches_before_lip, p.ditches_with_sectors); }},
    Metric{"most_beyond_lip_m", "lip m", 1, 2,
           [](P p) { return p.ditches_with_sectors == 0 ? Figure{} : Figure{p.most_beyond_lip_m}; }},
};

struct Row {
    std::string name;
    std::array<TerrainPool, kTerrainMethods> pools;
};

void add(const JudgedFrame& frame, Row& row) {
    for (std::size_t method = 0; method < kTerrainMethods; ++method)
        row.pools[method].add(frame.scores[method]);
}

Row& row_of(const std::string& name, std::vector<Row>& rows) {
    const auto known =
        std::find_if(rows.begin(), rows.end(), [&](const Row& row) { return row.name == name; });
    if (known != rows.end()) return *known;
    rows.push_back({name, {}});
    return rows.back();
}

// A row for each set or scene, for sets also one for each beginning of names, and one for all.
struct Table {
    std::vector<Row> rows;
    std::vector<Row> groups;
    Row all{"all", {}};
};

Table tabled(const std::vector<JudgedUnit>& units, bool grouped) {
    Table table;
    for (const JudgedUnit& unit : units)
        for (const JudgedFrame& frame : unit.frames) {
            add(frame, row_of(frame.set, table.rows));
            if (grouped) add(frame, row_of(frame.set.substr(0, frame.set.find('_')), table.groups));
            add(frame, table.all);
        }
    return table;
}

std::string shown(const Metric& metric, P pool) {
    const Figure figure = metric.of(pool);
    return figure ? fmt::format("{:.{}f}", *figure * metric.table_scale, metric.decimals) : "-";
}

std::vector<std::vector<std::string>> lines_of(const Row& row) {
    std::vector<std::vector<std::string>> lines;
    for (std::size_t method = 0; method < kTerrainMethods; ++method) {
        P pool = row.pools[method];
        lines.push_back({method == 0 ? row.name : "", kMethodNames[method],
                         fmt::format("{}/{}/{}", pool.verdicts[2], pool.verdicts[1], pool.verdicts[0])});
        for (const Metric& metric : kMetrics)
            lines.back().push_back(shown(metric, pool));
    }
    return lines;
}

std::string reasons_text(Reasons reasons) {
    std::string text;
    for (int i = 0; i < kReasons; ++i)
        if (reasons.has(static_cast<Reason>(i)))
            text += fmt::format("{}{}", text.empty() ? "" : " ", kReasonNames[static_cast<std::size_t>(i)]);
    return text;
}

// What was said of pictures that must not be trusted: how often each verdict with its reasons, by scene.
void print_verdicts(const Table& table, const std::vector<JudgedUnit>& units) {
    std::vector<std::vector<std::string>> lines = {{"scene", "frames", "verdict", "reasons"}};
    for (const Row& row : table.rows) {
        std::map<std::pair<Verdict, std::uint32_t>, int> counts;
        for (const JudgedUnit& unit : units)
            for (const JudgedFrame& frame : unit.frames)
                if (frame.set == row.name)
                    ++counts[{frame.scores[0].verdict, frame.scores[0].reasons.bits()}];
        for (const auto& [said, count] : counts)
            lines.push_back({row.name, std::to_string(count),
                             std::string(kVerdictNames[static_cast<std::size_t>(said.first)]),
                             reasons_text(Reasons(said.second))});
    }
    fmt::print("{}trusted: {} of {} frames\n", aligned(lines, 4), table.all.pools[0].verdicts[2],
               units.size());
}

void print_figures(const Table& table, const char* what) {
    std::vector<std::vector<std::string>> lines = {{what, "", "trust/degr/blind"}};
    for (const Metric& metric : kMetrics)
        lines[0].emplace_back(metric.title);
    const auto append = [&](const Row& row) {
        for (auto& line : lines_of(row))
            lines.push_back(std::move(line));
    };
    for (const Row& row : table.rows)
        append(row);
    for (const Row& row : table.groups)
        append(row);
    append(table.all);
    fmt::print("{}", aligned(lines, 2));
}

void print_legend(bool rendered) {
    fmt::print(
        "In per cent of the pixels that are so in the truth and that both cameras see: obst, drop found; "
        "o.free, d.free\nshown as free; g.alarm ground shown as obstacle or drop, g.known as anything but "
        "unknown. Pitch and roll in deg,\nheight in per cent: median and largest error of the frames with a "
        "ground. f.obst, f.frames: false obstacles, and\nframes with any, where nothing stands. ditch: "
        "share of the ditches of whose pixels at most 1 % are shown as\nfree; b.lip: share with every "
        "sector's free range ending before the lip; lip m: the farthest beyond it.\n");
    if (rendered)
        fmt::print(
            "Judged out to min({} m, f b tolerance / (3 h 0.25 px)): obstacles from {} m up, ground within "
            "{} m, drops {} m\ndeeper than the tolerance.\n",
            kJudgedRange, kStandsOut, kGroundWithin, kDeeperThanDrop);
    else
        fmt::print("Judged out to {} m: obstacles above {} m, ground within {} m.\n", kJudgedRange,
                   kObstacleAbove, kGroundWithin);
    fmt::print("Baseline: {}. It is trusted where it finds a ground.\n", TerrainBaseline::parameters());
}

void print_times(const Row& all) {
    fmt::print("Time a frame, medians:");
    for (std::size_t method = 0; method < kTerrainMethods; ++method)
        fmt::print("{} {} matching {:.2f} ms, terrain {:.2f} ms", method == 0 ? "" : ";",
                   kMethodNames[method], median_of(all.pools[method].match_ms).value_or(0.0),
                   median_of(all.pools[method].terrain_ms).value_or(0.0));
    fmt::print(".\n");
}

void print_table(const Table& table, const std::vector<JudgedUnit>& units,
                 const std::optional<Suite>& suite) {
    if (suite && suite->study == Study::kNever) {
        print_verdicts(table, units);
    } else {
        print_figures(table, suite ? "scene" : "set");
        print_legend(suite.has_value());
    }
    print_times(table.all);
}

ordered_json counts_json(const TerrainScore& score) {
    return {{"obstacle", score.obstacle},
            {"obstacle_found", score.obstacle_found},
            {"obstacle_free", score.obstacle_free},
            {"ground", score.ground},
            {"ground_flagged", score.ground_alarmed},
            {"ground_known", score.ground_known},
            {"drop", score.drop},
            {"drop_found", score.drop_found},
            {"drop_free", score.drop_free}};
}

ordered_json row_json(const Row& row) {
    ordered_json root = {{"name", row.name}};
    for (std::size_t method = 0; method < kTerrainMethods; ++method) {
        P pool = row.pools[method];
        ordered_json figures;
        for (const std::size_t verdict : {2, 1, 0})
            figures["verdicts"][std::string(kVerdictNames[verdict])] = pool.verdicts[verdict];
        for (const Metric& metric : kMetrics)
            figures[metric.key] = number(metric.of(pool));
        figures["frames_with_pose"] = pool.pitch_deg.size();
        figures["frames_without_things"] = pool.empty_frames;
        figures["ditches"] = pool.ditches;
        figures["pixels"] = counts_json(pool.seen);
        figures["pixels_with_occluded"] = counts_json(pool.all);
        root[kMethodNames[method]] = std::move(figures);
    }
    return root;
}

ordered_json frame_json(const JudgedFrame& frame) {
    ordered_json root = {{"set", frame.set}, {frame.spec.empty() ? "frame" : "seed", frame.frame}};
    if (!frame.spec.empty()) root["spec"] = frame.spec;
    root["range_m"] = number(frame.range_m);
    for (std::size_t method = 0; method < kTerrainMethods; ++method) {
        const FrameScore& score = frame.scores[method];
        ordered_json one = {{"verdict", kVerdictNames[static_cast<std::size_t>(score.verdict)]}};
        if (method == 0) one["reasons"] = reasons_text(score.reasons);
        one["pose_error"] = nullptr;
        if (score.pose_error)
            one["pose_error"] = {{"pitch_deg", number(det::degrees(score.pose_error->pitch_rad))},
                                 {"roll_deg", number(det::degrees(score.pose_error->roll_rad))},
                                 {"height_share", number(score.pose_error->height_m)}};
        if (score.false_obstacles) one["false_obstacles"] = *score.false_obstacles;
        if (score.beyond_lip_m) one["beyond_lip_m"] = number(*score.beyond_lip_m);
        one["pixels"] = counts_json(score.seen);
        one["pixels_with_occluded"] = counts_json(score.all);
        root[kMethodNames[method]] = std::move(one);
    }
    return root;
}

ordered_json times_json(const Row& row) {
    ordered_json root = {{"name", row.name}};
    for (std::size_t method = 0; method < kTerrainMethods; ++method)
        root[kMethodNames[method]] = {{"match", number(median_of(row.pools[method].match_ms))},
                                      {"terrain", number(median_of(row.pools[method].terrain_ms))}};
    return root;
}

ordered_json table_json(const TerrainTableOptions& options, const Table& table,
                        const std::vector<JudgedUnit>& units) {
    ordered_json root = {{"suite", options.suite}, {"baseline", TerrainBaseline::parameters()}};
    root["rows"] = ordered_json::array();
    for (const Row& row : table.rows)
        root["rows"].push_back(row_json(row));
    root["groups"] = ordered_json::array();
    for (const Row& row : table.groups)
        root["groups"].push_back(row_json(row));
    root["all"] = row_json(table.all);
    root["frames"] = ordered_json::array();
    root["left_out"] = ordered_json::array();
    for (const JudgedUnit& unit : units) {
        for (const JudgedFrame& frame : unit.frames)
            root["frames"].push_back(frame_json(frame));
        if (!unit.problem.empty())
            root["left_out"].push_back(
                {{"name", unit.name}, {"status", unit.status}, {"problem", unit.problem}});
    }
    root["times_ms"] = ordered_json::array();
    for (const Row& row : table.rows)
        root["times_ms"].push_back(times_json(row));
    root["times_ms"].push_back(times_json(table.all));
    return root;
}

// Runs them on all lanes; the results stand in their order. What is not done was interrupted.
template <typename Run>
std::vector<JudgedUnit> run_all(std::size_t count, int threads, const std::atomic<bool>& stop, Run run) {
    std::vector<JudgedUnit> units(count);
    std::mutex shown;
    std::size_t done = 0;
    const int processors = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
    pipeline::WorkerPool pool(threads > 0 ? threads : processors);
    pool.for_each(static_cast<int>(count), [&](int index, int) {
        if (stop.load(std::memory_order_relaxed)) return;
        JudgedUnit& unit = units[static_cast<std::size_t>(index)];
        try {
            run(static_cast<std::size_t>(index), unit);
        } catch (const std::exception& problem) {
            const auto* refusal = dynamic_cast<const Refusal*>(&problem);
            unit.status = static_cast<int>(refusal != nullptr ? refusal->status() : ExitStatus::kFailed);
            unit.problem = problem.what();
            unit.done = true;
        }
        const std::lock_guard lock(shown);
        show_step(++done, count, unit.name);
    });
    show_step(count, count, {});
    return units;
}

}  // namespace

int run_terrain_table(const TerrainTableOptions& options) {
    const settings::Settings settings = setup::load_settings(options.config, options.set);
    const std::atomic<bool>& stop = stop_on_signals();
    cv::setNumThreads(1);  // OpenCV's semi-global matcher answers differently with several

    std::optional<Suite> suite;
    std::vector<JudgedUnit> units;
    if (std::string_view(options.suite).starts_with(kSuitePrefix)) {
        if (!options.sets.empty())
            throw Refusal(ExitStatus::kUsage,
                          "--sets is for folders; name rendered scenes in --suite synthetic:NAME,...");
        suite = terrain_suite(options.suite, options.seeds);
        units = run_all(suite->frames.size(), options.threads, stop, [&](std::size_t i, JudgedUnit& unit) {
            unit.name = suite->frames[i].scene;
            unit = judge_rendered(suite->frames[i], settings);
        });
    } else {
        const std::vector<fs::path> sets = truth_sets(options.suite, options.sets);
        units = run_all(sets.size(), options.threads, stop, [&](std::size_t i, JudgedUnit& unit) {
            unit.name = sets[i].filename().string();
            unit = judge_set(sets[i], settings, stop);
        });
    }

    const Table table = tabled(units, !suite);
    if (options.json)
        fmt::print("{}\n", table_json(options, table, units).dump(2));
    else
        print_table(table, units, suite);
    std::fflush(stdout);
    int status = 0;
    std::size_t done = 0;
    for (const JudgedUnit& unit : units) {
        done += unit.done ? 1U : 0U;
        if (status == 0) status = unit.status;
        if (!unit.problem.empty()) fmt::print(stderr, "groundline: {}: {}\n", unit.name, unit.problem);
        for (const std::string& remark : unit.remarks)
            fmt::print(stderr, "groundline: {}: {}\n", unit.name, remark);
    }
    if (done < units.size()) {
        fmt::print(stderr, "groundline: interrupted with {} of {} done\n", done, units.size());
        status = static_cast<int>(ExitStatus::kInterrupted);
    }
    return status;
}

}  // namespace groundline::cli
