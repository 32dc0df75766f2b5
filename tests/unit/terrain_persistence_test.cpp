#include "terrain/persistence.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <random>
#include <string>
#include <vector>

#include "core/error.hpp"

namespace groundline::terrain {
namespace {

using Sectors = FixedVector<Sector, kMaxSectors>;

constexpr std::int64_t kFrameNs = 100'000'000;

Sector free_to(double free_range_m = 10.0) {
    Sector sector;
    sector.free_range_m = free_range_m;
    return sector;
}

Sector thing_at(double nearest_m, TerrainClass kind = TerrainClass::kObstacle) {
    Sector sector;
    sector.blocked = true;
    sector.kind = kind;
    sector.nearest_m = nearest_m;
    sector.nearest_sigma_m = 0.02;
    sector.free_range_m = nearest_m - 0.2;
    return sector;
}

TerrainConfig config_of(int clear_frames, int clear_window) {
    TerrainConfig config;
    config.clear_frames = clear_frames;
    config.clear_window = clear_window;
    return config;
}

// Frames 0.1 s apart.
struct Drive {
    Persistence persistence;
    std::int64_t now_ns = 5'000'000'000;

    explicit Drive(int clear_frames = 2, int clear_window = 3)
        : persistence(config_of(clear_frames, clear_window)) {}
    Sectors frame(const std::vector<Sector>& sectors, Verdict verdict = Verdict::kTrusted,
                  std::int64_t after_ns = kFrameNs) {
        Sectors result(sectors.begin(), sectors.end());
        now_ns += after_ns;
        persistence.apply(now_ns, verdict, result);
        return result;
    }
    // One sector; shown as: obstacle, held obstacle, free.
    std::string one(const std::string& frames) {
        std::string shown;
        for (const char each : frames) {
            const Sector sector = frame({each == 'o' ? thing_at(4.0) : free_to()})[0];
            shown += !sector.blocked ? '.' : sector.held ? 'h' : 'o';
        }
        return shown;
    }
};

TEST(Persistence, AppearsAtOnceAndClearsAfterSoManyAbsences) {
    struct Row {
        int frames, window;
        const char* given;
        const char* shown;
    };
    for (const Row& row : {
             Row{2, 3, "..o...", "..oh.."},
             Row{2, 3, "o.o.oo..", "oho.ooh."},  // absent twice of three, though not in a row
             Row{2, 3, "o.oo.oo.o", "ohoohooho"},
             Row{2, 2, "o.o.o..", "ohohoh."},
             Row{1, 1, "o.o..", "o.o.."},
             Row{1, 3, "o.o..", "o.o.."},
             Row{3, 5, "o..o.o...", "ohho.ohh."},
             Row{3, 3, "o..o..o...", "ohhohhohh."},
             Row{32, 32, "o...............................", "ohhhhhhhhhhhhhhhhhhhhhhhhhhhhhhh"},
             Row{32, 32, "o................................", "ohhhhhhhhhhhhhhhhhhhhhhhhhhhhhhh."},
         }) {
        Drive drive(row.frames, row.window);
        EXPECT_EQ(drive.one(row.given), row.shown) << row.frames << " of " << row.window;
    }
}

TEST(Persistence, HeldIsAsItWasSeenAndNoFreeRangeGoesBeyondIt) {
    Drive drive;
    drive.frame({thing_at(4.0, TerrainClass::kDrop)});
    const Sector held = drive.frame({free_to(10.0)})[0];
    EXPECT_TRUE(held.held);
    EXPECT_EQ(held.kind, TerrainClass::kDrop);
    EXPECT_EQ(held.nearest_m, 4.0);
    EXPECT_EQ(held.nearest_sigma_m, 0.02);
    EXPECT_EQ(held.free_range_m, 4.0);
    drive.persistence.reset();
    drive.frame({thing_at(4.0)});
    EXPECT_EQ(drive.frame({free_to(3.0)})[0].free_range_m, 3.0);
}

TEST(Persistence, NearestIsHeldBeforeWhatIsSeenBehindIt) {
    Drive drive;
    drive.frame({thing_at(4.0)});
    const Sector held = drive.frame({thing_at(7.0)})[0];
    EXPECT_TRUE(held.held);
    EXPECT_EQ(held.nearest_m, 4.0);
    EXPECT_EQ(held.free_range_m, 4.0);
    const Sector cleared = drive.frame({thing_at(7.0)})[0];
    EXPECT_FALSE(cleared.held);
    EXPECT_EQ(cleared.nearest_m, 7.0);
}

// 3 deviations of both and 0.3 m of motion in 0.1 s are 0.385 m.
TEST(Persistence, FollowsWhatMovesAndTakesWhatIsNearerAtOnce) {
    Drive drive;
    drive.frame({thing_at(4.0)});
    EXPECT_FALSE(drive.frame({thing_at(4.38)})[0].held);
    EXPECT_TRUE(drive.frame({thing_at(4.78)})[0].held);
    const Sector nearer = drive.frame({thing_at(2.0)})[0];
    EXPECT_FALSE(nearer.held);
    EXPECT_EQ(nearer.nearest_m, 2.0);
    // The nearer one was never absent before.
    EXPECT_TRUE(drive.frame({free_to()})[0].held);
    drive.persistence.reset();
    drive.frame({thing_at(4.0)});
    drive.frame({thing_at(2.0)});
    EXPECT_EQ(drive.frame({free_to()})[0].nearest_m, 2.0);
}

TEST(Persistence, GapInTimeDropsWhatIsHeld) {
    for (const std::int64_t after_ns : {Persistence::kGapNs + 1, std::int64_t{-1}}) {
        Drive drive;
        drive.frame({thing_at(4.0)});
        EXPECT_FALSE(drive.frame({free_to()}, Verdict::kTrusted, after_ns)[0].blocked) << after_ns;
    }
    for (const std::int64_t after_ns : {Persistence::kGapNs, std::int64_t{0}}) {
        Drive drive;
        drive.frame({thing_at(4.0)});
        EXPECT_TRUE(drive.frame({free_to()}, Verdict::kDegraded, after_ns)[0].held) << after_ns;
    }
}

TEST(Persistence, BlindFrameOtherSectorsAndResetDropWhatIsHeld) {
    Drive drive;
    drive.frame({thing_at(4.0)});
    EXPECT_FALSE(drive.frame({free_to()}, Verdict::kBlind)[0].blocked);
    EXPECT_FALSE(drive.frame({free_to()})[0].blocked);
    drive.frame({thing_at(4.0)});
    drive.frame({});
    EXPECT_FALSE(drive.frame({free_to()})[0].blocked);
    drive.frame({thing_at(4.0)});
    EXPECT_FALSE(drive.frame({free_to(), free_to()})[0].blocked);
    drive.frame({thing_at(4.0), free_to()});
    drive.persistence.reset();
    EXPECT_FALSE(drive.frame({free_to(), free_to()})[0].blocked);
}

TEST(Persistence, GapIsSaidAtOnceAndNotHeld) {
    Drive drive;
    drive.frame({thing_at(1.0, TerrainClass::kUnknown)});
    EXPECT_FALSE(drive.frame({free_to()})[0].blocked);
    drive.frame({thing_at(4.0)});
    const Sector gap = drive.frame({thing_at(1.0, TerrainClass::kUnknown)})[0];
    EXPECT_FALSE(gap.held);
    EXPECT_EQ(gap.nearest_m, 1.0);
    EXPECT_EQ(gap.kind, TerrainClass::kUnknown);
    drive.persistence.reset();
    drive.frame({thing_at(4.0)});
    EXPECT_EQ(drive.frame({thing_at(4.2, TerrainClass::kUnknown)})[0].nearest_m, 4.0);
}

// A row of sectors: digits are ranges in m, a dot is free; shown with h for what is held.
std::string shown(Drive& drive, const std::string& given) {
    std::vector<Sector> sectors;
    for (const char each : given)
        sectors.push_back(each == '.' ? free_to() : thing_at(each - '0'));
    std::string text;
    for (const Sector& sector : drive.frame(sectors))
        text += !sector.blocked ? '.' : sector.held ? 'h' : static_cast<char>('0' + sector.nearest_m);
    return text;
}

TEST(Persistence, WhatMovesAsideLeavesNoTrail) {
    for (const std::vector<std::string>& frames : {
             std::vector<std::string>{".4....", "..4...", "...4..", "....4."},
             {"....4.", "...4..", "..4...", ".4...."},
             {".444...", "..444..", "...444.", "....444"},
             {"...444.", "..444..", ".444...", "444...."},
         }) {
        Drive drive;
        for (const std::string& frame : frames)
            EXPECT_EQ(shown(drive, frame), frame);
    }
}

TEST(Persistence, NeighboursThatShowedItBeforeTakeNothingOver) {
    Drive drive;
    shown(drive, ".444.");
    EXPECT_EQ(shown(drive, ".4.4."), ".4h4.");
    EXPECT_EQ(shown(drive, ".444."), ".444.");
    EXPECT_EQ(shown(drive, ".44.."), ".44h.");
    // What appears beside it at another range is another thing, and so is what lies apart.
    drive.persistence.reset();
    shown(drive, ".4...");
    EXPECT_EQ(shown(drive, "..7.."), ".h7..");
    drive.persistence.reset();
    shown(drive, ".4...");
    EXPECT_EQ(shown(drive, "...4."), ".h.4.");
}

TEST(Persistence, RefusesWhatCannotBeCounted) {
    EXPECT_THROW(Persistence(config_of(0, 3)), Refusal);
    EXPECT_THROW(Persistence(config_of(4, 3)), Refusal);
    EXPECT_THROW(Persistence(config_of(2, 33)), Refusal);
}

// Random sequences against what must hold whatever they are.
TEST(Persistence, HoldsNothingThatWasNotSeenAndHidesNothingThatIs) {
    constexpr std::size_t kSectors = 12;
    std::mt19937 random(7);
    const auto below = [&](std::uint32_t limit) { return random() % limit; };
    int held = 0;
    for (int sequence = 0; sequence < 200; ++sequence) {
        const int frames = 1 + static_cast<int>(below(4));
        const int window = frames + static_cast<int>(below(4));
        Drive drive(frames, window);
        Drive again(frames, window);
        std::vector<std::vector<Sector>> history;
        std::size_t since = 0;  // first frame that may be remembered
        for (std::size_t t = 0; t < 40; ++t) {
            std::vector<Sector> given;
            for (std::size_t i = 0; i < kSectors; ++i) {
                const double range_m = 1.0 + below(8);
                const std::uint32_t kind = below(8);
                given.push_back(kind < 4   ? free_to(0.5 + below(12))
                                : kind < 6 ? thing_at(range_m)
                                : kind < 7 ? thing_at(range_m, TerrainClass::kDrop)
                                           : thing_at(range_m, TerrainClass::kUnknown));
            }
            const bool blind = below(20) == 0;
            const std::int64_t after_ns = below(20) == 0 ? 600'000'000 : below(20) == 0 ? -1 : kFrameNs;
            const Verdict verdict = blind ? Verdict::kBlind : Verdict::kTrusted;
            const Sectors now = drive.frame(given, verdict, after_ns);
            const Sectors same = again.frame(given, verdict, after_ns);
            if (after_ns != kFrameNs) since = t;
            if (blind) since = t + 1;
            history.push_back(given);
            for (std::size_t i = 0; i < kSectors; ++i) {
                const Sector& sector = now[i];
                ASSERT_EQ(sector.held, same[i].held);
                ASSERT_EQ(sector.nearest_m, same[i].nearest_m);
                ASSERT_LE(sector.free_range_m, given[i].free_range_m);
                if (given[i].blocked) {
                    ASSERT_TRUE(sector.blocked);
                    ASSERT_LE(sector.nearest_m, given[i].nearest_m);
                }
                if (!sector.held) {
                    ASSERT_EQ(sector.blocked, given[i].blocked);
                    ASSERT_EQ(sector.nearest_m, given[i].nearest_m);
                    continue;
                }
                ++held;
                ASSERT_LE(sector.free_range_m, sector.nearest_m);
                // Seen like this in this very sector, and less than clear_frames times absent since.
                std::optional<std::size_t> seen_at;
                for (std::size_t s = since; s < t; ++s)
                    if (history[s][i].blocked && history[s][i].kind == sector.kind &&
                        history[s][i].nearest_m == sector.nearest_m)
                        seen_at = s;
                ASSERT_TRUE(seen_at.has_value());
                ASSERT_LT(t - *seen_at, static_cast<std::size_t>(frames));
            }
        }
    }
    EXPECT_GT(held, 1000);
}

}  // namespace
}  // namespace groundline::terrain
