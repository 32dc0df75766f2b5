// What health says about frames that come, slow down and stay away.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <thread>

#include "publish/health.hpp"
#include "unit/publish_fixture.hpp"

namespace groundline::publish {
namespace {

using test::Frame;

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kStaleAfter = 500 * kMs;

Reasons no_frames() {
    Reasons reasons;
    reasons.add(Reason::kNoFrames);
    return reasons;
}

TEST(Health, StartingBeforeTheFirstResult) {
    HealthTracker tracker(nullptr, kStaleAfter);
    const HealthReport report = tracker.report(5, 1000 * kMs);
    EXPECT_EQ(report.utime_us, 5);
    EXPECT_EQ(report.state, LifeState::kStarting);
    EXPECT_EQ(report.verdict, Verdict::kBlind);
    EXPECT_EQ(report.reasons, no_frames());
    EXPECT_EQ(report.sequence, -1);
    EXPECT_TRUE(std::isnan(report.result_age_s));
    EXPECT_TRUE(std::isnan(report.source_rate_hz));
    EXPECT_EQ(report.counts.front(), -1);
    EXPECT_TRUE(tracker.silent(1000 * kMs));
}

TEST(Health, RunningStalledRunningStopping) {
    const Frame frame(8, 4);
    HealthTracker tracker(nullptr, kStaleAfter);
    tracker.note(frame.result, 2 * kMs, 1000 * kMs);
    HealthReport report = tracker.report(0, 1500 * kMs);  // exactly kStaleAfter old: still running
    EXPECT_EQ(report.state, LifeState::kRunning);
    EXPECT_EQ(report.verdict, Verdict::kTrusted);
    EXPECT_EQ(report.reasons, frame.result.reasons);
    EXPECT_EQ(report.sequence, 41);
    EXPECT_EQ(report.exposure_mono_ns, frame.result.stamp.exposure_mono_ns);
    EXPECT_DOUBLE_EQ(report.result_age_s, 0.5);
    EXPECT_DOUBLE_EQ(report.pair_skew_ms, 0.25);
    EXPECT_DOUBLE_EQ(report.brightness_gain, 1.03);
    EXPECT_DOUBLE_EQ(report.brightness_offset, -1.5);

    report = tracker.report(0, 1500 * kMs + 1);
    EXPECT_EQ(report.state, LifeState::kStalled);
    EXPECT_EQ(report.verdict, Verdict::kBlind) << "a verdict of long ago must not stand";
    EXPECT_EQ(report.reasons, no_frames());
    EXPECT_EQ(report.sequence, 41);

    tracker.note(frame.result, 2 * kMs, 2000 * kMs);
    EXPECT_EQ(tracker.report(0, 2001 * kMs).state, LifeState::kRunning);
    EXPECT_EQ(tracker.report(0, 2001 * kMs).verdict, Verdict::kTrusted);
    tracker.stop();
    EXPECT_EQ(tracker.report(0, 2001 * kMs).state, LifeState::kStopping);
}

TEST(Health, RatesAreOverTheLastFullSecond) {
    const Frame frame(8, 4);
    Counters counters;
    HealthTracker tracker(&counters, kStaleAfter);
    std::int64_t now = 0;
    HealthReport report = tracker.report(0, now);
    // 20 results a second, 30 pairs a second, 25 processed, reported every 100 ms.
    for (int tick = 1; tick <= 20; ++tick) {
        now = tick * 100 * kMs;
        counters.add(Count::kFramesRead, 3);
        if (tick % 2 == 0) counters.add(Count::kFramesProcessed, 5);
        tracker.note(frame.result, kMs, now);
        tracker.note(frame.result, kMs, now);
        report = tracker.report(0, now);
        if (tick < 10) {
            EXPECT_TRUE(std::isnan(report.publish_rate_hz)) << "no full second yet";
        }
    }
    EXPECT_DOUBLE_EQ(report.source_rate_hz, 30.0);
    EXPECT_DOUBLE_EQ(report.process_rate_hz, 25.0);
    EXPECT_DOUBLE_EQ(report.publish_rate_hz, 20.0);
    EXPECT_EQ(report.counts.at(static_cast<std::size_t>(Count::kFramesRead)), 60);
    EXPECT_EQ(report.counts.at(static_cast<std::size_t>(Count::kFramesBad)), 0);
    report = tracker.report(0, now + 1000 * kMs);
    EXPECT_DOUBLE_EQ(report.publish_rate_hz, 0.0) << "a second without results";
}

TEST(Health, RatesOfCountersThatNobodyKeepsAreNotMeasured) {
    HealthTracker tracker(nullptr, kStaleAfter);
    tracker.report(0, 0);
    const HealthReport report = tracker.report(0, 2000 * kMs);
    EXPECT_TRUE(std::isnan(report.source_rate_hz));
    EXPECT_TRUE(std::isnan(report.process_rate_hz));
    EXPECT_DOUBLE_EQ(report.publish_rate_hz, 0.0);
}

TEST(Health, LatenciesPerStage) {
    Frame frame(8, 4);
    frame.result.stamp.exposure_mono_ns = 1000 * kMs;
    HealthTracker tracker(nullptr, kStaleAfter);
    tracker.note(frame.result, 6 * kMs, 1050 * kMs);
    const HealthReport report = tracker.report(0, 1050 * kMs);
    for (const std::size_t stage : {0U, 1U, 2U, 3U, 4U})
        EXPECT_DOUBLE_EQ(report.stages.at(stage).max_ms, 1.0 + static_cast<double>(stage));
    EXPECT_TRUE(std::isnan(report.stages.at(static_cast<std::size_t>(Stage::kWrite)).p50_ms))
        << "nobody wrote";
    EXPECT_DOUBLE_EQ(report.stages.at(static_cast<std::size_t>(Stage::kPublish)).p50_ms, 6.0);
    EXPECT_DOUBLE_EQ(report.all_stages.max_ms, 2.0 + 3.0 + 4.0 + 5.0 + 6.0) << "reading is none of them";
    EXPECT_DOUBLE_EQ(report.exposure_to_publish.p99_ms, 50.0);
}

TEST(Health, PublishingIsTimedByWhoeverPublishes) {
    Frame frame(8, 4);
    frame.result.times_ns[static_cast<std::size_t>(Stage::kPublish)] = 90 * kMs;  // of the slot's last frame
    HealthTracker tracker(nullptr, kStaleAfter);
    tracker.note(frame.result, 6 * kMs, 1050 * kMs);
    EXPECT_LT(tracker.report(0, 1100 * kMs).stages[static_cast<std::size_t>(Stage::kPublish)].max_ms, 10.0);
}

TEST(Health, CamerasOutOfStepCostTrustAndSayHowFar) {
    Frame frame(8, 4);
    frame.result.verdict = Verdict::kTrusted;
    frame.result.reasons = {};
    HealthTracker tracker(nullptr, kStaleAfter);
    tracker.note(frame.result, kMs, 1000 * kMs);
    CameraHealth camera;
    camera.skew_ms = 17.5;
    tracker.add(camera);
    EXPECT_EQ(tracker.report(0, 1100 * kMs).verdict, Verdict::kTrusted);
    camera.out_of_step = true;
    tracker.add(camera);
    HealthReport report = tracker.report(0, 1100 * kMs);
    EXPECT_EQ(report.verdict, Verdict::kDegraded);
    EXPECT_TRUE(report.reasons.has(Reason::kUnsynchronised));
    EXPECT_EQ(report.pair_skew_ms, 17.5);
    report = tracker.report(0, 2000 * kMs);
    EXPECT_EQ(report.verdict, Verdict::kBlind) << "no pairs come";
    EXPECT_TRUE(report.reasons.has(Reason::kNoFrames));
    EXPECT_TRUE(report.reasons.has(Reason::kUnsynchronised));
}

TEST(Health, FilesHaveNoLatencyFromExposure) {
    Frame frame(8, 4);
    for (const StampSource source : {StampSource::kFile, StampSource::kUnknown}) {
        frame.result.stamp.source = source;
        HealthTracker tracker(nullptr, kStaleAfter);
        tracker.note(frame.result, kMs, 1050 * kMs);
        EXPECT_TRUE(std::isnan(tracker.report(0, 1050 * kMs).exposure_to_publish.max_ms));
    }
}

TEST(Health, SummaryOfAHistogram) {
    LatencyHistogram histogram;
    EXPECT_TRUE(std::isnan(summary_of(histogram).p50_ms) && std::isnan(summary_of(histogram).max_ms));
    for (int i = 1; i <= 100; ++i)
        histogram.add(i * kMs);
    const LatencySummary summary = summary_of(histogram);
    EXPECT_NEAR(summary.p50_ms, 50.0, 50.0 / 16);
    EXPECT_NEAR(summary.p99_ms, 99.0, 99.0 / 16);
    EXPECT_DOUBLE_EQ(summary.max_ms, 100.0);
}

TEST(Health, OthersMeasurementsPassThrough) {
    const Frame frame(8, 4);
    HealthTracker tracker(nullptr, kStaleAfter);
    tracker.add({.temperature_c = 61.0, .throttled = 1, .memory_locked = 0});
    tracker.note(frame.result, kMs, 0);
    const HealthReport report = tracker.report(0, 0);
    EXPECT_DOUBLE_EQ(report.host.temperature_c, 61.0);
    EXPECT_EQ(report.host.throttled, 1);
    EXPECT_EQ(report.host.memory_locked, 0);
    EXPECT_EQ(report.host.realtime_scheduling, -1);
}

// One thread notes, another reports: what a report says of a result is of one result, and counts only rise.
TEST(Health, IsToldByAnotherThread) {
    Frame frame(8, 4);
    HealthTracker tracker(nullptr, kStaleAfter);
    constexpr std::int64_t kResults = 20'000;
    std::atomic<bool> done{false};
    std::thread sinks([&] {
        for (std::int64_t i = 1; i <= kResults; ++i) {
            frame.result.stamp.sequence = i;
            frame.result.stamp.skew_ns = i * kMs;
            tracker.note(frame.result, i, i * kMs);
        }
        done = true;
    });
    std::int64_t last = -1;
    for (bool end = false; !end;) {
        end = done.load();
        const HealthReport report = tracker.report(0, kResults * kMs);
        ASSERT_GE(report.sequence, last);
        last = report.sequence;
        if (last < 0) continue;
        ASSERT_EQ(report.pair_skew_ms, static_cast<double>(last));
        ASSERT_LE(report.stages[static_cast<std::size_t>(Stage::kPublish)].p50_ms,
                  report.stages[static_cast<std::size_t>(Stage::kPublish)].max_ms);
    }
    sinks.join();
    EXPECT_EQ(last, kResults) << "the newest result is never lost";
}

TEST(Health, RowOffsetIsToldWhereItWasMeasured) {
    Frame frame(8, 4);
    HealthTracker tracker(nullptr, kStaleAfter);
    frame.result.evidence.pair.row_features = 0;
    tracker.note(frame.result, 1, 1);
    EXPECT_TRUE(std::isnan(tracker.report(0, 1).host.epipolar_offset_px));
    frame.result.evidence.pair.row_features = 9;
    frame.result.evidence.pair.row_offset_px = -0.75;
    tracker.note(frame.result, 1, 1);
    EXPECT_EQ(tracker.report(0, 1).host.epipolar_offset_px, -0.75);
}

}  // namespace
}  // namespace groundline::publish
