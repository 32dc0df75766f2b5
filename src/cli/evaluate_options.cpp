#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include "cli/evaluate_command.hpp"
#include "cli/replay_command.hpp"

namespace groundline::cli {
namespace {

// The words between commas; empty ones are left out.
std::vector<std::string> words_of(const std::string& list) {
    std::vector<std::string> words;
    for (std::size_t start = 0; start <= list.size();) {
        const std::size_t end = std::min(list.find(',', start), list.size());
        if (end > start) words.push_back(list.substr(start, end - start));
        start = end + 1;
    }
    return words;
}

const CLI::Validator kNotEmpty(
    [](std::string& list) { return words_of(list).empty() ? std::string("expected a name") : std::string(); },
    "NAME,...");

const CLI::Validator kDisparities(
    [](std::string& word) {
        const int value = std::atoi(word.c_str());
        const bool fits = std::to_string(value) == word && value >= 16 && value <= 256 && value % 16 == 0;
        return fits ? std::string() : fmt::format("{} is not a multiple of 16 from 16 to 256", word);
    },
    "MULTIPLE OF 16");

}  // namespace

void add_evaluate_options(CLI::App& app, EvaluateOptions& options) {
    app.add_option("truth", options.truth,
                   "Folder with disp.png or disp/ and, where known, class/ and height/");
    app.add_option("out", options.out, "Folder that groundline replay --out wrote");
    app.add_option("--suite", options.suite, "Replay and compare every folder with truth in this one");
    app.add_flag("--json", options.json, "Print JSON instead of a table");
    app.add_option("--config", options.config, "Configuration file for the replays of --suite");
    app.add_option("--set", options.set, "One key=value for the replays of --suite; may be given again")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    app.add_option_function<std::string>(
           "--sets", [&options](const std::string& list) { options.sets = words_of(list); },
           "Of --suite only these, comma between: beginnings of names, or patterns with * ? [")
        ->check(kNotEmpty);
    CLI::Option* matchers =
        app.add_option_function<std::string>(
               "--matchers", [&options](const std::string& list) { options.matcher_names = words_of(list); },
               "With --suite: no replays, but a table of these matchers by themselves, ours and OpenCV's, "
               "comma between; all if none is named")
            ->expected(0, 1);
    CLI::Option* conditions =
        app.add_option_function<std::string>(
               "--conditions", [&options](const std::string& list) { options.conditions = words_of(list); },
               "With --matchers: only these of clean, gain, noise, shift, blur, comma between")
            ->check(kNotEmpty);
    CLI::Option* disparities =
        app.add_option("--disparities", options.disparities,
                       "With --matchers: search this many, a multiple of 16 from 16 to 256; default: what a "
                       "replay takes for each set")
            ->check(kDisparities);
    CLI::Option* terrain = app.add_flag(
        "--terrain", options.terrain,
        "With --suite: judge the terrain stage in this process, beside a baseline. The suite is a folder, or "
        "rendered: synthetic: (all scenes), synthetic:SCENE,..., synthetic:ditches, synthetic:free, "
        "synthetic:never");
    CLI::Option* seeds =
        app.add_option(
               "--seeds", options.seeds,
               "With a rendered suite: seeds of each scene; default 20, ditches 200, free 1000 in all")
            ->check(CLI::Range(1, 1000000));
    CLI::Option* threads =
        app.add_option("--threads", options.threads,
                       "With --terrain: threads that share the frames; default: one a processor")
            ->check(CLI::Range(1, 256));
    app.callback([&options, terrain, seeds, threads, matchers, conditions, disparities] {
        options.matchers = matchers->count() > 0;
        const bool pair = !options.truth.empty() && !options.out.empty();
        const bool any = !options.truth.empty() || !options.out.empty();
        if (options.suite.empty() ? !pair : any)
            throw CLI::ValidationError("evaluate", "expected either TRUTH OUT or --suite DIR");
        if (options.suite.empty() && (!options.config.empty() || !options.set.empty()))
            throw CLI::ValidationError("evaluate", "--config and --set are for --suite, which replays");
        if (options.suite.empty() && (options.matchers || !options.sets.empty()))
            throw CLI::ValidationError("evaluate", "--matchers and --sets are for --suite");
        if (options.matchers && (!options.config.empty() || !options.set.empty()))
            throw CLI::ValidationError("evaluate",
                                       "--config and --set are for replays, which --matchers leaves out");
        const bool rendered = options.suite.string().starts_with("synthetic:");
        if (terrain->count() > 0 && (options.suite.empty() || options.matchers))
            throw CLI::ValidationError("evaluate", "--terrain is for --suite, without --matchers");
        if (terrain->count() == 0 && (rendered || threads->count() > 0))
            throw CLI::ValidationError("evaluate", "--suite synthetic: and --threads are for --terrain");
        if (!rendered && seeds->count() > 0)
            throw CLI::ValidationError("evaluate", "--seeds is for --suite synthetic:");
        if (!options.matchers && (conditions->count() > 0 || disparities->count() > 0))
            throw CLI::ValidationError("evaluate", "--conditions and --disparities are for --matchers");
    });
    options.replay = [&options](const std::filesystem::path& source, const std::filesystem::path& out) {
        ReplayOptions replay;
        replay.source = {source.string()};
        replay.config = options.config;
        replay.set = options.set;
        replay.out = out;
        replay.quiet = true;
        return run_replay(replay);
    };
}

}  // namespace groundline::cli
