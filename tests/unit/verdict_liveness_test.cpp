// The watchdog's question as a table: which thread stopped, and which only has nothing to do.
#include "verdict/liveness.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <vector>

namespace groundline::verdict {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kLimit = 1000 * kMs;
constexpr std::int64_t kTick = 100 * kMs;

// One tick of a program that runs well: three pairs came, one of them was lost before processing, one result
// before the sinks.
void run_well(Progress& progress) {
    progress.capture_turns += 3;
    progress.captured += 3;
    progress.capture_lost += 1;
    progress.processed += 2;
    progress.results_lost += 1;
    progress.delivered += 1;
    progress.health_beats += 1;
}

struct Case {
    const char* what;
    std::function<void(Progress&)> tick;  // what moves after the first ten good ticks
    Stuck stuck;
};

const std::vector<Case>& cases() {
    static const std::vector<Case> table = {
        {"all moves", run_well, Stuck::kNone},
        {"the camera is absent", [](Progress& p) { ++p.capture_turns, ++p.health_beats; }, Stuck::kNone},
        {"every pair is bad", [](Progress& p) { p.capture_turns += 3, ++p.health_beats; }, Stuck::kNone},
        {"every pair is lost before processing takes it",  // a pair waits, none is processed
         [](Progress& p) { p.capture_turns += 3, p.captured += 3, p.capture_lost += 3, ++p.health_beats; },
         Stuck::kNone},
        {"capture stopped", [](Progress& p) { ++p.health_beats; }, Stuck::kCapture},
        {"processing stopped",
         [](Progress& p) {
             p.capture_turns += 3, p.captured += 3, p.capture_lost = p.captured - p.processed - 1;
             ++p.health_beats;
         },
         Stuck::kProcessing},
        {"the source ended while a pair is stuck in processing",
         [](Progress& p) {
             p.captured = p.capture_lost + p.processed + 1, ++p.capture_turns, ++p.health_beats;
         },
         Stuck::kProcessing},
        {"sinks stopped",
         [](Progress& p) {
             p.capture_turns += 3, p.captured += 3, p.processed += 3;
             p.results_lost = p.processed - p.delivered - 1;
             ++p.health_beats;
         },
         Stuck::kSinks},
        {"health stopped", [](Progress& p) { run_well(p), --p.health_beats; }, Stuck::kHealth},
        {"the log's thread, or a library's, stopped",
         [](Progress& p) { run_well(p), p.thread_stopped = true; }, Stuck::kOther},
        {"another one is caught at every look",
         [](Progress& p) { run_well(p), p.thread_stopped = !p.thread_stopped; }, Stuck::kNone},
        {"a thread that counts stopped",
         [](Progress& p) { run_well(p), --p.health_beats, p.thread_stopped = true; }, Stuck::kHealth},
        {"everything stopped", [](Progress&) {}, Stuck::kCapture},
    };
    return table;
}

TEST(Liveness, EachStoppedThreadIsNamedOnceTheLimitIsReached) {
    for (const Case& each : cases()) {
        Progress progress;
        LivenessState state;
        std::int64_t now = 5000 * kMs;
        for (int i = 0; i < 10; ++i, now += kTick) {
            run_well(progress);
            const Liveness look = judge_liveness(progress, state, now, kLimit);
            ASSERT_EQ(look.stuck, Stuck::kNone) << each.what;
            state = look.state;
        }
        for (int i = 1; i <= 30; ++i, now += kTick) {
            each.tick(progress);
            const Liveness look = judge_liveness(progress, state, now, kLimit);
            state = look.state;
            // The last good look was the tick before the first of these.
            const bool due = each.stuck != Stuck::kNone && i * kTick >= kLimit;
            ASSERT_EQ(look.stuck, due ? each.stuck : Stuck::kNone) << each.what << ", tick " << i;
            EXPECT_EQ(look.still_ns, due ? i * kTick : 0) << each.what;
        }
        run_well(progress);
        progress.capture_lost = progress.captured - progress.processed;
        progress.results_lost = progress.processed - progress.delivered;
        progress.thread_stopped = false;
        EXPECT_EQ(judge_liveness(progress, state, now, kLimit).stuck, Stuck::kNone)
            << each.what << ", moving again";
    }
}

// Time in order but idle does not count against a part: only what has waited counts.
TEST(Liveness, AWaitBeginsWithThePair) {
    Progress progress;
    LivenessState state;
    std::int64_t now = 0;
    for (int i = 0; i < 100; ++i, now += kTick) {
        ++progress.capture_turns, ++progress.health_beats;
        state = judge_liveness(progress, state, now, kLimit).state;
    }
    for (int i = 1; i <= 10; ++i, now += kTick) {
        progress.captured = 1;  // comes now, and stays
        ++progress.capture_turns, ++progress.health_beats;
        const Liveness look = judge_liveness(progress, state, now, kLimit);
        state = look.state;
        EXPECT_EQ(look.stuck, i * kTick >= kLimit ? Stuck::kProcessing : Stuck::kNone) << i;
    }
}

// A bus that has to time out holds the capture thread up far longer than a thread may stand still elsewhere.
TEST(Liveness, ADeviceMayTakeItsTime) {
    Progress progress;
    LivenessState state = judge_liveness(progress, {}, 0, kLimit).state;
    progress.in_device_call = true;
    std::int64_t now = 0;
    const auto look = [&] {
        now += kTick;
        ++progress.health_beats;
        const Liveness found = judge_liveness(progress, state, now, kLimit);
        state = found.state;
        return found.stuck;
    };
    for (int i = 0; i < 250; ++i)
        ASSERT_EQ(look(), Stuck::kNone) << i;
    progress.in_device_call = false;  // back, and the loop has not turned yet
    for (int i = 0; i < kLimit / kTick; ++i)
        ASSERT_EQ(look(), Stuck::kNone) << i;
    EXPECT_EQ(look(), Stuck::kCapture);
    progress.in_device_call = true;
    for (int i = 0; i < kLongestDeviceCallNs / kTick; ++i)
        ASSERT_EQ(look(), Stuck::kNone) << i;
    EXPECT_EQ(look(), Stuck::kCapture);
    // Only capture talks to devices.
    progress = {.capture_turns = 1, .captured = 1, .in_device_call = true};
    state = judge_liveness(progress, {}, now, kLimit).state;
    for (int i = 1; i < kLimit / kTick; ++i)
        ASSERT_EQ(look(), Stuck::kNone) << i;
    EXPECT_EQ(look(), Stuck::kProcessing);
}

TEST(Liveness, ALateLookFindsWhatMovedInBetween) {
    Progress progress;
    LivenessState state = judge_liveness(progress, {}, 0, kLimit).state;
    run_well(progress);
    EXPECT_EQ(judge_liveness(progress, state, 60'000 * kMs, kLimit).stuck, Stuck::kNone);
    EXPECT_EQ(judge_liveness({}, {}, 60'000 * kMs, kLimit).stuck, Stuck::kNone) << "a first look";
}

}  // namespace
}  // namespace groundline::verdict
