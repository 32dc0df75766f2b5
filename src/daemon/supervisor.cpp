#include "daemon/supervisor.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/signalfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <csignal>
#include <system_error>
#include <utility>

#include "core/clock.hpp"
#include "daemon/log.hpp"
#include "daemon/status.hpp"
#include "daemon/threads.hpp"

namespace groundline::daemon {
namespace {

constexpr std::int64_t kTickNs = 100'000'000;
constexpr std::int64_t kSecondNs = 1'000'000'000;
// Without a watchdog a thread that stands still is only named, after as long as the usual watchdog would
// take.
constexpr std::int64_t kStillNs = 5 * kSecondNs;

// A descriptor that closes itself.
class Descriptor {
  public:
    Descriptor(int descriptor, const char* what) : descriptor_(descriptor) {
        if (descriptor_ < 0) throw std::system_error(errno, std::generic_category(), what);
    }
    ~Descriptor() { ::close(descriptor_); }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    int get() const { return descriptor_; }

  private:
    int descriptor_;
};

sigset_t waited_signals() {
    sigset_t set;
    sigemptyset(&set);
    for (const int each : {SIGTERM, SIGINT, SIGHUP, SIGXCPU})
        sigaddset(&set, each);
    return set;
}

}  // namespace

Supervisor::Supervisor(const Watched& watched) : watched_(watched) {}

bool Supervisor::run(const std::function<bool()>& ready) {
    const sigset_t waited = waited_signals();
    const Descriptor signals(signalfd(-1, &waited, SFD_CLOEXEC | SFD_NONBLOCK), "cannot wait for signals");
    const Descriptor timer(timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK),
                           "cannot make a timer");
    const itimerspec every{{0, kTickNs}, {0, kTickNs}};
    timerfd_settime(timer.get(), 0, &every, nullptr);
    while (!watched_.pipeline_ended.load()) {
        pollfd events[] = {{signals.get(), POLLIN, 0}, {timer.get(), POLLIN, 0}};
        poll(events, 2, -1);
        signalfd_siginfo signal{};
        while (read(signals.get(), &signal, sizeof signal) == static_cast<ssize_t>(sizeof signal)) {
            if (signal.ssi_signo == SIGTERM || signal.ssi_signo == SIGINT) return true;
            if (signal.ssi_signo == SIGHUP) {
                if (ready_)
                    watched_.manager.tell(
                        fmt::format("RELOADING=1\nMONOTONIC_USEC={}", now_mono_ns() / 1000));
                watched_.reload();
                if (ready_) ready_ = watched_.manager.tell("READY=1");
            } else {
                watched_.real_time.give_up();
                log().warn(
                    "a real-time thread ran for {} s without a pause: real-time scheduling is given up",
                    RealTime::kLongestRunUs / 1'000'000);
            }
        }
        std::uint64_t ticks = 0;
        if (read(timer.get(), &ticks, sizeof ticks) != static_cast<ssize_t>(sizeof ticks)) continue;
        if (!ready_ && ready()) {
            for (const std::string& warning : watched_.real_time.warnings())
                log().warn("{}", warning);
            if (!std::exchange(said_ready_, true)) log().info("ready");
            ready_ = watched_.manager.tell("READY=1");
        }
        tick(now_mono_ns());
    }
    return false;
}

void Supervisor::tick(std::int64_t now_mono_ns) {
    if (host_mono_ns_ == 0 || now_mono_ns - host_mono_ns_ >= kSecondNs) {
        host_mono_ns_ = now_mono_ns;
        sensors_.read(host_);
    }
    host_.realtime_scheduling = watched_.real_time.scheduling() ? 1 : 0;
    host_.memory_locked = watched_.real_time.memory_locked() ? 1 : 0;
    look_at_cameras();
    look_at_attitudes(now_mono_ns);
    watched_.tracker.add(host_);
    const publish::HealthReport report = watched_.tracker.report(now_utime_us(), now_mono_ns);
    hand_over_health(report);
    watch(now_mono_ns);
    log_changes(report, now_mono_ns);
    tell_status(report, now_mono_ns);
}

void Supervisor::look_at_cameras() {
    if (watched_.cameras == nullptr) return;
    cameras_ = watched_.cameras->status();
    host_.exposure_difference_ms = cameras_.exposure_difference_ms;
    publish::CameraHealth health;
    health.state = cameras_.state;
    health.out_of_step = cameras_.out_of_step;
    health.skew_ms = cameras_.skew_ms;
    health.drift_ppm = cameras_.drift_ppm;
    health.left_mean = cameras_.mean[0];
    health.right_mean = cameras_.mean[1];
    health.left_saturated = cameras_.saturated_share[0];
    health.right_saturated = cameras_.saturated_share[1];
    cameras_.last_fault.view().copy(health.fault.data(), health.fault.size() - 1);
    watched_.tracker.add(health);
    watched_.cameras->take_notices([](const capture::CameraNotice& notice) {
        log().log(notice.good ? spdlog::level::info : spdlog::level::warn, "{}", notice.sentence.view());
    });
}

void Supervisor::look_at_attitudes(std::int64_t now_mono_ns) {
    if (!watched_.attitude_input) return;
    const std::uint64_t taken = watched_.counters.get(Count::kAttitudesTaken);
    if (taken != attitudes_ || attitude_mono_ns_ == 0) {
        attitudes_ = taken;
        attitude_mono_ns_ = now_mono_ns;
        if (taken > 0 && std::exchange(attitudes_missing_, false)) log().info("attitudes come");
    } else if (now_mono_ns - attitude_mono_ns_ >= kSecondNs && !std::exchange(attitudes_missing_, true)) {
        log().warn(
            "no attitudes for 1 s that could be used: steps of the ground that the robot makes count as "
            "errors");
    }
}

void Supervisor::hand_over_health(const publish::HealthReport& report) {
    *reports_.begin_write() = report;
    if (reports_.commit()) watched_.counters.add(Count::kHealthOverwritten);
}

void Supervisor::watch(std::int64_t now_mono_ns) {
    const std::int64_t limit_ns = watched_.manager.watchdog_ns();
    const Counters& counters = watched_.counters;
    verdict::Progress progress;
    progress.capture_turns = watched_.pipeline.capture_turns();
    progress.captured = counters.get(Count::kFramesRead);
    progress.capture_lost = counters.get(Count::kFramesOverwritten);
    progress.processed = counters.get(Count::kFramesProcessed);
    progress.results_lost = counters.get(Count::kResultsOverwritten);
    progress.delivered = counters.get(Count::kResultsDelivered);
    progress.health_beats = health_beats_.load();
    progress.in_device_call = watched_.cameras != nullptr && watched_.cameras->in_device_call();
    progress.thread_stopped = a_thread_is_stopped();
    const verdict::Liveness look =
        verdict::judge_liveness(progress, liveness_, now_mono_ns, limit_ns > 0 ? limit_ns / 2 : kStillNs);
    liveness_ = look.state;
    if (look.stuck != stuck_) {
        if (look.stuck == verdict::Stuck::kNone)
            log().warn("every thread moves again");
        else
            log().error("the thread for {} has not moved for {:.1f} s",
                        verdict::kStuckNames[static_cast<std::size_t>(look.stuck)],
                        static_cast<double>(look.still_ns) / 1e9);
        stuck_ = look.stuck;
    }
    if (limit_ns == 0) return;
    if (look.stuck == verdict::Stuck::kNone) {
        // The tick before half the time is up, so that none comes after it.
        if (fed_mono_ns_ != 0 && now_mono_ns - fed_mono_ns_ < limit_ns / 2 - kTickNs) return;
        if (watched_.manager.tell("WATCHDOG=1")) fed_mono_ns_ = now_mono_ns;
    } else if (!triggered_ && look.still_ns >= limit_ns - 2 * kTickNs) {
        // Else the manager would count from the last feeding, up to half a limit later.
        triggered_ = watched_.manager.tell("WATCHDOG=trigger");
    }
}

void Supervisor::log_changes(const publish::HealthReport& report, std::int64_t now_mono_ns) {
    using publish::LifeState;
    if (report.state != logged_state_ && now_mono_ns - state_mono_ns_ >= kSecondNs) {
        if (report.state == LifeState::kRunning)
            log().info("pairs come");
        else
            log().warn("{}", status_of(report));
        logged_state_ = report.state;
        state_mono_ns_ = now_mono_ns;
    }
    const std::string verdict = verdict_of(report);
    if (report.state == LifeState::kRunning && verdict != logged_verdict_ &&
        now_mono_ns - verdict_mono_ns_ >= kSecondNs) {
        log().log(report.verdict == Verdict::kTrusted ? spdlog::level::info : spdlog::level::warn,
                  "verdict: {}", verdict);
        logged_verdict_ = verdict;
        verdict_mono_ns_ = now_mono_ns;
    }
    const std::uint64_t bad = watched_.counters.get(Count::kFramesBad);
    if (bad != logged_bad_ && (logged_bad_ == 0 || now_mono_ns - bad_mono_ns_ >= 60 * kSecondNs)) {
        log().warn("{} pairs so far could not be read and are left out", bad);
        logged_bad_ = bad;
        bad_mono_ns_ = now_mono_ns;
    }
    const std::size_t lost = lost_lines();
    if (lost != logged_lost_ && now_mono_ns - lost_mono_ns_ >= kSecondNs) {
        logged_lost_ = lost;
        lost_mono_ns_ = now_mono_ns;
        log().warn("{} lines of this log so far were lost, because nobody took them in time", lost);
    }
}

void Supervisor::tell_status(const publish::HealthReport& report, std::int64_t now_mono_ns) {
    if (status_mono_ns_ != 0 && now_mono_ns - status_mono_ns_ < kSecondNs) return;
    std::string status = status_of(report);
    // Why there are none, as long as there are none.
    const bool none =
        report.state == publish::LifeState::kStarting || report.state == publish::LifeState::kStalled;
    if (watched_.cameras != nullptr && !cameras_.last_fault.empty() && !cameras_.out_of_step &&
        (none || cameras_.state != verdict::CameraState::kRunning))
        status += fmt::format(": {}", cameras_.last_fault.view());
    if (status == status_) return;
    if (!watched_.manager.tell("STATUS=" + status)) return;
    status_ = std::move(status);
    status_mono_ns_ = now_mono_ns;
}

void Supervisor::send_health() {
    bool failing = false;
    while (const publish::HealthReport* report = reports_.take()) {
        const bool sent = watched_.health.publish(*report);
        ++health_beats_;
        if (sent == !failing) continue;
        failing = !sent;
        if (failing)
            log().warn("{}", watched_.health.error());
        else
            log().info("LCM takes messages");
    }
}

void Supervisor::end_health() {
    watched_.tracker.stop();
    hand_over_health(watched_.tracker.report(now_utime_us(), now_mono_ns()));
    reports_.end_of_stream();
}

}  // namespace groundline::daemon
