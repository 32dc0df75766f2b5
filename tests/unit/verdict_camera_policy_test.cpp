// The life of a pair of cameras as tables of events, and that no sequence of events leads astray.
#include "verdict/camera_policy.hpp"

#include <gtest/gtest.h>

#include <random>
#include <utility>
#include <vector>

namespace groundline::verdict {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr CameraLimits kLimits;

using State = CameraState;
using Action = CameraAction;
using Fault = CameraFault;

struct Row {
    std::int64_t at_ms;
    CameraEvent event;
    State state;
    Action action = Action::kNone;
    bool say = false;
};

CameraLife play(const std::vector<Row>& rows, CameraLife life = {}) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const CameraStep next = step(life, rows[i].event, rows[i].at_ms * kMs, kLimits);
        EXPECT_EQ(next.life.state, rows[i].state) << "row " << i;
        EXPECT_EQ(next.action, rows[i].action) << "row " << i;
        EXPECT_EQ(next.say, rows[i].say) << "row " << i;
        life = next.life;
    }
    return life;
}

const CameraEvent kTick = CameraEvent::tick();
const CameraEvent kOpened = CameraEvent::opened();

std::vector<Row> started() {
    return {{0, kTick, State::kAbsent, Action::kOpen},
            {10, kOpened, State::kStarting},
            {50, CameraEvent::picture(0), State::kStarting},
            {60, CameraEvent::picture(1), State::kRunning, Action::kNone, true}};
}

TEST(CameraPolicy, OpensAtOnceAndRunsOnceBothEyesGaveAPicture) {
    play(started());
    play({{0, kTick, State::kAbsent, Action::kOpen},
          {1, kOpened, State::kStarting},
          {2, CameraEvent::picture(2), State::kRunning, Action::kNone, true},
          {3, CameraEvent::picture(2), State::kRunning}});
}

TEST(CameraPolicy, AnAbsentCameraIsLookedForEverySecondAtTheLatestAndNamedOnce) {
    const CameraEvent absent = CameraEvent::failed(Fault::kAbsent);
    play({{0, kTick, State::kAbsent, Action::kOpen},
          {0, absent, State::kAbsent, Action::kClose, true},
          {249, kTick, State::kAbsent},
          {250, kTick, State::kAbsent, Action::kOpen},
          {250, absent, State::kAbsent, Action::kClose},
          {749, kTick, State::kAbsent},
          {750, kTick, State::kAbsent, Action::kOpen},
          {750, absent, State::kAbsent, Action::kClose},
          {1749, kTick, State::kAbsent},
          {1750, kTick, State::kAbsent, Action::kOpen},
          {1750, absent, State::kAbsent, Action::kClose},
          {2749, kTick, State::kAbsent},
          {2750, kTick, State::kAbsent, Action::kOpen},
          {2760, kOpened, State::kStarting},
          {2800, CameraEvent::picture(2), State::kRunning, Action::kNone, true}});
}

TEST(CameraPolicy, OtherFaultsBackOffFurtherAndEachKindIsNamed) {
    const CameraEvent busy = CameraEvent::failed(Fault::kBusy);
    const CameraLife life = play({{0, kTick, State::kAbsent, Action::kOpen},
                                  {0, busy, State::kBackingOff, Action::kClose, true},
                                  {250, kTick, State::kBackingOff, Action::kOpen},
                                  {250, busy, State::kBackingOff, Action::kClose},
                                  {750, kTick, State::kBackingOff, Action::kOpen},
                                  {750, busy, State::kBackingOff, Action::kClose},
                                  {1750, kTick, State::kBackingOff, Action::kOpen},
                                  {1750, busy, State::kBackingOff, Action::kClose},
                                  {3749, kTick, State::kBackingOff},
                                  {3750, kTick, State::kBackingOff, Action::kOpen},
                                  {3750, busy, State::kBackingOff, Action::kClose},
                                  {7749, kTick, State::kBackingOff},
                                  {7750, kTick, State::kBackingOff, Action::kOpen},
                                  {7750, busy, State::kBackingOff, Action::kClose},
                                  {11749, kTick, State::kBackingOff},
                                  {11750, kTick, State::kBackingOff, Action::kOpen}});
    // From failing to not there: looked for soon again.
    play({{11750, CameraEvent::failed(Fault::kAbsent), State::kAbsent, Action::kClose, true},
          {11999, kTick, State::kAbsent},
          {12000, kTick, State::kAbsent, Action::kOpen},
          {12000, CameraEvent::failed(Fault::kRefused), State::kBackingOff, Action::kClose, true}},
         life);
}

TEST(CameraPolicy, StartingHasItsOwnLongerLimit) {
    for (const auto& [seen, silent] : {std::pair{0, 1}, {1, 0}, {-1, 2}}) {
        std::vector<Row> rows = {{0, kTick, State::kAbsent, Action::kOpen}, {100, kOpened, State::kStarting}};
        if (seen >= 0) rows.push_back({200, CameraEvent::picture(seen), State::kStarting});
        rows.push_back({10'100, kTick, State::kStarting});
        rows.push_back({10'101, kTick, State::kStalled, Action::kClose, true});
        rows.push_back({10'350, kTick, State::kStalled});
        rows.push_back({10'351, kTick, State::kStalled, Action::kOpen});
        EXPECT_EQ(play(rows).silent_eye, silent);
    }
}

TEST(CameraPolicy, OneSilentEyeIsAStallAndIsNamed) {
    std::vector<Row> rows = started();
    rows.push_back({1000, CameraEvent::picture(0), State::kRunning});
    rows.push_back({2060, kTick, State::kRunning});
    rows.push_back({2061, kTick, State::kStalled, Action::kClose, true});
    EXPECT_EQ(play(rows).silent_eye, 1);

    rows = started();
    rows.push_back({2100, CameraEvent::picture(2), State::kRunning});
    rows.push_back({4100, kTick, State::kRunning});
    rows.push_back({4101, kTick, State::kStalled, Action::kClose, true});
    EXPECT_EQ(play(rows).silent_eye, 2);
}

TEST(CameraPolicy, ACallerThatWasHeldUpFindsNoStall) {
    std::vector<Row> rows = started();
    rows.push_back({9000, CameraEvent::picture(0), State::kRunning});
    rows.push_back({9000, CameraEvent::picture(1), State::kRunning});
    rows.push_back({9001, kTick, State::kRunning});
    play(rows);
}

TEST(CameraPolicy, UnpluggedAndBackIsToldTwiceAndItsWaitsAreShortEachTime) {
    CameraLife life = play(started());
    for (int i = 0; i < 3; ++i) {
        const std::int64_t at = 5000 + 3000 * i;
        life = play({{at, CameraEvent::failed(Fault::kAbsent), State::kAbsent, Action::kClose, true},
                     {at + 250, kTick, State::kAbsent, Action::kOpen},
                     {at + 251, CameraEvent::failed(Fault::kAbsent), State::kAbsent, Action::kClose},
                     {at + 751, kTick, State::kAbsent, Action::kOpen},
                     {at + 800, kOpened, State::kStarting},
                     {at + 1000, CameraEvent::picture(2), State::kRunning, Action::kNone, true}},
                    life);
    }
}

TEST(CameraPolicy, AfterALongAbsenceTheFirstFailureIsTriedAgainSoon) {
    CameraLife life;
    for (int i = 0; i < 20; ++i)
        life = step(life, CameraEvent::failed(Fault::kAbsent), i * 1000 * kMs, kLimits).life;
    play({{20'000, CameraEvent::failed(Fault::kRefused), State::kBackingOff, Action::kClose, true},
          {20'249, kTick, State::kBackingOff},
          {20'250, kTick, State::kBackingOff, Action::kOpen}},
         life);
}

TEST(CameraPolicy, OnlySteadyRunningOfBothEyesForgivesFailures) {
    const std::vector<Row> fails = {
        {5000, CameraEvent::failed(Fault::kFailed), State::kBackingOff, Action::kClose, true},
        {5250, kTick, State::kBackingOff, Action::kOpen},
        {5251, CameraEvent::failed(Fault::kFailed), State::kBackingOff, Action::kClose},
        {5751, kTick, State::kBackingOff, Action::kOpen},
        {5800, kOpened, State::kStarting},
        {6000, CameraEvent::picture(2), State::kRunning, Action::kNone, true}};
    const CameraLife life = play(fails, play(started()));
    EXPECT_EQ(life.failures, 2);
    EXPECT_EQ(play({{6999, CameraEvent::picture(2), State::kRunning}}, life).failures, 2);
    EXPECT_EQ(play({{7000, CameraEvent::picture(0), State::kRunning}}, life).failures, 2);
    EXPECT_EQ(play({{7000, CameraEvent::picture(2), State::kRunning}}, life).failures, 0);
    // What dies as soon as it runs is left alone for longer and longer.
    play({{6500, CameraEvent::failed(Fault::kFailed), State::kBackingOff, Action::kClose, true},
          {7499, kTick, State::kBackingOff},
          {7500, kTick, State::kBackingOff, Action::kOpen}},
         life);
}

TEST(CameraPolicy, AnAbsenceForgivesFailures) {
    CameraLife life;
    for (int i = 0; i < 5; ++i)
        life = step(life, CameraEvent::failed(Fault::kFailed), i * 1000 * kMs, kLimits).life;
    EXPECT_EQ(life.failures, 5);
    play({{5000, CameraEvent::failed(Fault::kAbsent), State::kAbsent, Action::kClose, true},
          {5250, kTick, State::kAbsent, Action::kOpen},
          {5250, CameraEvent::failed(Fault::kRefused), State::kBackingOff, Action::kClose, true},
          {5499, kTick, State::kBackingOff},
          {5500, kTick, State::kBackingOff, Action::kOpen}},
         life);
}

// An unplugged camera that says "input/output error" instead of "no such device", and may do so once more
// when it is opened; ten times, with 5 s of pictures between.
TEST(CameraPolicy, EachOfTenReplugsIsLookedForWithinASecondWhateverTheFaultWas) {
    for (const bool dies_slowly : {false, true}) {
        for (const std::int64_t away_ms : {100, 300, 1300, 2700, 6000}) {
            CameraLife life = play(started());
            std::int64_t now_ms = 60;
            const auto happens = [&](const CameraEvent& event) {
                const CameraStep next = step(life, event, now_ms * kMs, kLimits);
                life = next.life;
                return next.action;
            };
            for (int replug = 0; replug < 10; ++replug) {
                for (const std::int64_t end_ms = now_ms + 5000; now_ms < end_ms; now_ms += 33)
                    happens(CameraEvent::picture(2));
                const std::int64_t back_ms = now_ms + away_ms;
                bool failed_again = !dies_slowly;
                ASSERT_EQ(happens(CameraEvent::failed(Fault::kFailed)), Action::kClose);
                for (;;) {
                    const bool opens = happens(kTick) == Action::kOpen;
                    if (opens && now_ms >= back_ms) break;
                    if (opens)
                        happens(CameraEvent::failed(std::exchange(failed_again, true) ? Fault::kAbsent
                                                                                      : Fault::kFailed));
                    now_ms += 10;
                    ASSERT_LE(now_ms, back_ms + 1000) << "replug " << replug << ", away " << away_ms;
                }
                happens(kOpened);
                now_ms += 500;
                happens(CameraEvent::picture(2));
                ASSERT_EQ(life.state, State::kRunning);
            }
        }
    }
}

TEST(CameraPolicy, WhatComesFromAClosedDeviceMeansNothing) {
    play({{0, CameraEvent::picture(2), State::kAbsent},
          {0, kTick, State::kAbsent, Action::kOpen},
          {0, CameraEvent::failed(Fault::kFailed), State::kBackingOff, Action::kClose, true},
          {10, CameraEvent::picture(2), State::kBackingOff}});
}

TEST(CameraPolicy, EachStartWaitsForBothEyesAnew) {
    play({{0, kTick, State::kAbsent, Action::kOpen},
          {1, kOpened, State::kStarting},
          {2, CameraEvent::picture(0), State::kStarting},
          {3, CameraEvent::failed(Fault::kFailed), State::kBackingOff, Action::kClose, true},
          {400, kTick, State::kBackingOff, Action::kOpen},
          {401, kOpened, State::kStarting},
          {402, CameraEvent::picture(1), State::kStarting},
          {403, CameraEvent::picture(0), State::kRunning, Action::kNone, true}});
}

// Whatever happens: open and close alternate as a device bears it, waits are bounded, nothing is told twice.
TEST(CameraPolicy, AnySequenceOfEventsKeepsTheRules) {
    for (unsigned seed = 0; seed < 200; ++seed) {
        std::mt19937 random(seed);
        CameraLife life;
        std::int64_t now = 0;
        bool open = false;
        CameraNews told;
        for (int i = 0; i < 500; ++i) {
            now += static_cast<std::int64_t>(random() % 3000) * kMs;
            CameraEvent event = kTick;
            switch (random() % 4) {
                case 0:
                    event = CameraEvent::picture(static_cast<int>(random() % 3));
                    break;
                case 1:
                    event = CameraEvent::failed(static_cast<Fault>(1 + random() % 4));
                    break;
                default:
                    break;
            }
            if (!open && event.kind == CameraEvent::Kind::kFault) event = kTick;
            CameraStep next = step(life, event, now, kLimits);
            if (next.action == Action::kOpen) {
                ASSERT_FALSE(open);
                ASSERT_TRUE(next.life.closed());
                life = next.life;
                open = random() % 2 == 0;
                next = step(life, open ? kOpened : CameraEvent::failed(Fault::kBusy), now, kLimits);
            }
            if (next.action == Action::kClose) open = false;
            ASSERT_EQ(next.life.closed(), !open);
            if (next.life.closed()) {
                ASSERT_LE(next.life.retry_ns - now, 4000 * kMs);
                if (next.life.state == State::kAbsent) {
                    ASSERT_LE(next.life.retry_ns - now, 1000 * kMs);
                }
            }
            if (next.say) {
                ASSERT_NE(next.life.said, told);
                told = next.life.said;
            }
            life = next.life;
        }
    }
}

}  // namespace
}  // namespace groundline::verdict
