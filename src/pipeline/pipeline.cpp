#include "pipeline/pipeline.hpp"

#include <pthread.h>
#include <time.h>

#include <thread>

#include "core/clock.hpp"
#include "pipeline/pacer.hpp"
#include "pipeline/ring.hpp"
#include "pipeline/triple_buffer.hpp"

namespace groundline::pipeline {
namespace {

// A lossless run keeps this many pairs in flight: enough to keep decoding, matching and writing busy at once.
constexpr std::size_t kRingSlots = 3;
// How long a sleeping capture thread takes at most to see a stop.
constexpr std::int64_t kLongestSleepNs = 50'000'000;

template <typename Slot, typename Make>
std::unique_ptr<HandOver<Slot>> make_hand_over(bool lossless, Make make) {
    static_assert(kRingSlots == 3);
    const std::array<Slot, 3> slots = {make(), make(), make()};
    if (lossless) return std::make_unique<Ring<Slot, kRingSlots>>(slots);
    return std::make_unique<TripleBuffer<Slot>>(slots);
}

void sleep_until(std::int64_t due_mono_ns, const std::atomic<bool>& stop) {
    for (std::int64_t now = now_mono_ns(); now < due_mono_ns && !stop.load(std::memory_order_relaxed);
         now = now_mono_ns()) {
        const std::int64_t wake = std::min(due_mono_ns, now + kLongestSleepNs);
        const timespec until{static_cast<time_t>(wake / 1'000'000'000),
                             static_cast<long>(wake % 1'000'000'000)};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
    }
}

void stamp_as_taken(std::int64_t mono_ns, FrameStamp& stamp) {
    stamp.exposure_mono_ns = mono_ns;
    stamp.utime_us = now_utime_us() - (now_mono_ns() - mono_ns) / 1000;
    stamp.source = StampSource::kArrival;
}

// Long enough that the thread really leaves its processor: a shorter sleep may be over before that.
constexpr long kRestNs = 50'000;

void rest() {
    const timespec span{0, kRestNs};
    clock_nanosleep(CLOCK_MONOTONIC, 0, &span, nullptr);
}

void name_this_thread(const char* name) {
    pthread_setname_np(pthread_self(), name);
}

}  // namespace

Pipeline::Pipeline(FrameSource& source, Processor& processor, std::span<const SinkSlot> sinks, bool lossless,
                   Arena& arena, Counters& counters)
    : source_(source), processor_(processor), sinks_(sinks), counters_(counters) {
    const SourceInfo& info = source.info();
    captured_ = make_hand_over<CaptureSlot>(lossless, [&] {
        return CaptureSlot{StereoFrame::make(arena, info.width, info.height, info.colour)};
    });
    finished_ =
        make_hand_over<ResultSlot>(lossless, [&] { return ResultSlot{processor.make_result(arena)}; });
}

Pipeline::~Pipeline() = default;

void Pipeline::run(const RunOptions& options, const std::atomic<bool>& stop, BadPair on_bad,
                   RunReport& report) {
    // Whatever leaves this function early, nobody may wait for a frame that never comes.
    struct CloseBoth {
        Pipeline& pipeline;
        ~CloseBoth() {
            pipeline.captured_->close();
            pipeline.finished_->close();
        }
    };
    std::jthread sinks;
    std::jthread processing;
    const CloseBoth close_both{*this};
    sinks = std::jthread([&] {
        name_this_thread("gl-sinks");
        if (options.on_thread) options.on_thread(ThreadRole::kSinks);
        deliver(options, report);
    });
    processing = std::jthread([&] {
        name_this_thread("gl-process");
        if (options.on_thread) options.on_thread(ThreadRole::kProcessing);
        process(options, report);
    });
    name_this_thread("gl-capture");
    if (options.on_thread) options.on_thread(ThreadRole::kCapture);
    capture(options, stop, on_bad, report);
    name_this_thread("groundline");
    captured_->end_of_stream();
    processing.join();
    sinks.join();
}

void Pipeline::tune(const Tuning& tuning) {
    *tuning_.begin_write() = tuning;
    tuning_.commit();
}

void Pipeline::capture(const RunOptions& options, const std::atomic<bool>& stop, BadPair on_bad,
                       RunReport& report) {
    Pacer pacer(options.pace == Pace::kFixed ? static_cast<std::int64_t>(1e9 / options.rate_hz) : 0,
                options.stamp_when_due ? Pacer::Late::kLeaveOut : Pacer::Late::kCatchUp);
    std::int64_t taken = 0;
    const AttitudeHistory* attitudes = nullptr;
    while (options.frames < 0 || taken < options.frames) {
        if (stop.load(std::memory_order_relaxed)) {
            report.interrupted = true;
            return;
        }
        capture_turns_.fetch_add(1, std::memory_order_relaxed);
        CaptureSlot* slot = captured_->begin_write();
        if (slot == nullptr) return;
        slot->frame.mode = FrameMode::kFull;
        const std::int64_t begin_ns = now_mono_ns();
        const Pull pull = source_.next(slot->frame);
        slot->read_ns = now_mono_ns() - begin_ns;
        if (pull == Pull::kIdle) continue;
        if (pull == Pull::kEnd) {
            report.source_error = source_.error();
            if (!report.source_error.empty() || !options.loop || !source_.rewind()) return;
            continue;
        }
        ++taken;
        if (pull == Pull::kBad) {
            counters_.add(Count::kFramesBad);
            on_bad(slot->frame.stamp, source_.error());
            // It takes its time like a good one: pairs that are all gone would come without end, at once.
            if (options.pace != Pace::kMax) sleep_until(pacer.due_without_stamp_ns(now_mono_ns()), stop);
            continue;
        }
        if (options.pace != Pace::kMax) {
            const std::int64_t due_ns = pacer.due_ns(slot->frame.stamp.exposure_mono_ns, now_mono_ns());
            sleep_until(due_ns, stop);
            if (options.stamp_when_due) stamp_as_taken(due_ns, slot->frame.stamp);
        }
        if (options.attitude != nullptr) {
            if (const AttitudeHistory* newest = options.attitude->newest()) attitudes = newest;
            slot->frame.attitude = attitudes != nullptr ? attitudes->at(slot->frame.stamp.exposure_mono_ns,
                                                                        options.attitude_max_gap_ns)
                                                        : AttitudeInput{};
        }
        slot->arrival_mono_ns = now_mono_ns();
        counters_.add(Count::kFramesRead);
        if (captured_->commit()) counters_.add(Count::kFramesOverwritten);
        if (options.rest) rest();
    }
}

void Pipeline::process(const RunOptions& options, RunReport& report) {
    verdict::OverloadLimits limits = options.overload;
    limits.may_halve = processor_.may_halve();
    verdict::OverloadState overload;
    std::uint64_t lost_before = 0;
    std::int64_t busy_ns = 0;
    bool was_half = false;
    while (CaptureSlot* captured = captured_->take()) {
        const std::int64_t begin_ns = now_mono_ns();
        if (const Tuning* tuning = tuning_.newest()) processor_.tune(*tuning);
        const std::uint64_t lost = counters_.get(Count::kFramesOverwritten);
        overload = verdict::next_overload(overload, {lost - lost_before, busy_ns, captured->arrival_mono_ns},
                                          limits);
        lost_before = lost;
        if (overload.half)
            captured->frame.mode = FrameMode::kHalfResolution;
        else if (overload.overloaded)
            captured->frame.mode = FrameMode::kSkipping;
        ResultSlot* finished = finished_->begin_write();
        if (finished == nullptr) break;
        processor_.process(captured->frame, finished->result);
        finished->arrival_mono_ns = captured->arrival_mono_ns;
        StageTimes& times = finished->result.times_ns;
        times[static_cast<std::size_t>(Stage::kRead)] = captured->read_ns;
        for (const Stage stage :
             {Stage::kRead, Stage::kRectify, Stage::kMatch, Stage::kGround, Stage::kClassify})
            report.stages[static_cast<std::size_t>(stage)].add(times[static_cast<std::size_t>(stage)]);
        counters_.add(Count::kFramesProcessed);
        const bool half = finished->result.evidence.half_resolution;
        if (half) counters_.add(Count::kFramesHalved);
        if (half != was_half) counters_.add(Count::kResolutionChanges);
        was_half = half;
        captured_->release();
        if (finished_->commit()) counters_.add(Count::kResultsOverwritten);
        if (options.rest) rest();
        busy_ns = now_mono_ns() - begin_ns;
    }
    finished_->end_of_stream();
}

void Pipeline::deliver(const RunOptions& options, RunReport& report) {
    while (ResultSlot* finished = finished_->take()) {
        for (const SinkSlot& slot : sinks_) {
            const std::int64_t begin_ns = now_mono_ns();
            if (!slot.sink->consume(finished->result)) {
                counters_.add(Count::kSinkFailures);
                if (slot.required) {
                    report.sink_error = slot.sink->error();
                    finished_->close();
                    captured_->close();
                    return;
                }
            }
            if (!slot.stage) continue;
            const auto stage = static_cast<std::size_t>(*slot.stage);
            finished->result.times_ns[stage] = now_mono_ns() - begin_ns;
            report.stages[stage].add(finished->result.times_ns[stage]);
        }
        report.latency.add(now_mono_ns() - finished->arrival_mono_ns);
        counters_.add(Count::kResultsDelivered);
        finished_->release();
        if (options.rest) rest();
    }
}

}  // namespace groundline::pipeline
