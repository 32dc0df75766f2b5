#include "terrain/hough.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "terrain/plane_fit.hpp"
#include "unit/terrain_scene.hpp"

namespace groundline::terrain {
namespace {

using test::Dice;

constexpr int kRows = 240;
constexpr int kBins = 193;  // 0 .. 96 px in half pixels

struct Bench {
    Arena arena;
    RowHistogram histogram;
    LineGate gate;
    Hough hough;

    Bench() {
        histogram.cells = arena.image<std::uint16_t>(kBins, kRows);
        histogram.row_step = 2.0;
        histogram.bins_per_px = 2.0;
        gate.horizon_first = -200.0;
        gate.horizon_step = 4.0;
        gate.rows_per_step = 2;
        gate.count = 96;
        gate.bottom_row = 479.0;
        gate.slope_min = arena.take<double>(Hough::kMaxHorizons);
        gate.slope_max = arena.take<double>(Hough::kMaxHorizons);
        std::fill(gate.slope_min.begin(), gate.slope_min.end(), 0.02);
        std::fill(gate.slope_max.begin(), gate.slope_max.end(), 0.8);
        hough.take(arena, kRows + 200);
    }
    // `pixels` of each row from `first` to `last` on the line.
    void draw(const Line& line, int pixels, double first = 0.0, double last = 480.0) {
        for (int i = 0; i < kRows; ++i) {
            const double row = histogram.row_of(i);
            const double d_px = line.at(row);
            if (row < first || row > last || d_px < 1.0 || d_px >= 95.0) continue;
            histogram.cells.at(static_cast<int>(std::floor(2.0 * d_px + 0.5)), i) +=
                static_cast<std::uint16_t>(16 * pixels);
        }
    }
    void draw_wall(double d_px, int pixels, double first, double last) {
        for (int i = 0; i < kRows; ++i)
            if (histogram.row_of(i) >= first && histogram.row_of(i) <= last)
                histogram.cells.at(static_cast<int>(2.0 * d_px), i) +=
                    static_cast<std::uint16_t>(16 * pixels);
    }
    HoughResult find(LineMode mode = LineMode::kVotes) {
        return hough.find(histogram, gate, 192.0, 20 * 16, mode);
    }
};

void expect_line(const Line& found, const Line& truth, double tolerance_px) {
    for (const double row : {300.0, 400.0, 479.0})
        if (truth.at(row) < 95.0) {
            EXPECT_NEAR(found.at(row), truth.at(row), tolerance_px) << row;
        }
}

TEST(Hough, FindsTheLineThatWasDrawn) {
    Dice dice(1);
    for (int trial = 0; trial < 50; ++trial) {
        Bench bench;
        const Line truth{dice.between(-150, 180), dice.between(0.05, 0.3)};
        bench.draw(truth, 20);
        const HoughResult result = bench.find();
        ASSERT_GE(result.count, 1);
        expect_line(result.lines[0], truth, 1.5);
        const Line refined = refine_line(bench.histogram, result.lines[0], 20 * 16);
        expect_line(refined, truth, 0.25);  // half a bin
    }
}

TEST(Hough, PeaksAreDifferentLinesByVotes) {
    Bench bench;
    const Line strong{100.0, 0.25};
    const Line weak{-50.0, 0.06};
    bench.draw(strong, 20);
    bench.draw(weak, 10);
    const HoughResult result = bench.find();
    ASSERT_GE(result.count, 2);
    expect_line(result.lines[0], strong, 1.5);
    expect_line(result.lines[1], weak, 2.0);
    EXPECT_GT(result.votes[0], result.votes[1]);
    for (int i = 0; i < result.count; ++i)
        for (int j = 0; j < i; ++j) {
            const Line& one = result.lines[static_cast<std::size_t>(i)];
            const Line& other = result.lines[static_cast<std::size_t>(j)];
            const double middle = 0.5 * (479.0 + other.horizon_row);
            EXPECT_GT(std::max(std::fabs(one.at(479.0) - other.at(479.0)),
                               std::fabs(one.at(middle) - other.at(middle))),
                      3.0)
                << i << " " << j;
        }
}

TEST(Hough, AWallOutvotesNothingInsideTheGate) {
    Bench bench;
    const Line ground{150.0, 0.2};
    bench.draw(ground, 20, 200.0);
    bench.draw_wall(30.0, 500, 0.0, 290.0);  // 25 times the pixels in a row
    const HoughResult result = bench.find();
    ASSERT_GE(result.count, 1);
    expect_line(result.lines[0], ground, 1.5);
}

TEST(Hough, LinesOutsideTheGateAreNotConsidered) {
    Bench bench;
    const Line outside{150.0, 0.2};
    bench.draw(outside, 20);
    std::fill(bench.gate.slope_min.begin(), bench.gate.slope_min.end(), 0.3);
    const HoughResult result = bench.find();
    for (int i = 0; i < result.count; ++i)
        EXPECT_GE(result.lines[static_cast<std::size_t>(i)].slope, 0.3 * 0.9);
    Bench empty;
    EXPECT_EQ(empty.find().count, 0);
}

// The paper's choice: the longest segment wins over the one with more votes.
TEST(Hough, LongestSegmentIsChosenByLength) {
    Bench bench;
    const Line longest{100.0, 0.15};
    const Line heavy{200.0, 0.32};
    bench.draw(longest, 4);
    bench.draw(heavy, 40, 380.0);
    const HoughResult by_votes = bench.find(LineMode::kVotes);
    const HoughResult by_length = bench.find(LineMode::kLongest);
    ASSERT_GE(by_votes.count, 1);
    ASSERT_GE(by_length.count, 1);
    EXPECT_NEAR(by_votes.lines[0].at(430.0), heavy.at(430.0), 2.0);
    EXPECT_GT(longest_segment(bench.histogram, by_length.lines[0], 12.0, 64),
              longest_segment(bench.histogram, by_votes.lines[0], 12.0, 64));
    expect_line(by_length.lines[0], longest, 2.0);
}

TEST(Hough, SegmentsBridgeShortGapsOnly) {
    Bench bench;
    const Line line{100.0, 0.2};
    bench.draw(line, 20, 300.0, 400.0);
    bench.draw(line, 20, 410.0, 478.0);
    EXPECT_NEAR(longest_segment(bench.histogram, line, 12.0, 64), 180.0, 2.0);
    EXPECT_NEAR(longest_segment(bench.histogram, line, 4.0, 64), 102.0, 2.0);
    // A row whose mass lies elsewhere supports nothing: less than a tenth of it is near the line.
    bench.draw_wall(80.0, 250, 380.0, 480.0);
    EXPECT_NEAR(longest_segment(bench.histogram, line, 12.0, 64), 80.0, 2.0);
}

// The covariance must speak of errors that neighbours share. Errors of patches of 16 x 16 px; the variance
// the fit states, less the 0.05 px it adds for what no frame shows, against the errors made.
TEST(PlaneFit, CovarianceCoversErrorsThatNeighboursShare) {
    constexpr int kWidth = 320;
    constexpr int kHeight = 240;
    constexpr int kTrials = 60;
    Arena arena;
    PlaneFit fit;
    fit.take(arena, kWidth, kHeight);
    const DisparityMap map = DisparityMap::make(arena, kWidth, kHeight);
    const DisparityPlane truth{0.01, 0.2, 5.0};
    Serial serial;
    double ratio = 0.0;
    Dice dice(3);
    for (int trial = 0; trial < kTrials; ++trial) {
        double patch[kWidth / 16];
        for (int v = 0; v < kHeight; ++v) {
            if (v % 16 == 0)
                for (double& value : patch)
                    value = 0.3 * dice.normal();
            for (int u = 0; u < kWidth; ++u)
                map.disparity_q4.at(u, v) =
                    static_cast<std::int16_t>(std::floor(16.0 * (truth.at(u, v) + patch[u / 16]) + 0.5));
        }
        fit.sample(map, 0.0);
        const PlaneFitResult rough = fit.converge(fit.approach({0.012, 0.19, 6.0}).plane);
        ASSERT_TRUE(rough.found);
        const PlaneFitResult result = fit.fit(rough.plane, serial);
        ASSERT_TRUE(result.found);
        const double x[3] = {160.0, 230.0, 1.0};
        // Without the fixed terms, common and along v, which are not what this is about.
        const double tilt_px = 0.08 * (230.0 - 120.0) / 120.0;
        double variance = -(0.09 * 0.09 + tilt_px * tilt_px);
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 3; ++j)
                variance += x[i] * result.covariance[3 * i + j] * x[j];
        ASSERT_GT(variance, 0.0);
        const double error = result.plane.at(160.0, 230.0) - truth.at(160.0, 230.0);
        ratio += error * error / variance / kTrials;
    }
    // Tiles and strips both count the same errors, so the statement is cautious by up to a factor of 2 to 3.
    EXPECT_LT(ratio, 1.3);
    EXPECT_GT(ratio, 0.1);
}

}  // namespace
}  // namespace groundline::terrain
