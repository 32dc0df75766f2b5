// The attitude at an instant, against the definition, and its way into the pairs.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "pipeline/attitude_history.hpp"

namespace groundline::pipeline {
namespace {

constexpr std::int64_t kMs = 1'000'000;
using Taken = AttitudeHistory::Taken;

TEST(Attitudes, AreTakenInOrderAndThinnedOut) {
    AttitudeHistory history;
    EXPECT_EQ(history.add({100 * kMs, 0.1, 0.2, 0.01}), Taken::kKept);
    EXPECT_EQ(history.add({103 * kMs, 0.1, 0.2, 0.01}), Taken::kTooClose);
    EXPECT_EQ(history.add({104 * kMs, 0.1, 0.2, 0.01}), Taken::kKept);
    EXPECT_EQ(history.add({104 * kMs, 0.1, 0.2, 0.01}), Taken::kRefused) << "the same instant again";
    EXPECT_EQ(history.add({90 * kMs, 0.1, 0.2, 0.01}), Taken::kRefused) << "older";
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(history.add({200 * kMs, nan, 0.2, 0.01}), Taken::kRefused);
    EXPECT_EQ(history.add({200 * kMs, 0.1, INFINITY, 0.01}), Taken::kRefused);
    EXPECT_EQ(history.add({200 * kMs, 0.1, 0.2, nan}), Taken::kRefused);
    EXPECT_EQ(history.add({200 * kMs, 0.1, 0.2, -0.01}), Taken::kRefused);
    EXPECT_EQ(history.add({200 * kMs, 0.1, 0.2, 0.0}), Taken::kKept);
}

struct Case {
    const char* what;
    std::int64_t at_ms;
    bool valid;
    double pitch, roll, sigma;
};

TEST(Attitudes, AreReadBetweenSamplesAndNotFarFromThem) {
    AttitudeHistory history;
    history.add({100 * kMs, 1.0, -1.0, 0.1});
    history.add({120 * kMs, 2.0, -3.0, 0.2});
    history.add({220 * kMs, 4.0, -5.0, 0.3});
    const Case cases[] = {
        {"on a sample", 100, true, 1.0, -1.0, 0.2},     {"between two", 115, true, 1.75, -2.5, 0.2},
        {"before the first", 71, true, 1.0, -1.0, 0.1}, {"long before the first", 69, false, 0, 0, 0},
        {"in a gap, near", 149, true, 2.0, -3.0, 0.2},  {"in a gap, beyond", 170, false, 0, 0, 0},
        {"in a gap, after", 191, true, 4.0, -5.0, 0.3}, {"the newest, near", 250, true, 4.0, -5.0, 0.3},
        {"the newest, old", 251, false, 0, 0, 0},
    };
    for (const Case& each : cases) {
        const AttitudeInput attitude = history.at(each.at_ms * kMs, 30 * kMs);
        ASSERT_EQ(attitude.valid, each.valid) << each.what;
        EXPECT_NEAR(attitude.pitch_rad, each.pitch, 1e-12) << each.what;
        EXPECT_NEAR(attitude.roll_rad, each.roll, 1e-12) << each.what;
        EXPECT_NEAR(attitude.sigma_rad, each.sigma, 1e-12) << each.what;
    }
    EXPECT_FALSE(AttitudeHistory().at(0, 1000 * kMs).valid) << "nothing came yet";
}

// Far more samples than are kept, of a motion that is linear in time: whatever is answered is exact, and the
// last quarter of a second is answered.
TEST(Attitudes, ALongMotionIsReadExactlyAsFarBackAsPromised) {
    std::mt19937 random(5);
    AttitudeHistory history;
    const auto pitch = [](std::int64_t ns) { return 1e-9 * static_cast<double>(ns) - 0.5; };
    std::int64_t now_ns = 0;
    for (int i = 0; i < 5000; ++i) {
        now_ns += 1 + static_cast<std::int64_t>(random() % 8'000'000);
        history.add({now_ns, pitch(now_ns), -pitch(now_ns), 0.001});
        const std::int64_t back_ns = static_cast<std::int64_t>(random() % 245'000'000);
        const AttitudeInput attitude = history.at(now_ns - back_ns, 20 * kMs);
        if (now_ns - back_ns < 20 * kMs) continue;
        ASSERT_TRUE(attitude.valid) << i;
        // Outside the samples the nearest one is taken: at most kLeastApartNs from the newest.
        ASSERT_NEAR(attitude.pitch_rad, pitch(now_ns - back_ns), back_ns < 8 * kMs ? 0.0081 : 1e-9) << i;
        ASSERT_EQ(attitude.roll_rad, -attitude.pitch_rad);
    }
}

}  // namespace
}  // namespace groundline::pipeline
