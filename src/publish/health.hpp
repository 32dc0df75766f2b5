// What the health message says, and the part of it that can be seen where results are published.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "core/counters.hpp"
#include "core/evidence.hpp"
#include "core/frame.hpp"
#include "core/latency_histogram.hpp"
#include "core/result.hpp"
#include "pipeline/triple_buffer.hpp"
#include "verdict/camera_policy.hpp"

namespace groundline::publish {

inline constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();

// The numbers are those of health_t.STATE_*.
enum class LifeState : std::uint8_t {
    kStarting = 0,  // no pair yet
    kRunning = 1,
    kStalled = 2,  // pairs arrived once but do so no more
    kStopping = 3,
};

// Half of the durations, and 99 of 100, were at most this.
struct LatencySummary {
    double p50_ms = kNotMeasured;
    double p99_ms = kNotMeasured;
    double max_ms = kNotMeasured;
};
// All not measured where the histogram is empty.
LatencySummary summary_of(const LatencyHistogram& histogram);

// What is measured elsewhere than where results pass by. Whatever nobody measures stays as it is here.
struct HostHealth {
    double exposure_difference_ms = kNotMeasured;
    double epipolar_offset_px = kNotMeasured;
    double temperature_c = kNotMeasured;
    int throttled = -1;  // these three: 1 yes, 0 no, -1 not measured
    int realtime_scheduling = -1;
    int memory_locked = -1;
};

// Of live cameras; as it is here where pairs come from elsewhere.
struct CameraHealth {
    std::optional<verdict::CameraState> state;
    double drift_ppm = kNotMeasured;
    double left_mean = kNotMeasured;
    double right_mean = kNotMeasured;
    double left_saturated = kNotMeasured;
    double right_saturated = kNotMeasured;
    std::array<char, 256> fault{};  // ends with a 0
    bool out_of_step = false;       // both eyes deliver, but nothing pairs
    double skew_ms = kNotMeasured;  // how far apart they are then
};

// Fields as in lcmtypes/health_t.lcm.
struct HealthReport {
    std::int64_t utime_us = 0;  // of the report
    std::int64_t exposure_mono_ns = -1;
    StampSource stamp_source = StampSource::kUnknown;
    std::int64_t sequence = -1;
    Verdict verdict = Verdict::kBlind;
    Reasons reasons;
    LifeState state = LifeState::kStarting;
    double result_age_s = kNotMeasured;
    double source_rate_hz = kNotMeasured;
    double process_rate_hz = kNotMeasured;
    double publish_rate_hz = kNotMeasured;
    std::array<LatencySummary, static_cast<std::size_t>(Stage::kCount)> stages;
    LatencySummary all_stages;  // of one pair together, without reading it
    LatencySummary exposure_to_publish;
    std::array<std::int64_t, static_cast<std::size_t>(Count::kCount)> counts;  // -1 not counted
    std::int64_t lcm_open_failures = -1;
    double pair_skew_ms = kNotMeasured;
    double brightness_gain = kNotMeasured;
    double brightness_offset = kNotMeasured;
    HostHealth host;
    CameraHealth camera;

    HealthReport() { counts.fill(-1); }
};

// Keeps what passes by until a report is asked for. One thread notes results, one asks for reports (it may be
// the same); neither waits for the other. No allocation; reads no clock itself.
class HealthTracker {
  public:
    // `counters`, which may be null, is borrowed.
    HealthTracker(const Counters* counters, std::int64_t stale_after_ns);

    // A result was published; it took `publish_ns`, whatever the result says of that stage. Stages with time
    // 0 were not timed.
    void note(const FrameResult& result, std::int64_t publish_ns, std::int64_t now_mono_ns);

    // All else is for the thread that asks for reports.
    void add(const HostHealth& host) { host_ = host; }
    void add(const CameraHealth& camera) { camera_ = camera; }
    void stop() { stopping_ = true; }

    // No result yet, or none for longer than stale_after_ns.
    bool silent(std::int64_t now_mono_ns);
    // Rates are over the last full second between two reports; not measured before. While the cameras are out
    // of step the skew is theirs and the newest verdict is degraded at best.
    HealthReport report(std::int64_t now_utime_us, std::int64_t now_mono_ns);

  private:
    // Of one result.
    struct Note {
        std::uint64_t published = 0;  // this one included
        std::int64_t mono_ns = 0;
        double epipolar_offset_px = kNotMeasured;
        HealthReport report;
    };
    const Note& newest_note();

    struct Totals {
        std::int64_t mono_ns = 0;
        std::uint64_t read = 0;
        std::uint64_t processed = 0;
        std::uint64_t published = 0;
    };
    Totals totals(std::int64_t now_mono_ns, std::uint64_t published) const;
    void update_rates(std::int64_t now_mono_ns, std::uint64_t published);

    const Counters* counters_;
    std::int64_t stale_after_ns_;
    std::uint64_t published_ = 0;  // of the noting thread
    pipeline::TripleBuffer<Note> notes_{{}};
    std::array<LatencyHistogram, static_cast<std::size_t>(Stage::kCount)> stages_;
    LatencyHistogram all_stages_;
    LatencyHistogram exposure_to_publish_;
    // Of the reporting thread.
    Note last_;
    HostHealth host_;
    CameraHealth camera_;
    bool stopping_ = false;
    bool window_open_ = false;
    Totals window_;  // where the running second began
    double source_rate_hz_ = kNotMeasured;
    double process_rate_hz_ = kNotMeasured;
    double publish_rate_hz_ = kNotMeasured;
};

}  // namespace groundline::publish
