#include "cli/matcher_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <string_view>

#include "capture/open.hpp"
#include "cli/compared_matchers.hpp"
#include "cli/figures.hpp"
#include "cli/interrupt.hpp"
#include "cli/perturbation.hpp"
#include "cli/step_progress.hpp"
#include "cli/truth_labels.hpp"
#include "cli/truth_sets.hpp"
#include "core/arena.hpp"
#include "core/error.hpp"
#include "io/calibration/calibration_reader.hpp"
#include "io/truth.hpp"
#include "rig/range.hpp"
#include "rig/rectifier.hpp"

namespace groundline::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct PairView {
    ConstLuma left;
    ConstLuma right;
};

// What is done to a rectified pair before it is matched.
struct Condition {
    const char* name;
    const char* what;
    int repetitions;  // scored together
    // Returns the views to match: the given ones, or what was written into the spare ones.
    PairView (*apply)(const PairView& pair, Luma spare_left, Luma spare_right, std::uint64_t pair_number,
                      int repetition);
};

const std::array kConditions = {
    Condition{"clean", "as they are", 1,
              [](const PairView& pair, Luma, Luma, std::uint64_t, int) { return pair; }},
    Condition{"gain", "right picture 1.1 x + 5 grey levels", 1,
              [](const PairView& pair, Luma, Luma right, std::uint64_t, int) {
                  change_exposure(pair.right, 110, 5, right);
                  return PairView{pair.left, right};
              }},
    Condition{"noise", "both pictures with noise, sigma 5 grey levels; 5 seeds together", 5,
              [](const PairView& pair, Luma left, Luma right, std::uint64_t number, int repetition) {
                  const auto seed = static_cast<std::uint64_t>(repetition);
                  add_noise(pair.left, 5, noise_seed(seed, number, 0), left);
                  add_noise(pair.right, 5, noise_seed(seed, number, 1), right);
                  return PairView{left, right};
              }},
    Condition{"shift", "right picture 1 px lower", 1,
              [](const PairView& pair, Luma, Luma right, std::uint64_t, int) {
                  shift_down(pair.right, 1, right);
                  return PairView{pair.left, right};
              }},
    Condition{"blur", "right picture blurred, 5x5 binomial (sigma 1 px)", 1,
              [](const PairView& pair, Luma, Luma right, std::uint64_t, int) {
                  blur_binomial_5x5(pair.right, right);
                  return PairView{pair.left, right};
              }},
};

std::vector<Condition> choose_conditions(const std::vector<std::string>& names) {
    std::string known;
    for (const Condition& condition : kConditions)
        known += fmt::format("{}{}", known.empty() ? "" : ", ", condition.name);
    for (const std::string& name : names)
        if (std::none_of(kConditions.begin(), kConditions.end(),
                         [&](const Condition& condition) { return condition.name == name; }))
            throw Refusal(ExitStatus::kUsage,
                          fmt::format("no condition is called '{}'; there are {}", name, known));
    std::vector<Condition> chosen;
    for (const Condition& condition : kConditions)
        if (names.empty() || std::find(names.begin(), names.end(), condition.name) != names.end())
            chosen.push_back(condition);
    return chosen;
}

struct Job {
    std::vector<Condition> conditions;
    std::vector<MatcherChoice> matchers;
    int disparities = 0;  // 0: by the set
    const std::atomic<bool>& stop;
};

struct Interrupted {};

// One set: its pairs, their truth, and a matcher of each choice for their size.
class SetRun {
  public:
    SetRun(const Job& job, const fs::path& set) : job_(job), truth_(set) {
        scores_.name = set.filename().string();
        opened_ = capture::open_source({set.string()});
        const SourceInfo& info = opened_.source->info();
        const std::vector<fs::path> files = io::find_calibration(opened_.folder);
        int hint = 0;
        if (files.empty()) {
            rectifier_ = std::make_unique<rig::Rectifier>(info.width, info.height);
        } else {
            const rig::StereoCalibration calibration =
                io::read_calibration(files, info.width, info.height, opened_.colour_pair);
            rectifier_ = std::make_unique<rig::Rectifier>(calibration, info.width, info.height, arena_);
            hint = calibration.disparities_hint;
        }
        scores_.disparities = job.disparities > 0 ? job.disparities : rig::auto_disparities(info.width, hint);
        const MatchSize size{info.width, info.height, 0, scores_.disparities, true};
        for (const MatcherChoice& choice : job.matchers)
            matchers_.push_back(choice.make(size, serial_));
        frame_ = StereoFrame::make(arena_, info.width, info.height, info.colour);
        for (Luma* image : {&left_, &right_, &spare_left_, &spare_right_})
            *image = arena_.image<std::uint8_t>(info.width, info.height);
        answers_ = arena_.image<std::uint16_t>(info.width, info.height);
        scores_.scores.resize(job.conditions.size() * job.matchers.size());
    }

    SetScores run() {
        for (;;) {
            const Pull pull = opened_.source->next(frame_);
            const std::int64_t position = frame_.stamp.position;
            if (pull == Pull::kEnd) {
                leave_out(opened_.source->error());
                break;
            }
            if (pull == Pull::kBad) {
                leave_out(fmt::format("pair {}: {}", position, opened_.source->error()));
            } else if (position < truth_.frames()) {
                read_and_score(static_cast<int>(position));
            }
        }
        scores_.sparse = 2 * known_ <= pixels_;
        if (scores_.frames == 0)
            throw Refusal(ExitStatus::kInput,
                          scores_.remarks.empty() ? "none of its pairs has truth" : scores_.remarks.front());
        return std::move(scores_);
    }

  private:
    void leave_out(const std::string& why) {
        if (why.empty()) return;
        scores_.remarks.push_back(why);
        scores_.status = static_cast<int>(ExitStatus::kInput);
    }

    void read_and_score(int position) {
        io::TruthFrame truth;
        try {
            truth = truth_.read(position);
        } catch (const Refusal&) {
            throw;
        } catch (const std::runtime_error& problem) {
            leave_out(problem.what());
            return;
        }
        const DisparityQ8 wanted = truth.disparity_q8.view();
        if (!wanted.same_size(left_.width, left_.height)) {
            leave_out(fmt::format("the truth of pair {} has {}x{} pixels; expected {}x{} like the pictures",
                                  position, wanted.width, wanted.height, left_.width, left_.height));
            return;
        }
        rectifier_->rectify(frame_, left_, right_, {}, serial_);
        const OcclusionTruth occlusion(truth);
        pixels_ += static_cast<std::int64_t>(truth.disparity_q8.pixels.size());
        known_ += occlusion.known();
        score(wanted, occlusion.view(), position);
        ++scores_.frames;
    }

    void score(DisparityQ8 wanted, ConstLuma occluded, int position) {
        const std::uint64_t number = pair_number(scores_.name, position);
        auto into = scores_.scores.begin();
        for (const Condition& condition : job_.conditions) {
            for (int repetition = 0; repetition < condition.repetitions; ++repetition) {
                const PairView pair =
                    condition.apply({left_, right_}, spare_left_, spare_right_, number, repetition);
                auto cell = into;
                for (const auto& matcher : matchers_) {
                    if (job_.stop.load(std::memory_order_relaxed)) throw Interrupted{};
                    matcher->match(pair.left, pair.right);
                    matcher->answers(answers_);
                    score_disparity(wanted, answers_, occluded, *cell++);
                }
            }
            into += static_cast<std::ptrdiff_t>(matchers_.size());
        }
    }

    const Job& job_;
    io::Truth truth_;
    capture::OpenedSource opened_;
    Arena arena_;
    Serial serial_;
    std::unique_ptr<rig::Rectifier> rectifier_;
    std::vector<std::unique_ptr<ComparedMatcher>> matchers_;
    StereoFrame frame_;
    Luma left_, right_, spare_left_, spare_right_;
    ImageView<std::uint16_t> answers_;
    std::int64_t pixels_ = 0;
    std::int64_t known_ = 0;
    SetScores scores_;
};

SetScores scores_of(const Job& job, const fs::path& set) {
    try {
        return SetRun(job, set).run();
    } catch (const Refusal& refusal) {
        SetScores failed;
        failed.name = set.filename().string();
        failed.status = static_cast<int>(refusal.status());
        failed.problem = refusal.what();
        return failed;
    }
}

// The figures in the order of the columns.
struct Column {
    const char* key;    // in JSON
    const char* title;  // in the table
    std::optional<double> MatcherFigures::*figure;
};
constexpr std::array kColumns = {
    Column{"density", "density", &MatcherFigures::density},
    Column{"bad1", "bad-1", &MatcherFigures::bad1},
    Column{"bad3", "bad-3", &MatcherFigures::bad3},
    Column{"bad1_with_absent", "bad-1+abs", &MatcherFigures::bad1_with_absent},
    Column{"bad3_with_absent", "bad-3+abs", &MatcherFigures::bad3_with_absent},
};

void add(const DisparityScore& from, DisparityScore& to) {
    to.occluded += from.occluded;
    to.scored += from.scored;
    to.answered += from.answered;
    to.bad1 += from.bad1;
    to.bad3 += from.bad3;
    to.error_q8 += from.error_q8;
}

MatcherFigures mean_of(const std::vector<MatcherFigures>& all) {
    MatcherFigures mean;
    for (const Column& column : kColumns) {
        double sum = 0.0;
        int count = 0;
        for (const MatcherFigures& each : all) {
            if (!(each.*column.figure)) continue;
            sum += *(each.*column.figure);
            ++count;
        }
        if (count > 0) mean.*column.figure = sum / count;
    }
    return mean;
}

MatcherGroup group_of(const std::string& name, const std::vector<const SetScores*>& sets) {
    MatcherGroup group;
    group.name = name;
    group.pooled = std::all_of(sets.begin(), sets.end(), [](const SetScores* set) { return set->sparse; });
    group.fewest_disparities = sets.front()->disparities;
    for (const SetScores* set : sets) {
        group.sets.push_back(set->name);
        group.frames += set->frames;
        group.fewest_disparities = std::min(group.fewest_disparities, set->disparities);
        group.most_disparities = std::max(group.most_disparities, set->disparities);
    }
    for (std::size_t cell = 0; cell < sets.front()->scores.size(); ++cell) {
        DisparityScore pool;
        std::vector<MatcherFigures> each;
        for (const SetScores* set : sets) {
            add(set->scores[cell], pool);
            each.push_back(figures_of(set->scores[cell]));
        }
        if (cell == 0) group.scored = pool.scored;
        group.figures.push_back(group.pooled ? figures_of(pool) : mean_of(each));
    }
    return group;
}

std::string range_of(const MatcherGroup& group) {
    if (group.fewest_disparities == group.most_disparities) return std::to_string(group.most_disparities);
    return fmt::format("{} to {}", group.fewest_disparities, group.most_disparities);
}

std::string counted(std::size_t count, const char* what) {
    return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

void print_group(const MatcherGroup& group, const Job& job, std::size_t name_width) {
    fmt::print("{}: {}, {}, {}; {} disparities\n", group.name, counted(group.sets.size(), "set"),
               counted(static_cast<std::size_t>(group.frames), "frame"),
               group.pooled ? "pixels of all taken together" : "mean of the sets", range_of(group));
    auto figures = group.figures.begin();
    for (const Condition& condition : job.conditions) {
        fmt::print("  {:<{}}", condition.name, name_width);
        for (const Column& column : kColumns)
            fmt::print("  {:>9}", column.title);
        fmt::print("\n");
        for (const MatcherChoice& matcher : job.matchers) {
            fmt::print("  {:<{}}", matcher.name, name_width);
            for (const Column& column : kColumns) {
                const std::optional<double> figure = *figures.*column.figure;
                fmt::print("  {:>9}", figure ? fmt::format("{:.2f}", *figure * 100.0) : "-");
            }
            fmt::print("\n");
            ++figures;
        }
    }
    fmt::print("\n");
}

void print_table(const Job& job, const std::vector<MatcherGroup>& groups) {
    std::size_t name_width = 0;
    for (const MatcherChoice& matcher : job.matchers)
        name_width = std::max(name_width, matcher.name.size());
    for (const MatcherGroup& group : groups)
        print_group(group, job, name_width);
    fmt::print(
        "In per cent of the pixels with truth that both cameras see. bad-N: off by more than N px, of the "
        "answered;\n+abs: of all, absent counted bad. Sparse truth is pooled, dense truth averaged set by "
        "set.\nConditions:\n");
    for (const Condition& condition : job.conditions)
        fmt::print("  {:<{}}  {}\n", condition.name, name_width, condition.what);
    fmt::print(
        "Matchers, each from disparity 0 on. OpenCV {} gets the first column repeated to the left, as often "
        "as there are\ndisparities: by itself it answers nothing in so many columns.\n",
        cv::getVersionString());
    for (const MatcherChoice& matcher : job.matchers)
        fmt::print("  {:<{}}  {}\n", matcher.name, name_width, matcher.parameters);
}

ordered_json results_json(const Job& job, const std::vector<MatcherFigures>& figures) {
    ordered_json results = ordered_json::array();
    auto next = figures.begin();
    for (const Condition& condition : job.conditions)
        for (const MatcherChoice& matcher : job.matchers) {
            ordered_json result = {{"condition", condition.name}, {"matcher", matcher.name}};
            for (const Column& column : kColumns)
                result[column.key] = number(*next.*column.figure);
            results.push_back(std::move(result));
            ++next;
        }
    return results;
}

ordered_json set_json(const Job& job, const SetScores& set) {
    ordered_json root = {{"name", set.name}, {"status", set.status}};
    if (!set.problem.empty()) {
        root["problem"] = set.problem;
        return root;
    }
    root["frames"] = set.frames;
    root["disparities"] = set.disparities;
    root["truth"] = set.sparse ? "sparse" : "dense";
    root["remarks"] = set.remarks;
    std::vector<MatcherFigures> figures;
    for (const DisparityScore& score : set.scores)
        figures.push_back(figures_of(score));
    root["results"] = results_json(job, figures);
    for (std::size_t i = 0; i < set.scores.size(); ++i) {
        root["results"][i]["scored"] = set.scores[i].scored;
        root["results"][i]["answered"] = set.scores[i].answered;
    }
    return root;
}

ordered_json table_json(const MatcherTableOptions& options, const Job& job,
                        const std::vector<SetScores>& sets, const std::vector<MatcherGroup>& groups) {
    ordered_json root = {{"suite", options.suite.string()}};
    for (const Condition& condition : job.conditions)
        root["conditions"].push_back(
            {{"name", condition.name}, {"what", condition.what}, {"repetitions", condition.repetitions}});
    for (const MatcherChoice& matcher : job.matchers)
        root["matchers"].push_back({{"name", matcher.name}, {"parameters", matcher.parameters}});
    root["opencv"] = cv::getVersionString();
    root["groups"] = ordered_json::array();
    for (const MatcherGroup& group : groups)
        root["groups"].push_back({{"name", group.name},
                                  {"sets", group.sets},
                                  {"frames", group.frames},
                                  {"disparities", {group.fewest_disparities, group.most_disparities}},
                                  {"weighed", group.pooled ? "pixels" : "sets"},
                                  {"scored", group.scored},
                                  {"results", results_json(job, group.figures)}});
    root["sets"] = ordered_json::array();
    for (const SetScores& set : sets)
        root["sets"].push_back(set_json(job, set));
    return root;
}

}  // namespace

std::uint64_t pair_number(std::string_view set, std::int64_t frame) {
    std::uint64_t number = 0xCBF29CE484222325U;  // FNV-1a
    for (const char letter : set)
        number = (number ^ static_cast<unsigned char>(letter)) * 0x100000001B3U;
    return number + static_cast<std::uint64_t>(frame);
}

MatcherFigures figures_of(const DisparityScore& score) {
    const std::int64_t absent = score.scored - score.answered;
    return {share(score.answered, score.scored), share(score.bad1, score.answered),
            share(score.bad3, score.answered), share(score.bad1 + absent, score.scored),
            share(score.bad3 + absent, score.scored)};
}

std::vector<MatcherGroup> grouped(const std::vector<SetScores>& sets) {
    std::vector<std::string> names;
    std::vector<std::vector<const SetScores*>> members;
    for (const SetScores& set : sets) {
        if (!set.problem.empty()) continue;
        const std::string name = set.name.substr(0, set.name.find('_'));
        const auto known = std::find(names.begin(), names.end(), name);
        if (known == names.end()) {
            names.push_back(name);
            members.emplace_back();
        }
        members[static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin())]
            .push_back(&set);
    }
    std::vector<MatcherGroup> groups;
    for (std::size_t i = 0; i < names.size(); ++i)
        groups.push_back(group_of(names[i], members[i]));
    return groups;
}

int run_matcher_table(const MatcherTableOptions& options) {
    const Job job{choose_conditions(options.conditions), choose_matchers(options.matchers),
                  options.disparities, stop_on_signals()};
    const std::vector<fs::path> folders = truth_sets(options.suite, options.sets);
    cv::setNumThreads(1);  // OpenCV's semi-global matcher answers differently with several
    std::vector<SetScores> sets;
    int status = 0;
    for (const fs::path& folder : folders) {
        show_step(sets.size(), folders.size(), folder.filename().string());
        try {
            sets.push_back(scores_of(job, folder));
        } catch (const Interrupted&) {
            status = static_cast<int>(ExitStatus::kInterrupted);
            break;
        }
        if (status == 0) status = sets.back().status;
    }
    show_step(folders.size(), folders.size(), {});
    const std::vector<MatcherGroup> groups = grouped(sets);
    if (options.json)
        fmt::print("{}\n", table_json(options, job, sets, groups).dump(2));
    else
        print_table(job, groups);
    std::fflush(stdout);
    if (sets.size() < folders.size())
        fmt::print(stderr, "groundline: interrupted with {} of {} done\n", sets.size(),
                   counted(folders.size(), "set"));
    for (const SetScores& set : sets) {
        if (!set.problem.empty()) fmt::print(stderr, "groundline: {}: {}\n", set.name, set.problem);
        for (const std::string& remark : set.remarks)
            fmt::print(stderr, "groundline: {}: {}\n", set.name, remark);
    }
    return status;
}

}  // namespace groundline::cli
