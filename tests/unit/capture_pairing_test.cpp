// Pairing by exposure time: tables, and for any interleaving, loss, jitter and drift the rules it promises.
#include "capture/pairing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <vector>

#include "support/allocation_count.hpp"

namespace groundline::capture {
namespace {

constexpr std::int64_t kMs = 1'000'000;
using Fate = Pairing::Fate;

struct Play {
    explicit Play(PairingConfig config = {}) : pairing(config) {}

    // Adds pictures as "eye, ms" in this order; tokens are their positions.
    void add(const std::vector<std::pair<int, int>>& frames) {
        for (const auto& [eye, ms] : frames) {
            const int token = next_token++;
            for (const auto& drop : pairing.add({eye, ms * kMs, token}))
                (drop.fate == Fate::kSingle ? singles : superseded).push_back(drop.frame.token);
        }
    }
    std::pair<int, int> take() {
        const auto pair = pairing.take();
        return pair ? std::pair{pair->left.token, pair->right.token} : std::pair{-1, -1};
    }
    Pairing pairing;
    int next_token = 0;
    std::vector<int> singles;
    std::vector<int> superseded;
};

using Tokens = std::vector<int>;
constexpr std::pair<int, int> kNone{-1, -1};

TEST(Pairing, PairsWithinTheToleranceAndHandsOverOnce) {
    Play play;
    play.add({{0, 100}, {1, 110}});
    EXPECT_EQ(play.take(), (std::pair{0, 1}));
    EXPECT_EQ(play.take(), kNone);
    EXPECT_EQ(play.pairing.skew_ns(), 10 * kMs);
    play.add({{1, 200}, {0, 211}});
    EXPECT_EQ(play.take(), kNone);
    EXPECT_EQ(play.singles, Tokens{2}) << "nothing after 211 can be near 200";
}

TEST(Pairing, TakesTheNearestOfThoseWaiting) {
    Play play;
    play.add({{0, 92}, {0, 99}, {0, 107}, {1, 100}});
    EXPECT_EQ(play.take(), (std::pair{1, 3}));
    EXPECT_EQ(play.singles, Tokens{0});
    play.add({{1, 106}});
    EXPECT_EQ(play.take(), (std::pair{2, 4})) << "the later one still waits";
}

TEST(Pairing, WhatLiesBeforeAPairOnEitherSideIsGivenBackWithIt) {
    Play play;
    play.add({{1, 130}, {0, 100}, {0, 125}});
    EXPECT_EQ(play.singles, Tokens{1});
    EXPECT_EQ(play.take(), (std::pair{2, 0}));
}

TEST(Pairing, KeepsTheNewestPairAndCountsTheOneBefore) {
    Play play;
    play.add({{0, 100}, {1, 101}, {0, 133}, {1, 134}});
    EXPECT_EQ(play.superseded, (Tokens{0, 1}));
    EXPECT_EQ(play.take(), (std::pair{2, 3}));
    EXPECT_TRUE(play.singles.empty());
}

TEST(Pairing, ADeadEyeFillsNothingUp) {
    Play play;
    play.add({{0, 0}, {0, 33}, {0, 66}, {0, 100}, {0, 133}});
    EXPECT_EQ(play.singles, (Tokens{0, 1}));
    play.add({{1, 101}});  // late, but its left one still waits
    EXPECT_EQ(play.take(), (std::pair{3, 5}));
    EXPECT_EQ(play.singles, (Tokens{0, 1, 2}));
    EXPECT_FALSE(play.pairing.out_of_step()) << "one eye alone is not out of step";
}

TEST(Pairing, WhatComesOutOfOrderOrTwiceIsSingle) {
    Play play;
    play.add({{0, 100}, {0, 90}, {0, 100}, {1, 91}});
    EXPECT_EQ(play.singles, (Tokens{1, 2}));
    EXPECT_EQ(play.take(), (std::pair{0, 3}));
}

TEST(Pairing, OutOfStepIsSaidWhenBothDeliverAndNothingPairs) {
    Play play;
    for (int i = 0; i < 9; ++i)
        play.add({{0, 100 * i}, {1, 100 * i + 40}});
    EXPECT_FALSE(play.pairing.out_of_step());
    play.add({{0, 900}, {1, 940}});
    EXPECT_TRUE(play.pairing.out_of_step());
    EXPECT_EQ(play.take(), kNone);
    play.add({{0, 1000}, {1, 1040}});
    EXPECT_EQ(play.pairing.skew_ns(), 40 * kMs) << "how far they are apart";
    play.add({{0, 1100}, {1, 1101}});
    EXPECT_TRUE(play.pairing.out_of_step()) << "one pair may be chance";
    EXPECT_EQ(play.pairing.skew_ns(), 1 * kMs);
    for (int i = 12; i < 20; ++i)
        play.add({{0, 100 * i}, {1, 100 * i + 1}});
    for (int i = 20; i < 25; ++i)
        play.add({{0, 100 * i}, {1, 100 * i + 40}});
    play.add({{0, 2500}, {1, 2501}});
    EXPECT_TRUE(play.pairing.out_of_step()) << "nine, and then none for a while";
    for (int i = 26; i < 35; ++i)
        play.add({{0, 100 * i}, {1, 100 * i + 1}});
    EXPECT_FALSE(play.pairing.out_of_step());
}

TEST(Pairing, ResetForgetsAndGivesEverythingBack) {
    Play play;
    play.add({{0, 100}, {1, 101}, {0, 200}});
    std::size_t dropped = 0;
    for (const auto& drop : play.pairing.reset()) {
        EXPECT_EQ(drop.fate, Fate::kSingle);
        ++dropped;
    }
    EXPECT_EQ(dropped, 3U);
    EXPECT_EQ(play.take(), kNone);
    play.add({{0, 50}, {1, 51}});  // an earlier time: another device
    EXPECT_EQ(play.take(), (std::pair{3, 4}));
}

// Two cameras as they are: periods that differ, phase, jitter, losses, delivery later than exposure by what
// varies.
struct World {
    explicit World(unsigned seed) : random(seed) {}
    double uniform(double low, double high) {
        return low + (high - low) * static_cast<double>(random()) / static_cast<double>(std::mt19937::max());
    }
    struct Arrival {
        double at_ms;
        StampedFrame frame;
    };
    std::vector<Arrival> arrivals(int pictures) {
        std::vector<Arrival> all;
        for (int eye = 0; eye < 2; ++eye) {
            const double period_ms = uniform(20, 40);
            const double phase_ms = uniform(0, 40);
            const double jitter_ms = uniform(0, 6);
            const double loss = uniform(0, 0.5);
            const double delay_ms = uniform(0, 120);
            double last_ms = -1;
            for (int i = 0; i < pictures; ++i) {
                const double stamp_ms = i * period_ms + phase_ms + uniform(-jitter_ms, jitter_ms);
                // Each eye's own pictures arrive in their order.
                last_ms = std::max(last_ms, stamp_ms + uniform(0, delay_ms));
                if (uniform(0, 1) < loss) continue;
                all.push_back({last_ms, {eye, static_cast<std::int64_t>(stamp_ms * 1e6), 0}});
            }
        }
        std::stable_sort(all.begin(), all.end(),
                         [](const auto& a, const auto& b) { return a.at_ms < b.at_ms; });
        for (std::size_t i = 0; i < all.size(); ++i)
            all[i].frame.token = static_cast<int>(i);
        return all;
    }
    std::mt19937 random;
};

TEST(Pairing, AnyInterleavingKeepsEveryPromise) {
    std::size_t pairs_seen = 0;
    for (unsigned seed = 0; seed < 300; ++seed) {
        World world(seed);
        PairingConfig config;
        config.tolerance_ns = static_cast<std::int64_t>(world.uniform(0, 25) * 1e6);
        config.max_waiting = 1 + static_cast<int>(world.random() % Pairing::kMaxWaiting);
        Pairing pairing(config);
        std::map<int, int> fates;  // token -> how often its fate was told
        std::int64_t last_left = std::numeric_limits<std::int64_t>::min();
        std::int64_t last_right = last_left;
        std::size_t given = 0;
        const auto arrivals = world.arrivals(200);
        const auto note = [&](const Pairing::DroppedFrames& dropped) {
            for (const auto& drop : dropped)
                ++fates[drop.frame.token];
        };
        for (const auto& arrival : arrivals) {
            note(pairing.add(arrival.frame));
            ++given;
            std::size_t held = given;
            for (const auto& [token, count] : fates)
                held -= static_cast<std::size_t>(count);
            ASSERT_LE(held, 2U * static_cast<unsigned>(config.max_waiting) + 2U) << "buffers held";
            if (world.random() % 3 != 0) continue;
            const auto pair = pairing.take();
            if (!pair) continue;
            ++pairs_seen;
            ASSERT_EQ(pair->left.eye, 0);
            ASSERT_EQ(pair->right.eye, 1);
            ASSERT_LE(std::abs(pair->skew_ns()), config.tolerance_ns) << "seed " << seed;
            ASSERT_GT(pair->left.stamp_ns, last_left) << "seed " << seed;
            ASSERT_GT(pair->right.stamp_ns, last_right) << "seed " << seed;
            last_left = pair->left.stamp_ns;
            last_right = pair->right.stamp_ns;
            ++fates[pair->left.token];
            ++fates[pair->right.token];
        }
        note(pairing.reset());
        ASSERT_EQ(fates.size(), arrivals.size()) << "every picture has a fate";
        for (const auto& [token, count] : fates)
            ASSERT_EQ(count, 1) << "seed " << seed << ": the fate of " << token << " was told " << count
                                << " times";
    }
    EXPECT_GT(pairs_seen, 3000U);
}

// A picture more than a tolerance from its partner, by jitter, pairs with no other one as long as the
// tolerance is unambiguous; with a larger one it does.
TEST(Pairing, UpToHalfAPeriodNoPictureTakesTheNextOnesPartner) {
    constexpr double kRateHz = 60.0;
    constexpr std::int64_t kPeriodNs = 16'666'667;
    EXPECT_TRUE(unambiguous(kPeriodNs / 2 - kMs / 100, kRateHz));
    EXPECT_FALSE(unambiguous(kPeriodNs / 2 + kMs / 100, kRateHz));
    EXPECT_TRUE(unambiguous(10 * kMs, 30.0));
    for (const std::int64_t tolerance_ns : {8 * kMs, 10 * kMs}) {
        Pairing pairing({tolerance_ns, 3});
        int crossed = 0;
        int pairs = 0;
        for (int i = 0; i < 100; ++i) {
            // The right picture of an instant is 7.5 ms late, so 9.2 ms before the next left one; every fifth
            // left one is lost.
            const std::int64_t left_ns = i * kPeriodNs;
            const std::int64_t right_ns = left_ns + 15 * kMs / 2;
            for (const StampedFrame& frame : {StampedFrame{0, left_ns, i}, StampedFrame{1, right_ns, i}}) {
                if (frame.eye == 0 && i % 5 == 0) continue;
                pairing.add(frame);
                const auto pair = pairing.take();
                if (!pair) continue;
                ++pairs;
                crossed += pair->left.token != pair->right.token ? 1 : 0;
            }
        }
        EXPECT_GE(pairs, 80);
        EXPECT_EQ(crossed > 0, !unambiguous(tolerance_ns, kRateHz)) << crossed;
    }
}

// Nothing lost, skew within the tolerance and well below half a period: all pictures pair, whichever comes
// first.
TEST(Pairing, InStepEveryPictureIsPaired) {
    for (unsigned seed = 0; seed < 50; ++seed) {
        World world(seed);
        Pairing pairing({10 * kMs, 3});
        const double skew_ms = world.uniform(-9, 9);
        struct Arrival {
            double at_ms;
            StampedFrame frame;
        };
        std::vector<Arrival> arrivals;
        for (int i = 0; i < 100; ++i) {
            for (int eye = 0; eye < 2; ++eye) {
                const double stamp_ms = 33.3 * i + eye * skew_ms + 100;
                arrivals.push_back(
                    {stamp_ms + world.uniform(0, 30), {eye, static_cast<std::int64_t>(stamp_ms * 1e6), i}});
            }
        }
        std::stable_sort(arrivals.begin(), arrivals.end(),
                         [](const auto& a, const auto& b) { return a.at_ms < b.at_ms; });
        int pairs = 0;
        for (const auto& arrival : arrivals) {
            ASSERT_TRUE(pairing.add(arrival.frame).empty());
            if (const auto pair = pairing.take()) {
                ASSERT_EQ(pair->left.token, pair->right.token);
                ++pairs;
            }
        }
        ASSERT_EQ(pairs, 100) << "seed " << seed;
    }
}

TEST(Pairing, DriftIsFoundThroughJitterAndWildSeconds) {
    for (const double ppm : {0.0, 20.0, -150.0}) {
        World world(static_cast<unsigned>(ppm + 1000));
        Pairing pairing({10 * kMs, 3});
        EXPECT_TRUE(std::isnan(pairing.drift_ppm()));
        const double right_period_ms = 33.3 * (1.0 + ppm * 1e-6);
        for (int i = 0; i < 30 * 40; ++i) {
            const double wild = i / 30 % 5 == 4 ? 3.0 : 0.0;  // every fifth second is late by 3 ms
            const double left_ms = 33.3 * i + world.uniform(-0.3, 0.3);
            const double right_ms = right_period_ms * i + wild + world.uniform(-0.3, 0.3);
            pairing.add({0, static_cast<std::int64_t>(left_ms * 1e6), 0});
            pairing.add({1, static_cast<std::int64_t>(right_ms * 1e6), 0});
            pairing.take();
        }
        // A second's median strays by 0.06 ms, the slope over 32 of them by 1 ppm; the wild ones add as much.
        EXPECT_NEAR(pairing.drift_ppm(), ppm, 5.0);
    }
}

TEST(Pairing, APhaseThatJumpsIsNoDrift) {
    Pairing pairing({10 * kMs, 3});
    for (int i = 0; i < 30 * 37; ++i) {
        const int skew_ms = i < 30 * 20 ? 8 : -8;
        pairing.add({0, (33 * i + 100) * kMs, 0});
        pairing.add({1, (33 * i + 100 + skew_ms) * kMs, 0});
        // At some time the window holds as much of either phase, where a median alone is deceived.
        if (!std::isnan(pairing.drift_ppm())) {
            ASSERT_EQ(pairing.drift_ppm(), 0.0) << i;
        }
    }
    EXPECT_EQ(pairing.drift_ppm(), 0.0);
}

TEST(Pairing, AllocatesNothing) {
    const std::uint64_t before = test::allocations();
    Pairing pairing({10 * kMs, 3});
    for (int i = 0; i < 2000; ++i) {
        pairing.add({0, 33 * i * kMs, 0});
        if (i % 7 != 0) pairing.add({1, (33 * i + 2) * kMs, 0});
        if (i % 3 == 0) pairing.take();
    }
    EXPECT_EQ(test::allocations(), before);
    EXPECT_FALSE(std::isnan(pairing.drift_ppm()));
}

}  // namespace
}  // namespace groundline::capture
