#include "daemon/daemon.hpp"

#include <fmt/format.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <optional>
#include <thread>
#include <utility>

#include "core/arena.hpp"
#include "core/counters.hpp"
#include "daemon/driver.hpp"
#include "daemon/log.hpp"
#include "daemon/realtime.hpp"
#include "daemon/service_manager.hpp"
#include "daemon/supervisor.hpp"
#include "pipeline/worker_pool.hpp"
#include "publish/attitude_receiver.hpp"
#include "publish/health_publisher.hpp"
#include "publish/lcm_link.hpp"
#include "publish/lcm_publisher.hpp"
#include "setup/run_setup.hpp"

namespace groundline::daemon {
namespace {

using std::chrono::milliseconds;

// SIGTERM promises the end within a second; what is left after waiting is for the log and the destructors.
constexpr milliseconds kPatience{600};
constexpr suseconds_t kDeadlineUs = 900'000;
constexpr int kAttitudeWaitMs = 100;

settings::Settings read_settings(const DaemonOptions& options) {
    const bool read = options.config_named || std::filesystem::exists(options.config);
    return setup::load_settings(read ? options.config : std::filesystem::path(), options.set);
}

// Results and health go out on two connections, which two programs' worth of LCM understands but a file or
// memory does not. LCM's TCP waits without limit for a server that accepts and does not answer, and a thread
// that waits there would be taken for one that is stuck.
publish::LcmOptions lcm_options(const settings::Settings& settings, Counters& counters,
                                publish::HealthTracker* tracker = nullptr) {
    publish::LcmOptions options = setup::lcm_options(settings, counters);
    const std::string url = publish::resolve_url(options.url);
    if (url.starts_with("file:") || url.starts_with("memq:"))
        throw Refusal(ExitStatus::kConfig,
                      fmt::format("publish.url: '{}' cannot be shared by the two connections "
                                  "of this program; use udpm://, and lcm-logger for files",
                                  url));
    if (url.starts_with("tcpq:"))
        throw Refusal(ExitStatus::kConfig,
                      fmt::format("publish.url: '{}' would hold this program up for as long as its server "
                                  "does not answer; use udpm://, which waits for nobody",
                                  url));
    options.channels.health = false;  // sent by the supervisor
    options.tracker = tracker;
    return options;
}

pipeline::Tuning tuning_of(const settings::Settings& settings) {
    return {settings::terrain_config(settings), settings::verdict_limits(settings)};
}

int lanes_of(const settings::Settings& settings) {
    const int processors = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
    return settings.process.threads > 0 ? settings.process.threads : processors;
}

// Slow cameras are not silent between two pictures; the rest has the publisher's own limit.
std::int64_t stale_after_ns(const SourceInfo& info) {
    const std::int64_t least_ns = publish::LcmOptions().stale_after_ns;
    if (!info.live || info.rate_hz <= 0.0) return least_ns;
    return std::max(least_ns, static_cast<std::int64_t>(5e9 / info.rate_hz));
}

settings::Settings with_disparities(settings::Settings settings, const SourceInfo& info,
                                    const std::optional<rig::StereoCalibration>& calibration) {
    setup::choose_disparities(info.width, calibration ? calibration->disparities_hint : 0, settings);
    return settings;
}

pipeline::ProcessorConfig processor_config(const settings::Settings& settings, const SourceInfo& info,
                                           Arena& arena) {
    pipeline::ProcessorConfig config = setup::processor_config(settings, info, false, arena);
    config.half_resolution = settings.overload.half_resolution;
    return config;
}

// Everything with its memory, in the order it is needed; nothing moves yet but the workers that wait.
struct Parts {
    explicit Parts(const settings::Settings& wanted)
        : driver(open_driver(wanted, counters)),
          calibration(setup::load_calibration(calibration_files(wanted.capture), driver.opened)),
          settings(with_disparities(wanted, info(), calibration)),
          rectifier(calibration ? rig::Rectifier(*calibration, info().width, info().height, arena)
                                : rig::Rectifier(info().width, info().height)),
          real_time(settings.realtime),
          pool(lanes_of(settings), [this] { real_time.adopt(pipeline::ThreadRole::kProcessing); }),
          processor(processor_config(settings, info(), arena), rectifier, pool, arena),
          tracker(&counters, stale_after_ns(info())),
          publisher(lcm_options(settings, counters, &tracker)),
          health(lcm_options(settings, counters)),
          attitude_receiver(lcm_options(settings, counters), attitudes),
          sinks{{{&publisher, Stage::kPublish, false}}},
          running(*driver.opened.source, processor, sinks, false, arena, counters) {
        arena.seal();
    }

    // Before any thread runs: from then on the settings are the supervisor's.
    pipeline::RunOptions run_options() {
        pipeline::RunOptions options;
        options.rest = settings.realtime.on;
        if (!info().live) {
            options.pace = pipeline::Pace::kStamps;
            options.stamp_when_due = true;
            options.loop = settings.capture.loop;
        }
        if (settings.attitude.input) {
            options.attitude = &attitudes;
            options.attitude_max_gap_ns = static_cast<std::int64_t>(1e6 * settings.attitude.max_gap_ms);
        }
        options.on_thread = [this](pipeline::ThreadRole role) {
            // A renderer is no camera: it may take all the time there is, and more.
            if (role != pipeline::ThreadRole::kCapture || !driver.opened.rig) real_time.adopt(role);
            ++threads;
        };
        return options;
    }

    // The pipeline's run; on a thread of its own, which becomes the capture thread.
    void run(const pipeline::RunOptions& options, const std::atomic<bool>& stop) {
        // Counted by the pipeline; the supervisor says so.
        running.run(
            options, stop, [](const FrameStamp&, const std::string&) {}, report);
    }

    // On a thread of its own, where attitude.input is on.
    void receive_attitudes(const std::atomic<bool>& stop) {
        while (!stop.load())
            attitude_receiver.receive(kAttitudeWaitMs);
    }

    // Reads the configuration again and takes over what a running pipeline can.
    void reload(const DaemonOptions& options) {
        settings::Reload change;
        try {
            change = settings::reload(settings, read_settings(options));
            running.tune(tuning_of(change.settings));
        } catch (const std::exception& fault) {  // a Refusal, or a path that cannot even be looked at
            log().error("the new configuration is refused, the old one stays in force: {}", fault.what());
            return;
        }
        settings = change.settings;
        publisher.show(settings.publish.v_disparity, settings.publish.preview);
        log().info("configuration read again; taken over: {}",
                   change.taken.empty() ? "nothing new" : fmt::format("{}", fmt::join(change.taken, ", ")));
        if (!change.need_restart.empty())
            log().warn("these changes need a restart: {}", fmt::join(change.need_restart, ", "));
    }

    void introduce() const {
        const RectifiedRig& rig = rectifier.rig();
        log().info("source {}: {}x{}", info().name, info().width, info().height);
        if (!driver.opened.note.empty()) log().warn("{}", driver.opened.note);
        if (calibration)
            log().info("calibration {} ({}): f {:.2f} px, baseline {:.4f} m", calibration->source,
                       calibration->format, rig.focal_px, rig.baseline_m);
        else
            log().warn("no calibration: the pair is taken as rectified, the verdict is degraded at best");
        for (const std::string& warning : rectifier.warnings())
            log().warn("{}", warning);
        log().info("matching {} disparities on {} threads, {:.0f} MB for frames, LCM at {}",
                   settings.matcher.disparities, pool.lanes(), static_cast<double>(arena.bytes()) / 1e6,
                   publisher.url());
    }

    const SourceInfo& info() const { return driver.opened.source->info(); }

    Counters counters;
    Arena arena;
    OpenedDriver driver;
    std::optional<rig::StereoCalibration> calibration;
    settings::Settings settings;
    rig::Rectifier rectifier;
    RealTime real_time;
    pipeline::WorkerPool pool;
    pipeline::Processor processor;
    publish::HealthTracker tracker;
    publish::LcmPublisher publisher;
    publish::HealthPublisher health;
    pipeline::AttitudeHandOver attitudes{{}};
    publish::AttitudeReceiver attitude_receiver;
    std::array<pipeline::SinkSlot, 1> sinks;
    pipeline::Pipeline running;
    pipeline::RunReport report;
    std::atomic<int> threads{0};  // of the pipeline, that have begun
};

// Waits until `done`, at most kPatience.
bool wait_for(const std::atomic<bool>& done) {
    for (milliseconds waited{0}; waited < kPatience && !done.load(); waited += milliseconds(5))
        std::this_thread::sleep_for(milliseconds(5));
    return done.load();
}

// From now on the program ends in time, with that status, whatever hangs: a camera, the network, the journal.
void arm_deadline(ExitStatus status) {
    static std::atomic<int> known{0};
    static_assert(std::atomic<int>::is_always_lock_free);
    known = static_cast<int>(status);
    struct sigaction action {};
    action.sa_handler = [](int) { _exit(known.load()); };
    sigaction(SIGALRM, &action, nullptr);
    const itimerval once{{0, 0}, {0, kDeadlineUs}};
    setitimer(ITIMER_REAL, &once, nullptr);
}

void block(std::initializer_list<int> signals) {
    sigset_t set;
    sigemptyset(&set);
    for (const int each : signals)
        sigaddset(&set, each);
    pthread_sigmask(SIG_BLOCK, &set, nullptr);
}

std::atomic<bool> supervised{false};
pthread_t supervising;  // the main thread, once it blocks the signals it waits for

void on_end_signal(int number) {
    if (!supervised.load()) _exit(static_cast<int>(ExitStatus::kDone));
    // A library's thread from before they were blocked got it.
    pthread_kill(supervising, number);
}

// This thread and those it starts leave the end of the program to the supervisor from now on.
void begin_supervision() {
    block({SIGTERM, SIGINT});
    supervising = pthread_self();
    supervised = true;
}

}  // namespace

void prepare_signals() {
    block({SIGHUP, SIGXCPU});
    struct sigaction action {};
    action.sa_handler = on_end_signal;
    action.sa_flags = SA_RESTART;
    for (const int each : {SIGTERM, SIGINT})
        sigaction(each, &action, nullptr);
    signal(SIGPIPE, SIG_IGN);
}

std::string configured_loopback_group(const DaemonOptions& options) {
    return publish::loopback_group(publish::resolve_url(read_settings(options).publish.url));
}

ExitStatus run_daemon(const DaemonOptions& options) {
    ServiceManager manager;
    if (!options.config_named && !std::filesystem::exists(options.config))
        say(5, fmt::format("{} does not exist: every key has its default", options.config.string()));
    const auto parts = std::make_unique<Parts>(read_settings(options));
    if (options.check_only) {
        fmt::print("{}: the configuration is good\n", options.config.string());
        return ExitStatus::kDone;
    }
    begin_supervision();
    parts->introduce();

    std::atomic<bool> stop{false};
    std::string failure;  // of the pipeline's start; written before pipeline_ended, like the report
    std::atomic<bool> pipeline_ended{false};
    std::atomic<bool> health_ended{false};
    const bool attitude_input = parts->settings.attitude.input;
    std::atomic<bool> attitude_ended{!attitude_input};
    const pipeline::RunOptions run_options = parts->run_options();
    Supervisor supervisor({parts->running, parts->counters, parts->tracker, parts->health, manager,
                           parts->real_time, parts->driver.cameras, attitude_input, pipeline_ended,
                           [&] { parts->reload(options); }});
    std::jthread health;
    std::jthread attitude;
    std::jthread pipeline;
    // Whatever leaves this function, no thread may be waited for that was not told to end.
    struct EndThreads {
        std::atomic<bool>& stop;
        Supervisor& supervisor;
        bool told = false;
        void operator()() {
            if (std::exchange(told, true)) return;
            stop = true;
            supervisor.end_health();
        }
        ~EndThreads() {
            if (!told) arm_deadline(ExitStatus::kFailed);
            (*this)();
        }
    } end_threads{stop, supervisor};
    health = std::jthread([&] {
        pthread_setname_np(pthread_self(), "gl-health");
        supervisor.send_health();
        health_ended = true;
    });
    if (attitude_input)
        attitude = std::jthread([&] {
            pthread_setname_np(pthread_self(), "gl-attitude");
            parts->receive_attitudes(stop);
            attitude_ended = true;
        });
    pipeline = std::jthread([&] {
        try {
            parts->run(run_options, stop);
        } catch (const std::exception& fault) {
            failure = fault.what();  // no more threads, say
        }
        pipeline_ended = true;
    });
    bool locked = false;
    const bool told_to_stop = supervisor.run([&] {
        if (parts->threads.load() < 3) return false;
        if (!std::exchange(locked, true)) parts->real_time.lock_memory();
        return true;
    });

    const auto status_so_far = [&] {
        if (!pipeline_ended) return ExitStatus::kDone;
        if (!failure.empty()) return ExitStatus::kFailed;
        return told_to_stop || parts->report.source_error.empty() ? ExitStatus::kDone : ExitStatus::kInput;
    };
    manager.tell("STOPPING=1\nSTATUS=stopping");
    arm_deadline(status_so_far());
    end_threads();
    const bool ended = wait_for(pipeline_ended) && wait_for(health_ended) && wait_for(attitude_ended);
    if (!ended)
        log().warn("a camera or the network does not let go: the program ends without waiting for it");
    const ExitStatus status = status_so_far();
    if (status == ExitStatus::kInput) log().error("{}", parts->report.source_error);
    if (status == ExitStatus::kFailed) log().error("{}", failure);
    log().info("ended");
    close_log();
    // Threads that hang can neither be joined nor outlive what they use.
    if (!ended) _exit(static_cast<int>(status));
    return status;
}

}  // namespace groundline::daemon
