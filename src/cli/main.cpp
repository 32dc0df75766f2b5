// The program `groundline`: subcommands for people.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <new>

#include "cli/evaluate_command.hpp"
#include "cli/replay_command.hpp"
#include "cli/synth_command.hpp"
#include "core/error.hpp"
#include "settings/settings.hpp"
#include "synth/scene.hpp"

namespace {

using groundline::ExitStatus;
using groundline::Refusal;

int fail(ExitStatus status, const char* sentence) {
    std::fprintf(stderr, "groundline: %s\n", sentence);
    return static_cast<int>(status);
}

// Parses the command line and runs the chosen subcommand.
int run(int argc, char** argv) {
    using namespace groundline::cli;
    CLI::App app{
        "Finds the ground line in the v-disparity image of a stereo pair and marks what a robot must "
        "not drive into or over."};
    app.name("groundline");
    app.set_version_flag("--version", GROUNDLINE_VERSION);
    app.require_subcommand(1);
    app.footer(
        "Exit status: 0 done, 1 failed, 2 misuse, 66 input missing or unreadable, 78 configuration or\n"
        "calibration refused, 130 ended by Ctrl-C.");

    ReplayOptions replay;
    CLI::App* replay_app =
        app.add_subcommand("replay", "Run recorded or rendered pairs through the pipeline");
    replay_app
        ->add_option("source", replay.source,
                     "Folder of pairs, side-by-side video, synthetic:SCENE, or a left and a right image")
        ->required()
        ->expected(1, 2);
    replay_app->add_option("--calibration", replay.calibration, "Calibration file, or two, comma between")
        ->delimiter(',')
        ->expected(1);
    replay_app->add_option("--config", replay.config, "Configuration file");
    replay_app->add_option("--set", replay.set, "One key=value; may be given again")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    replay_app->add_option("--out", replay.out,
                           "Folder for pictures and tables: empty, new or an earlier result");
    replay_app->add_option("--rate", replay.rate, "max (lossless), realtime, or pairs a second")
        ->capture_default_str();
    replay_app->add_option("--frames", replay.frames, "Stop after this many pairs")
        ->check(CLI::PositiveNumber);
    replay_app
        ->add_option("--threads", replay.threads, "Threads that share a frame; default: one a processor")
        ->check(CLI::Range(1, 256));
    replay_app->add_option("--lcm-url", replay.lcm_url,
                           "Publish over LCM, e.g. udpm://239.255.76.67:7667?ttl=0");
    replay_app->add_flag("--loop", replay.loop, "Start again at the end, until Ctrl-C");
    replay_app->add_flag("--quiet", replay.quiet, "Print errors only");

    EvaluateOptions evaluate;
    CLI::App* evaluate_app = app.add_subcommand("evaluate", "Compare results with truth");
    add_evaluate_options(*evaluate_app, evaluate);

    SynthOptions synth;
    CLI::App* synth_app = app.add_subcommand("synth", "Write a rendered scene with its exact truth");
    synth_app->add_option("scene", synth.spec, "NAME[?seed=N&key=value...]")->required();
    synth_app->footer(groundline::synth::scene_help());
    synth_app->add_option("--frames", synth.frames, "Pairs to write; default: the scene's own number")
        ->check(CLI::PositiveNumber);
    synth_app->add_option("--out", synth.out, "Folder to write: empty or new")->required();
    synth_app->add_option("--tolerance-m", synth.tolerance_m, "Height and depth still traversable in class/")
        ->check(CLI::Range(0.01, 10.0))
        ->capture_default_str();

    app.add_subcommand("config", "Print a sample configuration: every key at its default");

    try {
        app.parse(argc, argv);
    } catch (const CLI::Success& help) {
        return app.exit(help);
    } catch (const CLI::ParseError& misuse) {
        fmt::print(stderr, "groundline: {}; see groundline --help\n", misuse.what());
        return static_cast<int>(ExitStatus::kUsage);
    }
    replay.lcm = replay_app->count("--lcm-url") > 0;
    if (replay_app->parsed()) return run_replay(replay);
    if (evaluate_app->parsed()) return run_evaluate(evaluate);
    if (synth_app->parsed()) return run_synth(synth);
    fmt::print("{}", groundline::settings::sample_file());  // config, the only one left
    return static_cast<int>(ExitStatus::kDone);
}

}  // namespace

int main(int argc, char** argv) {
    try {
        return run(argc, argv);
    } catch (const Refusal& refusal) {
        return fail(refusal.status(), refusal.what());
    } catch (const std::bad_alloc&) {
        return fail(ExitStatus::kFailed, "not enough memory for pictures of this size");
    } catch (const std::exception& failure) {
        return fail(ExitStatus::kFailed, failure.what());
    }
}
