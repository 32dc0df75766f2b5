// The whole pipeline over a scripted source: order, losses, failures, ends, and what the hot path allocates.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "core/clock.hpp"
#include "pipeline/pacer.hpp"
#include "pipeline/pipeline.hpp"
#include "pipeline/worker_pool.hpp"
#include "support/allocation_count.hpp"

namespace groundline::pipeline {
namespace {

constexpr int kWidth = 96;
constexpr int kHeight = 64;

// Textured pairs shifted by 5 px; positions listed in `bad` cannot be read. Allocates nothing in next().
class ScriptedSource final : public FrameSource {
  public:
    explicit ScriptedSource(std::int64_t length, std::vector<std::int64_t> bad = {}) : bad_(std::move(bad)) {
        info_.name = "scripted";
        info_.width = kWidth;
        info_.height = kHeight;
        info_.length = length;
    }
    const SourceInfo& info() const override { return info_; }
    Pull next(StereoFrame& frame) override {
        if (position_ == info_.length) return Pull::kEnd;
        frame.stamp = {};
        frame.stamp.sequence = sequence_++;
        frame.stamp.position = position_++;
        frame.stamp.exposure_mono_ns = frame.stamp.sequence * 1'000'000;
        for (const std::int64_t bad : bad_)
            if (bad == frame.stamp.position) return Pull::kBad;
        for (int y = 0; y < kHeight; ++y) {
            for (int x = 0; x < kWidth; ++x) {
                frame.left.row(y)[x] = texture(x, y);
                frame.right.row(y)[x] = texture(x + 5, y);
            }
        }
        return Pull::kFrame;
    }
    const std::string& error() const override { return error_; }
    bool rewind() override {
        position_ = 0;
        return true;
    }

  private:
    static std::uint8_t texture(int x, int y) {
        std::uint32_t hash =
            static_cast<std::uint32_t>(x) * 0x9E3779B1U ^ static_cast<std::uint32_t>(y) * 0x85EBCA77U;
        hash = (hash ^ (hash >> 15U)) * 0x2C1B3C6DU;
        return static_cast<std::uint8_t>(hash >> 24U);
    }

    SourceInfo info_;
    std::vector<std::int64_t> bad_;
    std::int64_t position_ = 0;
    std::int64_t sequence_ = 0;
    std::string error_ = "";
};

// Says kIdle `pauses` times before each pair of another source; from pair `silent_from` on it says nothing
// else and turns `stop` true after the tenth time.
class PausingSource final : public FrameSource {
  public:
    PausingSource(std::int64_t length, int pauses, std::int64_t silent_from, std::atomic<bool>& stop)
        : source_(length), pauses_(pauses), silent_from_(silent_from), stop_(stop) {}
    const SourceInfo& info() const override { return source_.info(); }
    Pull next(StereoFrame& frame) override {
        if (delivered_ == silent_from_) {
            if (++idle_ == 10) stop_.store(true);
            if (idle_ > 1000) return Pull::kEnd;  // nobody looked at `stop`
            return Pull::kIdle;
        }
        if (idle_++ < pauses_) return Pull::kIdle;
        idle_ = 0;
        ++delivered_;
        return source_.next(frame);
    }
    const std::string& error() const override { return source_.error(); }
    bool rewind() override { return source_.rewind(); }
    int idle() const { return idle_; }

  private:
    ScriptedSource source_;
    int pauses_;
    std::int64_t silent_from_;
    std::atomic<bool>& stop_;
    std::int64_t delivered_ = 0;
    int idle_ = 0;
};

class RecordingSink final : public Sink {
  public:
    bool consume(const FrameResult& result) override {
        if (delay_ms > 0) std::this_thread::sleep_for(std::chrono::milliseconds(delay_ms));
        if (static_cast<std::int64_t>(positions.size()) == fail_after) return false;
        positions.push_back(result.stamp.position);
        attitudes.push_back(result.evidence.attitude);
        if (forbidden_by_frame.capacity() > forbidden_by_frame.size())
            forbidden_by_frame.emplace_back(test::allocations(), test::mutex_locks());
        std::uint64_t hash = 1469598103934665603ULL;
        const auto mix = [&](std::uint64_t value) { hash = (hash ^ value) * 1099511628211ULL; };
        for (int y = 0; y < result.mask.height; ++y) {
            for (int x = 0; x < result.mask.width; ++x) {
                mix(static_cast<std::uint64_t>(result.disparity.disparity_q4.at(x, y)));
                mix(static_cast<std::uint64_t>(result.disparity.invalid.at(x, y)));
                mix(static_cast<std::uint64_t>(result.mask.at(x, y)));
            }
        }
        hashes.push_back(hash);
        return true;
    }
    const std::string& error() const override { return error_; }

    int delay_ms = 0;
    std::int64_t fail_after = -1;
    std::vector<std::int64_t> positions;
    std::vector<AttitudeInput> attitudes;
    std::vector<std::uint64_t> hashes;
    std::vector<std::pair<std::uint64_t, std::uint64_t>> forbidden_by_frame;  // allocations and locks so far

  private:
    std::string error_ = "the disk is full";
};

struct Run {
    RunReport report;
    Counters counters;
    std::vector<std::int64_t> bad;
};

std::unique_ptr<Run> run_pipeline(FrameSource& source, RecordingSink& sink, const RunOptions& options,
                                  int threads, const std::atomic<bool>& stop) {
    auto run = std::make_unique<Run>();
    sink.positions.reserve(100000);
    sink.hashes.reserve(100000);
    sink.attitudes.reserve(100000);
    Arena arena;
    const rig::Rectifier rectifier(kWidth, kHeight);
    WorkerPool pool(threads);
    ProcessorConfig config;
    config.matcher.disparities = 16;
    Processor processor(config, rectifier, pool, arena);
    const std::array<SinkSlot, 1> sinks{{{&sink, Stage::kWrite, true}}};
    Pipeline pipeline(source, processor, sinks, options.pace == Pace::kMax, arena, run->counters);
    arena.seal();
    pipeline.run(
        options, stop,
        [&](const FrameStamp& stamp, const std::string&) { run->bad.push_back(stamp.position); },
        run->report);
    return run;
}

const std::atomic<bool> kNeverStop{false};

TEST(Pipeline, LosslessDeliversEveryFrameInOrderToASlowSink) {
    ScriptedSource source(40);
    RecordingSink sink;
    sink.delay_ms = 2;
    const auto run = run_pipeline(source, sink, {}, 2, kNeverStop);
    ASSERT_EQ(sink.positions.size(), 40U);
    for (std::int64_t i = 0; i < 40; ++i)
        EXPECT_EQ(sink.positions[static_cast<std::size_t>(i)], i);
    EXPECT_EQ(run->counters.get(Count::kResultsDelivered), 40U);
    EXPECT_EQ(run->counters.get(Count::kFramesOverwritten), 0U);
    EXPECT_EQ(run->counters.get(Count::kResultsOverwritten), 0U);
    EXPECT_FALSE(run->report.interrupted);
}

TEST(Pipeline, ResultsDoNotDependOnThreadsOrRuns) {
    std::vector<std::uint64_t> first;
    for (const int threads : {1, 2, 3, 1}) {
        ScriptedSource source(5);
        RecordingSink sink;
        run_pipeline(source, sink, {}, threads, kNeverStop);
        if (first.empty()) first = sink.hashes;
        EXPECT_EQ(sink.hashes, first) << threads << " threads";
    }
    ASSERT_EQ(first.size(), 5U);
}

// Pairs are exposed at 0, 1, 2 ... ms; the input knows 0 to 8 ms, and 4 ms on.
TEST(Pipeline, EachPairGetsTheAttitudeAtItsExposure) {
    AttitudeHandOver inbox{{}};
    AttitudeHistory history;
    for (const int ms : {0, 4, 8})
        history.add({ms * 1'000'000, 0.01 * ms, -0.02 * ms, 0.001});
    *inbox.begin_write() = history;
    inbox.commit();
    RunOptions options;
    options.attitude = &inbox;
    options.attitude_max_gap_ns = 4'000'000;
    ScriptedSource source(16);
    RecordingSink sink;
    run_pipeline(source, sink, options, 1, kNeverStop);
    ASSERT_EQ(sink.attitudes.size(), 16U);
    for (int ms = 0; ms < 16; ++ms) {
        const AttitudeInput& attitude = sink.attitudes[static_cast<std::size_t>(ms)];
        ASSERT_EQ(attitude.valid, ms <= 12) << ms;
        if (!attitude.valid) continue;
        EXPECT_NEAR(attitude.pitch_rad, 0.01 * std::min(ms, 8), 1e-12) << ms;
        EXPECT_NEAR(attitude.roll_rad, -0.02 * std::min(ms, 8), 1e-12) << ms;
    }

    ScriptedSource without(2);
    RecordingSink other;
    run_pipeline(without, other, {}, 1, kNeverStop);
    EXPECT_FALSE(other.attitudes.at(1).valid);
}

TEST(Pipeline, ABadPairIsCountedAndTheRunGoesOn) {
    ScriptedSource source(10, {3, 7});
    RecordingSink sink;
    const auto run = run_pipeline(source, sink, {}, 1, kNeverStop);
    EXPECT_EQ(run->bad, (std::vector<std::int64_t>{3, 7}));
    EXPECT_EQ(run->counters.get(Count::kFramesBad), 2U);
    EXPECT_EQ(sink.positions, (std::vector<std::int64_t>{0, 1, 2, 4, 5, 6, 8, 9}));
}

TEST(Pipeline, NewestFirstCountsEveryLoss) {
    ScriptedSource source(200);
    RecordingSink sink;
    sink.delay_ms = 10;
    RunOptions options;
    options.pace = Pace::kFixed;
    options.rate_hz = 1000.0;
    const auto run = run_pipeline(source, sink, options, 1, kNeverStop);
    const Counters& counters = run->counters;
    EXPECT_LT(sink.positions.size(), 200U) << "a sink of 10 ms cannot keep up with 1000 Hz";
    EXPECT_EQ(sink.positions.back(), 199) << "the newest is always delivered";
    EXPECT_EQ(counters.get(Count::kFramesRead), 200U);
    EXPECT_EQ(counters.get(Count::kFramesProcessed) + counters.get(Count::kFramesOverwritten), 200U);
    EXPECT_EQ(counters.get(Count::kResultsDelivered) + counters.get(Count::kResultsOverwritten),
              counters.get(Count::kFramesProcessed));
}

TEST(Pipeline, ARequiredSinksFailureEndsTheRun) {
    ScriptedSource source(1000000);
    RecordingSink sink;
    sink.fail_after = 3;
    const auto run = run_pipeline(source, sink, {}, 1, kNeverStop);
    EXPECT_EQ(run->report.sink_error, "the disk is full");
    EXPECT_EQ(sink.positions.size(), 3U);
    EXPECT_LT(run->counters.get(Count::kFramesRead), 20U);
}

TEST(Pipeline, StopsWhenAskedAndDeliversWhatIsInFlight) {
    ScriptedSource source(1000000);
    RecordingSink sink;
    sink.delay_ms = 1;
    std::atomic<bool> stop{false};
    std::thread stopper([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        stop = true;
    });
    const auto run = run_pipeline(source, sink, {}, 2, stop);
    stopper.join();
    EXPECT_TRUE(run->report.interrupted);
    EXPECT_EQ(sink.positions.size(), run->counters.get(Count::kFramesRead));
}

TEST(Pipeline, LoopsAndHonoursTheFrameLimit) {
    ScriptedSource source(4);
    RecordingSink sink;
    RunOptions options;
    options.loop = true;
    options.frames = 10;
    run_pipeline(source, sink, options, 1, kNeverStop);
    EXPECT_EQ(sink.positions, (std::vector<std::int64_t>{0, 1, 2, 3, 0, 1, 2, 3, 0, 1}));
}

// More than there are slots: a slot begun for a bad pair is not lost.
TEST(Pipeline, GoesOnAfterManyBadPairs) {
    ScriptedSource source(12, {1, 2, 4, 5, 6, 8, 9, 10});
    RecordingSink sink;
    const auto run = run_pipeline(source, sink, {}, 1, kNeverStop);
    EXPECT_EQ(sink.positions, (std::vector<std::int64_t>{0, 3, 7, 11}));
    EXPECT_EQ(run->counters.get(Count::kFramesBad), 8U);
}

TEST(Pipeline, AnIdleSourceIsAskedAgainAndCountsNothing) {
    std::atomic<bool> stop{false};
    PausingSource source(100, 3, -1, stop);
    RecordingSink sink;
    RunOptions options;
    options.frames = 5;
    const auto run = run_pipeline(source, sink, options, 1, stop);
    EXPECT_EQ(sink.positions, (std::vector<std::int64_t>{0, 1, 2, 3, 4}));
    EXPECT_EQ(run->counters.get(Count::kFramesRead), 5U);
    EXPECT_EQ(run->counters.get(Count::kFramesBad), 0U);
    EXPECT_FALSE(run->report.interrupted);
}

TEST(Pipeline, StopsWhileItsSourceIsIdle) {
    std::atomic<bool> stop{false};
    PausingSource source(100, 0, 2, stop);
    RecordingSink sink;
    const auto run = run_pipeline(source, sink, {}, 1, stop);
    EXPECT_EQ(sink.positions, (std::vector<std::int64_t>{0, 1}));
    EXPECT_EQ(source.idle(), 10);
    EXPECT_TRUE(run->report.interrupted);
}

// A worker pool that can be made as slow as one likes.
class SlowParallel final : public Parallel {
  public:
    int lanes() const override { return 1; }
    void for_each(int count, FunctionRef<void(int, int)> task) override {
        if (delay_ms.load() > 0) std::this_thread::sleep_for(std::chrono::milliseconds(delay_ms.load()));
        for (int index = 0; index < count; ++index)
            task(index, 0);
    }
    std::atomic<int> delay_ms{0};
};

// Keeps what the last results said; stops the run when it is told to by what it sees.
class WatchingSink final : public Sink {
  public:
    explicit WatchingSink(std::function<void(const FrameResult&)> see) : see_(std::move(see)) {}
    bool consume(const FrameResult& result) override {
        see_(result);
        return true;
    }
    const std::string& error() const override { return error_; }

  private:
    std::function<void(const FrameResult&)> see_;
    std::string error_;
};

void run_watched(FrameSource& source, Parallel& parallel, Sink& sink, const RunOptions& options,
                 const std::atomic<bool>& stop, Counters& counters,
                 const std::function<void(Pipeline&)>& before = {},
                 verdict::HalfResolution half_resolution = verdict::HalfResolution::kNever) {
    Arena arena;
    const rig::Rectifier rectifier(kWidth, kHeight);
    ProcessorConfig config;
    config.matcher.disparities = 16;
    config.half_resolution = half_resolution;
    Processor processor(config, rectifier, parallel, arena);
    const std::array<SinkSlot, 1> sinks{{{&sink, std::nullopt, true}}};
    Pipeline pipeline(source, processor, sinks, options.pace == Pace::kMax, arena, counters);
    arena.seal();
    if (before) before(pipeline);
    const auto report = std::make_unique<RunReport>();
    pipeline.run(
        options, stop, [](const FrameStamp&, const std::string&) {}, *report);
}

TEST(Pipeline, OverloadIsSaidWhileItLastsAndRecoveredFrom) {
    ScriptedSource source(100'000);
    SlowParallel load;
    Counters counters;
    std::atomic<bool> stop{false};
    std::int64_t seen_ns = 0;
    int phase = 0;  // loaded, said, recovered
    load.delay_ms = 20;
    WatchingSink sink([&](const FrameResult& result) {
        const bool said = result.reasons.has(Reason::kOverload);
        if (phase == 0 && said) {
            phase = 1;
            EXPECT_NE(result.verdict, Verdict::kTrusted);
            load.delay_ms = 0;
        } else if (phase == 1 && !said) {
            phase = 2;
            stop = true;
        }
        if (seen_ns == 0) seen_ns = result.stamp.exposure_mono_ns;
        // Far beyond any machine: two seconds to begin, five to end.
        if (result.stamp.exposure_mono_ns - seen_ns > 200'000'000'000) stop = true;
    });
    RunOptions options;
    options.pace = Pace::kFixed;
    options.rate_hz = 50.0;
    options.stamp_when_due = true;
    run_watched(source, load, sink, options, stop, counters);
    EXPECT_EQ(phase, 2) << "0: overload was never said; 1: it was never over";
    EXPECT_GT(counters.get(Count::kFramesOverwritten), 0U);
}

TEST(Pipeline, HalvesTheResolutionWhereSkippingDoesNotSufficeAndComesBack) {
    ScriptedSource source(100'000);
    SlowParallel load;
    Counters counters;
    std::atomic<bool> stop{false};
    std::int64_t seen_ns = 0;
    int phase = 0;  // loaded, skipping, halved, whole again
    load.delay_ms = 20;
    WatchingSink sink([&](const FrameResult& result) {
        const bool half = result.reasons.has(Reason::kHalfResolution);
        const bool said = result.reasons.has(Reason::kOverload);
        EXPECT_TRUE(said || !half) << "something is given up";
        EXPECT_EQ(result.mask.width, kWidth);
        if (phase == 0 && said) {
            phase = 1;
            EXPECT_FALSE(half) << "skipping is tried first";
        }
        if (phase == 1 && half) {
            phase = 2;
            EXPECT_NE(result.verdict, Verdict::kTrusted);
            load.delay_ms = 0;
        }
        if (phase == 2 && !half) {
            phase = 3;
            EXPECT_FALSE(said) << "at half resolution it kept up";
            stop = true;
        }
        if (seen_ns == 0) seen_ns = result.stamp.exposure_mono_ns;
        if (result.stamp.exposure_mono_ns - seen_ns > 200'000'000'000) stop = true;
    });
    RunOptions options;
    options.pace = Pace::kFixed;
    options.rate_hz = 50.0;
    options.stamp_when_due = true;
    options.overload.window_ns = 300'000'000;
    run_watched(source, load, sink, options, stop, counters, {}, verdict::HalfResolution::kWhenOverloaded);
    EXPECT_EQ(phase, 3) << "0: overload was never said; 1: nor half resolution; 2: it did not end";
    EXPECT_GT(counters.get(Count::kFramesHalved), 0U);
    EXPECT_LT(counters.get(Count::kFramesHalved), counters.get(Count::kFramesProcessed));
    EXPECT_GE(counters.get(Count::kResolutionChanges), 2U);
}

TEST(Pipeline, ALosslessRunIsNeverOverloaded) {
    ScriptedSource source(60);
    SlowParallel load;
    load.delay_ms = 5;
    Counters counters;
    WatchingSink sink([](const FrameResult& result) { EXPECT_FALSE(result.reasons.has(Reason::kOverload)); });
    run_watched(source, load, sink, {}, kNeverStop, counters);
    EXPECT_EQ(counters.get(Count::kResultsDelivered), 60U);
}

TEST(Pipeline, PacedPairsCanBeStampedAsIfTakenNow) {
    ScriptedSource source(20);
    SlowParallel parallel;
    Counters counters;
    const std::int64_t begin_ns = now_mono_ns();
    const std::int64_t begin_us = now_utime_us();
    std::int64_t last_ns = begin_ns - 1;
    WatchingSink sink([&](const FrameResult& result) {
        EXPECT_EQ(result.stamp.source, StampSource::kArrival);
        EXPECT_GT(result.stamp.exposure_mono_ns, last_ns);
        EXPECT_LE(result.stamp.exposure_mono_ns, now_mono_ns());
        EXPECT_GE(result.stamp.utime_us, begin_us - 1000);
        EXPECT_LE(result.stamp.utime_us, now_utime_us() + 1000);
        last_ns = result.stamp.exposure_mono_ns;
    });
    RunOptions options;
    options.pace = Pace::kFixed;
    options.rate_hz = 200.0;
    options.stamp_when_due = true;
    run_watched(source, parallel, sink, options, kNeverStop, counters);
    EXPECT_GT(last_ns, begin_ns);
}

TEST(Pacer, TimeThatWasLostIsCaughtUpWithOrLeftOut) {
    constexpr std::int64_t kStep = 100;
    for (const Pacer::Late late : {Pacer::Late::kCatchUp, Pacer::Late::kLeaveOut}) {
        Pacer pacer(kStep, late);
        EXPECT_EQ(pacer.due_ns(0, 1000), 1000);
        EXPECT_EQ(pacer.due_ns(0, 1010), 1100);
        EXPECT_EQ(pacer.due_ns(0, 1300), 1200) << "one step late is no loss";
        const bool left_out = late == Pacer::Late::kLeaveOut;
        EXPECT_EQ(pacer.due_ns(0, 5000), left_out ? 5000 : 1300);
        EXPECT_EQ(pacer.due_ns(0, 5000), left_out ? 5100 : 1400);
    }
}

TEST(Pacer, APairWithoutAStampTakesAStep) {
    constexpr std::int64_t kMs = 1'000'000;
    Pacer pacer(0);
    EXPECT_EQ(pacer.due_ns(0, 0), 0);
    EXPECT_EQ(pacer.due_ns(40 * kMs, 0), 40 * kMs);
    EXPECT_EQ(pacer.due_without_stamp_ns(0), 80 * kMs);
    EXPECT_EQ(pacer.due_without_stamp_ns(0), 120 * kMs);
    EXPECT_EQ(pacer.due_ns(160 * kMs, 0), 160 * kMs) << "in time with the recording";
}

TEST(Pipeline, TuningTakesEffectWholeFromTheNextFrame) {
    ScriptedSource source(30);
    SlowParallel parallel;
    Counters counters;
    Pipeline* running = nullptr;
    int frames = 0;
    int tuned = 0;
    WatchingSink sink([&](const FrameResult& result) {
        const bool is_tuned = result.tolerance_ratio == 0.3;
        EXPECT_TRUE(is_tuned || result.tolerance_ratio == 0.15) << result.tolerance_ratio;
        EXPECT_EQ(is_tuned, result.reasons.has(Reason::kDark)) << "limits and tolerances come together";
        tuned += is_tuned ? 1 : 0;
        if (++frames != 10) return;
        Tuning tuning;
        tuning.terrain.tolerance_ratio = 0.3;
        tuning.limits.min_contrast = 1e9;
        running->tune(tuning);
    });
    run_watched(source, parallel, sink, {}, kNeverStop, counters,
                [&](Pipeline& pipeline) { running = &pipeline; });
    EXPECT_EQ(frames, 30);
    EXPECT_GE(tuned, 10);
    EXPECT_LE(tuned, 20);
}

TEST(Pipeline, TellsEachThreadOnceAndCountsItsTurns) {
    ScriptedSource source(5);
    SlowParallel parallel;
    Counters counters;
    std::array<std::atomic<int>, 3> told{};
    RunOptions options;
    options.on_thread = [&](ThreadRole role) { ++told[static_cast<std::size_t>(role)]; };
    Pipeline* running = nullptr;
    std::uint64_t turns = 0;
    WatchingSink counting([&](const FrameResult&) { turns = running->capture_turns(); });
    run_watched(source, parallel, counting, options, kNeverStop, counters,
                [&](Pipeline& pipeline) { running = &pipeline; });
    for (const auto& count : told)
        EXPECT_EQ(count.load(), 1);
    EXPECT_GE(turns, 5U);
}

// On all threads of ours together: capture, processing, workers, sinks.
TEST(Pipeline, SteadyStateAllocatesAndLocksNothingOver1000Frames) {
    ScriptedSource source(1003);
    RecordingSink sink;
    sink.forbidden_by_frame.reserve(1003);
    run_pipeline(source, sink, {}, 3, kNeverStop);
    ASSERT_EQ(sink.forbidden_by_frame.size(), 1003U);
    EXPECT_EQ(sink.forbidden_by_frame[1002].first, sink.forbidden_by_frame[2].first) << "allocations";
    EXPECT_EQ(sink.forbidden_by_frame[1002].second, sink.forbidden_by_frame[2].second) << "mutex locks";
}

// The counters themselves: without this, the test above could pass by counting nothing.
TEST(Forbidden, AllocationsAndLocksAreSeen) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "a sanitizer stands in the place of the counters";
#endif
    const std::uint64_t allocations = test::allocations();
    const std::uint64_t locks = test::mutex_locks();
    delete new volatile int{1};
    std::mutex mutex;
    mutex.lock();
    mutex.unlock();
    EXPECT_GT(test::allocations(), allocations);
    EXPECT_GT(test::mutex_locks(), locks);
}

}  // namespace
}  // namespace groundline::pipeline
