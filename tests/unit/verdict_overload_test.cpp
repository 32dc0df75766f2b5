// Overload by counts of skipped pairs: where it begins and ends, and that jitter and bursts do not.
#include "verdict/overload.hpp"

#include <gtest/gtest.h>

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
            state_ = next_overload(state_, skipped, now_, kLimits);
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
        state = next_overload(state, i == 0 ? 0 : 89, now, kLimits);
    EXPECT_TRUE(state.overloaded);
    // A pause of the source (nothing came, nothing was skipped) ends it like any time without loss.
    for (int i = 0; i < 5; ++i, now += 3 * kSecond)
        state = next_overload(state, 0, now, kLimits);
    EXPECT_FALSE(state.overloaded);
}

}  // namespace
}  // namespace groundline::verdict
