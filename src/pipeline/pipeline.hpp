// The running pipeline: capture thread, processing pool, sink thread and the hand-overs between them.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "core/arena.hpp"
#include "core/counters.hpp"
#include "core/frame_source.hpp"
#include "core/function_ref.hpp"
#include "core/latency_histogram.hpp"
#include "core/sink.hpp"
#include "pipeline/attitude_history.hpp"
#include "pipeline/hand_over.hpp"
#include "pipeline/processor.hpp"
#include "pipeline/triple_buffer.hpp"
#include "verdict/overload.hpp"

namespace groundline::pipeline {

enum class Pace : std::uint8_t {
    kMax,     // as fast as it goes, lossless: every pair in order, back-pressure to the source
    kStamps,  // as the pairs were taken, newest first
    kFixed,   // rate_hz, newest first
};

enum class ThreadRole : std::uint8_t { kCapture, kProcessing, kSinks };

struct RunOptions {
    Pace pace = Pace::kMax;
    double rate_hz = 0.0;      // for kFixed
    std::int64_t frames = -1;  // pairs to read, -1 all
    bool loop = false;         // start again at the end of the source
    // As if cameras took the pairs now: each is stamped with the instant it was due, on the clocks of this
    // computer. For paced runs.
    bool stamp_when_due = false;
    // Each thread sleeps an instant after every frame. The kernel counts how long a real-time thread runs
    // without ever waiting and takes that for a thread gone wild (RLIMIT_RTTIME); under overload a frame
    // always waits already, so that without this a thread that is merely busy would be counted so too.
    bool rest = false;
    // Borrowed: where the attitude at each pair's exposure comes from, and how far apart samples may be for
    // that. Null: the source's own attitude, if it has one.
    AttitudeHandOver* attitude = nullptr;
    std::int64_t attitude_max_gap_ns = 0;
    // When frames are said to be skipped, or looked at at half the resolution where the processor can.
    verdict::OverloadLimits overload = {};
    // Called once on each thread before its first frame; empty: nothing.
    std::function<void(ThreadRole)> on_thread = {};
};

// A required sink's failure ends the run (results on disk); another's is only counted (the network).
struct SinkSlot {
    Sink* sink = nullptr;
    std::optional<Stage> stage;  // whose time it is
    bool required = true;
};

// What a run did, beside the counters.
struct RunReport {
    bool interrupted = false;
    std::string source_error;  // of a source that ended by a failure
    std::string sink_error;    // of the required sink that ended the run
    std::array<LatencyHistogram, static_cast<std::size_t>(Stage::kCount)> stages;
    LatencyHistogram latency;  // pair read or arrived -> all sinks done
};

// Told on the capture thread of each pair that could not be read.
using BadPair = FunctionRef<void(const FrameStamp& stamp, const std::string& sentence)>;

class Pipeline {
  public:
    // Takes all memory of the slots from `arena`. Source, processor, sinks and counters are borrowed for the
    // pipeline's life. `lossless` decides the kind of both hand-overs.
    Pipeline(FrameSource& source, Processor& processor, std::span<const SinkSlot> sinks, bool lossless,
             Arena& arena, Counters& counters);
    ~Pipeline();

    // Runs until the source ends, `stop` turns true (finishing what is in flight) or a required sink fails.
    // Called once, from the thread that set everything up. `on_bad` must be safe to call from another thread.
    void run(const RunOptions& options, const std::atomic<bool>& stop, BadPair on_bad, RunReport& report);

    // Any one thread, also while run() runs. Takes effect whole, before the next frame that is processed.
    void tune(const Tuning& tuning);
    // Any thread. Rounds of the capture loop so far: it goes on turning when no pair comes.
    std::uint64_t capture_turns() const { return capture_turns_.load(std::memory_order_relaxed); }

  private:
    struct CaptureSlot {
        StereoFrame frame;
        std::int64_t arrival_mono_ns = 0;
        std::int64_t read_ns = 0;
    };
    struct ResultSlot {
        FrameResult result;
        std::int64_t arrival_mono_ns = 0;
    };

    void capture(const RunOptions& options, const std::atomic<bool>& stop, BadPair on_bad, RunReport& report);
    void process(const RunOptions& options, RunReport& report);
    void deliver(const RunOptions& options, RunReport& report);

    FrameSource& source_;
    Processor& processor_;
    std::span<const SinkSlot> sinks_;
    Counters& counters_;
    std::unique_ptr<HandOver<CaptureSlot>> captured_;
    std::unique_ptr<HandOver<ResultSlot>> finished_;
    TripleBuffer<Tuning> tuning_{{}};
    std::atomic<std::uint64_t> capture_turns_{0};
};

}  // namespace groundline::pipeline
