#include "cli/replay_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "capture/open.hpp"
#include "cli/interrupt.hpp"
#include "cli/progress.hpp"
#include "cli/run_report.hpp"
#include "core/clock.hpp"
#include "core/error.hpp"
#include "io/result_writer.hpp"
#include "pipeline/worker_pool.hpp"
#include "publish/lcm_publisher.hpp"
#include "setup/run_setup.hpp"

namespace groundline::cli {
namespace {

pipeline::RunOptions run_options(const ReplayOptions& options) {
    pipeline::RunOptions run;
    run.frames = options.frames;
    run.loop = options.loop;
    if (options.rate == "max") return run;
    if (options.rate == "realtime") {
        run.pace = pipeline::Pace::kStamps;
        return run;
    }
    run.pace = pipeline::Pace::kFixed;
    std::size_t used = 0;
    try {
        run.rate_hz = std::stod(options.rate, &used);
    } catch (const std::exception&) {
        used = 0;
    }
    if (used != options.rate.size() || !(run.rate_hz >= 0.001 && run.rate_hz <= 10000.0))
        throw Refusal(ExitStatus::kUsage,
                      fmt::format("--rate {}: expected max, realtime, or pairs a second from 0.001 to 10000",
                                  options.rate));
    return run;
}

// The worst that happened decides; each failure is also said.
ExitStatus status_of(const pipeline::RunReport& report, const Counters& counters) {
    ExitStatus status = counters.get(Count::kFramesBad) > 0 ? ExitStatus::kInput : ExitStatus::kDone;
    if (!report.source_error.empty()) {
        fmt::print(stderr, "groundline: {}\n", report.source_error);
        status = ExitStatus::kInput;
    }
    if (report.interrupted) status = ExitStatus::kInterrupted;
    if (!report.sink_error.empty()) {
        fmt::print(stderr, "groundline: {}\n", report.sink_error);
        status = ExitStatus::kFailed;
    }
    return status;
}

}  // namespace

int run_replay(const ReplayOptions& options) {
    if (options.out && options.out->empty())
        throw Refusal(ExitStatus::kUsage, "--out '': expected the name of a folder");
    if (options.loop && options.out)
        throw Refusal(ExitStatus::kUsage,
                      "--loop with --out would write the same files for ever: leave one of them out");
    const pipeline::RunOptions run = run_options(options);
    settings::Settings settings = setup::load_settings(options.config, options.set);
    if (options.lcm) settings.publish.url = options.lcm_url;
    capture::OpenedSource opened = capture::open_source(options.source);
    FrameSource& source = *opened.source;
    const SourceInfo& info = source.info();
    const std::optional<rig::StereoCalibration> calibration =
        setup::load_calibration(options.calibration, opened);
    setup::choose_disparities(info.width, calibration ? calibration->disparities_hint : 0, settings);

    // Everything that can be refused is set up before anything is written or printed.
    Arena arena;
    Counters counters;
    const rig::Rectifier rectifier = calibration
                                         ? rig::Rectifier(*calibration, info.width, info.height, arena)
                                         : rig::Rectifier(info.width, info.height);
    std::optional<io::ResultWriter> writer;
    if (options.out) writer.emplace(*options.out, counters);
    const int processors = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
    pipeline::WorkerPool pool(options.threads > 0 ? options.threads : processors);
    pipeline::Processor processor(
        setup::processor_config(settings, info, info.colour && writer.has_value(), arena), rectifier, pool,
        arena);
    RunStatistics statistics;
    std::vector<pipeline::SinkSlot> sinks{{&statistics, std::nullopt, true}};
    std::optional<publish::LcmPublisher> publisher;
    if (options.lcm) {
        publisher.emplace(setup::lcm_options(settings, counters));
        sinks.push_back({&*publisher, Stage::kPublish, false});
    }
    if (writer) sinks.push_back({&*writer, Stage::kWrite, true});
    const bool lossless = run.pace == pipeline::Pace::kMax && !info.live;
    pipeline::Pipeline pipeline(source, processor, sinks, lossless, arena, counters);
    arena.seal();

    const RunFacts facts{info, calibration, rectifier.rig(), settings, pool.lanes()};
    if (!options.quiet) print_start(facts);
    if (!opened.note.empty()) fmt::print(stderr, "groundline: {}\n", opened.note);
    for (const std::string& warning : rectifier.warnings())
        fmt::print(stderr, "groundline: {}\n", warning);
    if (publisher && !publisher->tick()) fmt::print(stderr, "groundline: {}\n", publisher->error());
    nlohmann::ordered_json summary = summary_of(facts);
    if (writer) writer->begin(summary);

    const std::atomic<bool>& stop = stop_on_signals();
    const auto report = std::make_unique<pipeline::RunReport>();
    const std::int64_t begin_ns = now_mono_ns();
    {
        std::optional<Progress> progress;
        if (!options.quiet) progress.emplace(counters, options.frames >= 0 ? options.frames : info.length);
        const auto say_bad = [](const FrameStamp& stamp, const std::string& sentence) {
            fmt::print(stderr, "groundline: pair {} left out: {}\n", stamp.position, sentence);
        };
        pipeline.run(run, stop, say_bad, *report);
    }
    const RunFindings findings{statistics, counters, *report, arena.bytes(),
                               static_cast<double>(now_mono_ns() - begin_ns) * 1e-9};
    const ExitStatus status = status_of(*report, counters);
    if (publisher) {
        publisher->stop();
        if (publisher->lost() > 0)
            fmt::print(stderr, "groundline: {} of {} messages were not published: {}\n", publisher->lost(),
                       publisher->lost() + publisher->sent(), publisher->error());
    }
    if (writer) {
        // A paced run skips what it is too slow for: what is written is right, but not all.
        const bool all =
            counters.get(Count::kFramesOverwritten) + counters.get(Count::kResultsOverwritten) == 0;
        add_findings(summary, findings);
        writer->finish(summary, status == ExitStatus::kDone && all);
    }
    if (!options.quiet) {
        print_end(findings);
        if (writer) fmt::print("written      {}\n", options.out->string());
    }
    return static_cast<int>(status);
}

}  // namespace groundline::cli
