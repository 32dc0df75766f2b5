// `groundline evaluate`: how good a result is, as a table for people or as JSON for programs.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace groundline::cli {

struct EvaluateOptions {
    std::filesystem::path truth;  // one result against its truth ...
    std::filesystem::path out;
    std::filesystem::path suite;    // ... or, where not empty, every folder with truth in this one
    std::vector<std::string> sets;  // for a suite: names as truth_sets() takes them; empty: all
    bool json = false;
    // For a suite: the configuration of its replays.
    std::filesystem::path config;
    std::vector<std::string> set;
    // For a suite, instead of replays: every matcher by itself, see matcher_table.hpp.
    bool matchers = false;
    std::vector<std::string> matcher_names;  // empty: all
    std::vector<std::string> conditions;     // empty: all
    int disparities = 0;                     // 0: by the set
    // For a suite, instead of replays into folders: the terrain stage beside a baseline, see
    // terrain_table.hpp.
    bool terrain = false;
    int seeds = 0;    // 0: as many as usual
    int threads = 0;  // 0: one a processor
    // For a suite: runs the pairs of `source` into the new folder `out` and returns the exit status; may
    // throw Refusal.
    std::function<int(const std::filesystem::path& source, const std::filesystem::path& out)> replay;
};

// Declares the options of the subcommand and takes run_replay() for a suite. `options` must outlive `app`.
// Parsing throws CLI::ParseError for anything but TRUTH OUT or --suite DIR, and for options of one form with
// another.
void add_evaluate_options(CLI::App& app, EvaluateOptions& options);

// Prints to stdout; what is missing is also said on stderr. Returns 0; 66 where a frame could not be read; in
// a suite the first status that was not 0 (the other sets are still run), and 130 at once when a replay was
// interrupted; with matchers and terrain, what run_matcher_table() and run_terrain_table() return. Throws
// Refusal as evaluate_set(), truth_sets() and those do. The results of a suite live below the system's
// temporary folder and are removed.
int run_evaluate(const EvaluateOptions& options);

}  // namespace groundline::cli
