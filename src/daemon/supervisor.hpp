// Watches over the running pipeline: signals, watchdog, health, what the log says of changes.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include "capture/camera_source.hpp"
#include "core/counters.hpp"
#include "daemon/host_health.hpp"
#include "daemon/realtime.hpp"
#include "daemon/service_manager.hpp"
#include "pipeline/pipeline.hpp"
#include "pipeline/triple_buffer.hpp"
#include "publish/health.hpp"
#include "publish/health_publisher.hpp"
#include "verdict/liveness.hpp"

namespace groundline::daemon {

// What the supervisor looks at and acts on; borrowed.
struct Watched {
    const pipeline::Pipeline& pipeline;
    Counters& counters;
    publish::HealthTracker& tracker;
    publish::HealthPublisher& health;
    ServiceManager& manager;
    RealTime& real_time;
    capture::CameraSource* cameras;  // null where pairs do not come from live cameras
    bool attitude_input;             // attitudes are received
    const std::atomic<bool>& pipeline_ended;
    // Reads the configuration again; says in the log what came of it.
    std::function<void()> reload;
};

// Every 100 ms: health is handed to the thread that sends it, the watchdog is fed if every thread moves, and
// changes are logged, each kind at most once a second.
class Supervisor {
  public:
    explicit Supervisor(const Watched& watched);

    // Until the pipeline ends by itself or SIGTERM or SIGINT comes: true after such a signal. `ready` is
    // asked until it says that all threads run; then the service manager is told. What the manager cannot
    // take is told again.
    bool run(const std::function<bool()>& ready);
    // On a thread of its own: sends health until end_health().
    void send_health();
    // A last report that says stopping goes out, then send_health() returns.
    void end_health();

  private:
    void tick(std::int64_t now_mono_ns);
    void look_at_cameras();
    void watch(std::int64_t now_mono_ns);
    void log_changes(const publish::HealthReport& report, std::int64_t now_mono_ns);
    void look_at_attitudes(std::int64_t now_mono_ns);
    void tell_status(const publish::HealthReport& report, std::int64_t now_mono_ns);
    void hand_over_health(const publish::HealthReport& report);

    Watched watched_;
    HostSensors sensors_;
    pipeline::TripleBuffer<publish::HealthReport> reports_{{}};
    std::atomic<std::uint64_t> health_beats_{0};

    bool ready_ = false;  // and the manager knows
    bool said_ready_ = false;
    publish::HostHealth host_;
    capture::CameraStatus cameras_;
    std::int64_t host_mono_ns_ = 0;
    std::int64_t fed_mono_ns_ = 0;
    bool triggered_ = false;
    verdict::LivenessState liveness_;
    verdict::Stuck stuck_ = verdict::Stuck::kNone;
    std::string status_;
    std::int64_t status_mono_ns_ = 0;
    std::string logged_verdict_;
    std::int64_t verdict_mono_ns_ = 0;
    publish::LifeState logged_state_ = publish::LifeState::kStarting;
    std::int64_t state_mono_ns_ = 0;
    std::uint64_t logged_bad_ = 0;
    std::int64_t bad_mono_ns_ = 0;
    std::uint64_t attitudes_ = 0;
    std::int64_t attitude_mono_ns_ = 0;
    bool attitudes_missing_ = false;
    std::size_t logged_lost_ = 0;
    std::int64_t lost_mono_ns_ = 0;
};

}  // namespace groundline::daemon
