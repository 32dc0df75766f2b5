// Overload by counts of skipped pairs: where it begins and ends, and that jitter and bursts do not.
// Resolution by time, in a closed loop with machines of several kinds.
#include "verdict/overload.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <vector>

namespace groundline::verdict {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
const OverloadLimits kLimits;

// Pairs taken at `hz` for `seconds`, `skipped_share` of the source's pairs skipped before them.
class Drive {
  public:
    bool overloaded(double seconds, int hz, double skipped_share) {
        const std::int64_t end = now_ + static_cast<std::int64_t>(seconds * 1e9);
        double owed = 0.0;
        while (now_ < end) {
            now_ += kSecond / hz;
            owed += skipped_share / (1.0 - skipped_share);
            const auto skipped = static_cast<std::uint64_t>(owed);
            owed -= static_cast<double>(skipped);
            state_ = next_overload(state_, {skipped, 0, now_}, kLimits);
        }
        return state_.overloaded;
    }

  private:
    OverloadState state_;
    std::int64_t now_ = 77 * kSecond;
};

TEST(Overload, BeginsAfterTwoBadSecondsAndEndsAfterFiveGoodOnes) {
    Drive run;
    EXPECT_FALSE(run.overloaded(10.0, 30, 0.0));
    EXPECT_FALSE(run.overloaded(1.5, 15, 0.5)) << "one bad window may be a burst";
    EXPECT_TRUE(run.overloaded(2.0, 15, 0.5));
    EXPECT_TRUE(run.overloaded(4.0, 30, 0.0)) << "recovery is not believed at once";
    EXPECT_FALSE(run.overloaded(3.0, 30, 0.0));
    EXPECT_TRUE(run.overloaded(3.5, 15, 0.5)) << "and it may come again";
}

TEST(Overload, SharesBetweenTheLimitsChangeNothing) {
    Drive run;
    EXPECT_FALSE(run.overloaded(60.0, 27, 0.15));
    EXPECT_TRUE(run.overloaded(4.0, 15, 0.5));
    EXPECT_TRUE(run.overloaded(60.0, 27, 0.15));
    EXPECT_FALSE(run.overloaded(8.0, 30, 0.02));
}

// A burst of half a second fills one window in two at most, wherever it falls.
TEST(Overload, BurstsNeitherBeginNorEndOne) {
    Drive calm;
    for (int i = 0; i < 20; ++i) {
        EXPECT_FALSE(calm.overloaded(0.5, 15, 0.5)) << i;
        EXPECT_FALSE(calm.overloaded(2.1, 30, 0.0)) << i;
    }
    Drive loaded;
    ASSERT_TRUE(loaded.overloaded(4.0, 15, 0.5));
    for (int i = 0; i < 20; ++i) {
        EXPECT_TRUE(loaded.overloaded(3.0, 30, 0.0)) << i;
        EXPECT_TRUE(loaded.overloaded(2.1, 15, 0.5)) << i;
    }
}

// A machine that takes seconds for a frame is overloaded too: windows end with a pair, however late.
TEST(Overload, SlowerThanTheWindow) {
    OverloadState state;
    std::int64_t now = 0;
    for (int i = 0; i < 4; ++i, now += 3 * kSecond)
        state = next_overload(state, {i == 0 ? 0U : 89U, 0, now}, kLimits);
    EXPECT_TRUE(state.overloaded);
    // A pause of the source (nothing came, nothing was skipped) ends it like any time without loss.
    for (int i = 0; i < 5; ++i, now += 3 * kSecond)
        state = next_overload(state, {0, 0, now}, kLimits);
    EXPECT_FALSE(state.overloaded);
}

// A source and a machine with a newest-first hand-over between them, and the policy that closes the loop.
class Machine {
  public:
    // What a pair takes at either resolution `at_s` seconds after the beginning.
    std::function<double(double at_s)> full_ms = [](double) { return 20.0; };
    std::function<double(double at_s)> half_ms = [](double) { return 6.0; };
    OverloadLimits limits = halving();

    static OverloadLimits halving() {
        OverloadLimits limits;
        limits.may_halve = true;
        return limits;
    }

    // Of the source from now on.
    void set_period(double ms) {
        period_ms_ = ms;
        begin_ms_ = now_ms_;
        last_ = -1;
    }

    struct Change {
        double at_s;
        bool half;
    };
    // Runs until `end_s`; when the resolution changed.
    std::vector<Change> run(double end_s) {
        std::vector<Change> changes;
        while (now_ms_ < 1000.0 * end_s) {
            // The newest pair that has come; else it waits for the next.
            const auto newest = static_cast<std::int64_t>((now_ms_ - begin_ms_) / period_ms_);
            const std::int64_t pair = std::max(newest, last_ + 1);
            const double arrival_ms = begin_ms_ + static_cast<double>(pair) * period_ms_;
            now_ms_ = std::max(now_ms_, arrival_ms);
            const auto skipped = static_cast<std::uint64_t>(pair - last_ - 1);
            last_ = pair;
            const bool was_half = state_.half;
            state_ = next_overload(state_,
                                   {skipped, static_cast<std::int64_t>(busy_ms_ * 1e6),
                                    static_cast<std::int64_t>(arrival_ms * 1e6)},
                                   limits);
            if (state_.half != was_half) changes.push_back({now_ms_ / 1000.0, state_.half});
            busy_ms_ = state_.half ? half_ms(now_ms_ / 1000.0) : full_ms(now_ms_ / 1000.0);
            (state_.half ? at_half_ms_ : at_full_ms_) += std::max(busy_ms_, period_ms_);
            now_ms_ += busy_ms_;
        }
        return changes;
    }
    const OverloadState& state() const { return state_; }
    double share_at_full() const { return at_full_ms_ / (at_full_ms_ + at_half_ms_); }

  private:
    OverloadState state_;
    double period_ms_ = 1000.0 / 30.0;
    double begin_ms_ = 0.0;
    double now_ms_ = 0.0;
    double busy_ms_ = 0.0;
    double at_full_ms_ = 0.0;
    double at_half_ms_ = 0.0;
    std::int64_t last_ = -1;
};

std::function<double(double)> always(double ms) {
    return [=](double) { return ms; };
}
std::function<double(double)> until(double end_s, double ms, double then_ms) {
    return [=](double at_s) { return at_s < end_s ? ms : then_ms; };
}

TEST(Resolution, IsHalvedOnlyWhereSkippingDoesNotSuffice) {
    struct Row {
        const char* what;
        double full_ms, until_s;
        bool half;
    };
    for (const Row& row : {Row{"keeps up", 30.0, 60.0, false}, Row{"skips a sixth", 40.0, 60.0, false},
                           Row{"skips half", 60.0, 60.0, true}, Row{"skips half for 4 s", 60.0, 4.0, false},
                           Row{"takes longer than a window", 1500.0, 60.0, true}}) {
        Machine machine;
        machine.full_ms = until(row.until_s, row.full_ms, 20.0);
        const auto changes = machine.run(18.0);
        ASSERT_EQ(changes.size(), row.half ? 1U : 0U) << row.what;
        if (!row.half) continue;
        EXPECT_GT(changes[0].at_s, 4.0) << row.what;
        EXPECT_LT(changes[0].at_s, row.full_ms > 1000.0 ? 12.0 : 7.0) << row.what;
        EXPECT_TRUE(machine.state().overloaded) << "something is given up, so it is said";
    }
}

TEST(Resolution, IsNotHalvedWhereItMayNot) {
    Machine machine;
    machine.limits.may_halve = false;
    machine.full_ms = always(100.0);
    EXPECT_TRUE(machine.run(600.0).empty());
    EXPECT_TRUE(machine.state().overloaded);
}

TEST(Resolution, ComesBackSoonAfterTheLoadIsGone) {
    for (const double load : {3.0, 4.0, 8.0}) {
        Machine machine;
        machine.full_ms = until(60.0, load * 20.0, 20.0);
        machine.half_ms = until(60.0, load * 6.0, 6.0);
        const auto changes = machine.run(300.0);
        ASSERT_EQ(changes.size(), 2U) << load;
        EXPECT_TRUE(changes[0].half);
        EXPECT_GT(changes[1].at_s, 60.0);
        EXPECT_LT(changes[1].at_s, 68.0) << load;
        EXPECT_FALSE(machine.state().overloaded);
    }
}

// Too slow by itself for good: at half resolution nothing is skipped, and yet it may not swing.
TEST(Resolution, DoesNotFlapUnderALoadThatLasts) {
    for (const double full_ms : {50.0, 60.0, 100.0}) {
        for (const double half_ms : {8.0, 20.0, 32.0, 45.0}) {
            SCOPED_TRACE(testing::Message() << full_ms << " " << half_ms);
            Machine machine;
            machine.full_ms = always(full_ms);
            machine.half_ms = always(half_ms);
            const auto changes = machine.run(3600.0);
            EXPECT_LE(changes.size(), 21U) << "ten trials in an hour";
            EXPECT_LT(machine.share_at_full(), 0.02);
        }
    }
}

// The estimate can be wrong for good: half resolution that was slow while it was measured makes full look
// cheap.
TEST(Resolution, AnEstimateThatPromisesTooMuchCostsLessAndLess) {
    Machine machine;
    machine.full_ms = always(60.0);
    machine.half_ms = [count = 0](double) mutable { return ++count % 400 < 60 ? 30.0 : 5.0; };
    const auto first = machine.run(600.0);
    const auto later = machine.run(4200.0);
    EXPECT_GT(first.size(), 3U) << "the estimate was right after all, and this shows nothing";
    EXPECT_LE(later.size(), 100U) << "a return every 80 s or more";
    EXPECT_LT(machine.share_at_full(), 0.06);
}

// A disturbance that ends at the very moment of the change makes full resolution look hopeless.
TEST(Resolution, AnEstimateThatPromisesTooLittleIsPutToTheTest) {
    Machine machine;
    double ends_s = 1e9;
    machine.full_ms = [&](double at_s) { return at_s < ends_s ? 200.0 : 20.0; };
    machine.half_ms = [&](double at_s) {
        ends_s = std::min(ends_s, at_s);
        return 10.0;
    };
    const auto changes = machine.run(600.0);
    ASSERT_EQ(changes.size(), 2U);
    EXPECT_LT(changes[1].at_s, 90.0);
    EXPECT_EQ(machine.state().wait, machine.limits.leave_windows);
}

// A source that slows down (cameras in the dark) leaves room for full resolution too.
TEST(Resolution, TheSourcesPeriodCounts) {
    Machine machine;
    machine.full_ms = always(60.0);
    ASSERT_EQ(machine.run(30.0).size(), 1U);
    machine.set_period(100.0);
    const auto changes = machine.run(60.0);
    ASSERT_EQ(changes.size(), 1U);
    EXPECT_FALSE(changes[0].half);
}

// Loads that come and go: at each a way to half resolution and one back, no more.
TEST(Resolution, FollowsLoadsThatComeAndGo) {
    Machine machine;
    const auto loaded = [](double at_s) { return static_cast<int>(at_s / 40.0) % 2 == 1; };
    machine.full_ms = [&](double at_s) { return loaded(at_s) ? 80.0 : 20.0; };
    machine.half_ms = [&](double at_s) { return loaded(at_s) ? 24.0 : 6.0; };
    const auto changes = machine.run(830.0);
    EXPECT_EQ(changes.size(), 20U);
    for (const auto& change : changes)
        EXPECT_EQ(change.half, loaded(change.at_s)) << change.at_s;
}

}  // namespace
}  // namespace groundline::verdict
