// The running pipeline: capture thread, processing pool, sink thread and the hand-overs between them.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
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
#include "pipeline/hand_over.hpp"
#include "pipeline/processor.hpp"

namespace groundline::pipeline {

enum class Pace : std::uint8_t {
    kMax,     // as fast as it goes, lossless: every pair in order, back-pressure to the source
    kStamps,  // as the pairs were taken, newest first
    kFixed,   // rate_hz, newest first
};

struct RunOptions {
    Pace pace = Pace::kMax;
    double rate_hz = 0.0;      // for kFixed
    std::int64_t frames = -1;  // pairs to read, -1 all
    bool loop = false;         // start again at the end of the source
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
    void process(RunReport& report);
    void deliver(RunReport& report);

    FrameSource& source_;
    Processor& processor_;
    std::span<const SinkSlot> sinks_;
    Counters& counters_;
    std::unique_ptr<HandOver<CaptureSlot>> captured_;
    std::unique_ptr<HandOver<ResultSlot>> finished_;
};

}  // namespace groundline::pipeline
