#include <CLI/CLI.hpp>

#include "cli/evaluate_command.hpp"
#include "cli/replay_command.hpp"

namespace groundline::cli {

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
    app.callback([&options] {
        const bool pair = !options.truth.empty() && !options.out.empty();
        const bool any = !options.truth.empty() || !options.out.empty();
        if (options.suite.empty() ? !pair : any)
            throw CLI::ValidationError("evaluate", "expected either TRUTH OUT or --suite DIR");
        if (options.suite.empty() && (!options.config.empty() || !options.set.empty()))
            throw CLI::ValidationError("evaluate", "--config and --set are for --suite, which replays");
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
