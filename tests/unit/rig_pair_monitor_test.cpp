// The pair monitor: known shifts, exchanged views, rows that are off, blur, on textures and on every real
// set.
#include "rig/pair_monitor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "rig/photometric.hpp"
#include "support/allocation_count.hpp"
#include "support/random_images.hpp"

namespace groundline::rig {
namespace {

namespace fs = std::filesystem;
using groundline::test::OwnedLuma;
using groundline::test::OwnedPair;

RectifiedRig rig_of(int width, int height, double offset_px = 0.0, bool calibrated = true) {
    RectifiedRig rig;
    rig.width = width;
    rig.height = height;
    rig.calibrated = calibrated;
    rig.focal_px = 500.0;
    rig.baseline_m = 0.1;
    rig.cx_px = 0.5 * width + offset_px;
    rig.cx_right_px = 0.5 * width;
    rig.cy_px = 0.5 * height;
    return rig;
}

PairEvidence measured(ConstLuma left, ConstLuma right, const RectifiedRig& rig, int min_disparity = 0,
                      int disparities = 64) {
    Arena arena;
    Serial serial;
    PairMonitor monitor(rig, min_disparity, disparities, {}, {}, arena);
    const double gain = measure_photometric(left, right, serial).gain;
    return monitor.measure(left, right, gain, serial);
}
PairEvidence measured(const OwnedPair& pair, double offset_px = 0.0) {
    return measured(pair.left.view(), pair.right.view(),
                    rig_of(pair.left.width(), pair.left.height(), offset_px));
}

OwnedLuma blurred(const OwnedLuma& image, double sigma) {
    OwnedLuma result(image.width(), image.height());
    const Luma to = result.view();
    const ConstLuma from = image.view();
    cv::Mat out(to.height, to.width, CV_8U, to.data, static_cast<std::size_t>(to.stride));
    // OpenCV takes no pointer to const; it only reads.
    const cv::Mat in(from.height, from.width, CV_8U, const_cast<std::uint8_t*>(from.data),  // NOLINT
                     static_cast<std::size_t>(from.stride));
    cv::GaussianBlur(in, out, {}, sigma);
    return result;
}

// left(x, y) = right(x - disparity(x, y), y), cut out of a texture as smooth as a lens makes it, so that what
// lies between its pixels is known.
template <typename Disparity>
OwnedPair seen_pair(int width, int height, std::uint32_t seed, Disparity disparity) {
    constexpr int kMargin = 80;
    const OwnedLuma texture =
        blurred(groundline::test::textured_image(width + 2 * kMargin, height, seed), 1.0);
    OwnedPair pair{OwnedLuma(width, height), OwnedLuma(width, height)};
    pair.right.fill([&](int x, int y) { return texture.at(x + kMargin, y); });
    pair.left.fill([&](int x, int y) {
        const double from = x + kMargin - static_cast<double>(disparity(x, y));
        const int before = static_cast<int>(std::floor(from));
        const double share = from - before;
        return static_cast<int>((1 - share) * texture.at(before, y) + share * texture.at(before + 1, y) +
                                0.5);
    });
    return pair;
}
OwnedPair seen_at(double disparity_px, int width = 640, int height = 480) {
    return seen_pair(width, height, 1, [=](int, int) { return disparity_px; });
}

// Near below, far above, as on a road.
OwnedPair road(std::uint32_t seed, int width = 640, int height = 480) {
    return seen_pair(width, height, seed, [=](int, int y) { return 4.0 + 40.0 * y / height; });
}

// Rows move down by `rows`.
OwnedLuma moved(const OwnedLuma& image, int rows) {
    OwnedLuma result(image.width(), image.height());
    result.fill([&](int x, int y) { return image.at(x, std::clamp(y - rows, 0, image.height() - 1)); });
    return result;
}

TEST(PairMonitor, ARoadIsNearerThanInfinityInItsRowsAndSharp) {
    for (std::uint32_t seed = 1; seed <= 5; ++seed) {
        const PairEvidence evidence = measured(road(seed));
        EXPECT_GE(evidence.features, 80) << seed;
        EXPECT_EQ(evidence.behind_share, 0.0) << seed;
        EXPECT_GE(evidence.row_features, 80) << seed;
        EXPECT_NEAR(evidence.row_offset_px, 0.0, 0.03) << seed;
        // Reading between pixels has softened the left view a little.
        EXPECT_NEAR(evidence.left_sharper, 1.0, 0.1) << seed;
        EXPECT_NEAR(evidence.right_sharper, 1.0, 0.1) << seed;
    }
}

TEST(PairMonitor, ExchangedViewsLieBeyondInfinity) {
    for (std::uint32_t seed = 1; seed <= 5; ++seed) {
        OwnedPair pair = road(seed);
        std::swap(pair.left, pair.right);
        const PairEvidence evidence = measured(pair);
        EXPECT_GE(evidence.features, 80) << seed;
        EXPECT_EQ(evidence.behind_share, 1.0) << seed;
    }
}

// What counts is infinity, not zero: with principal points 30 px apart a disparity of -10 is near.
TEST(PairMonitor, InfinityIsWhereThePrincipalPointsSay) {
    const OwnedPair near = seen_at(-10.0);
    EXPECT_EQ(measured(near, -30.0).behind_share, 0.0);
    EXPECT_EQ(measured(near, 0.0).behind_share, 1.0);
    const OwnedPair behind = seen_at(10.0);
    EXPECT_EQ(measured(behind, 30.0).behind_share, 1.0);
    EXPECT_EQ(measured(behind, 0.0).behind_share, 0.0);
}

// Without calibration the operator's range says where infinity may be.
TEST(PairMonitor, WithoutCalibrationTheSearchRangeSaysWhereInfinityMayBe) {
    const OwnedPair pair = seen_at(-10.0);
    const RectifiedRig rig = rig_of(640, 480, 0.0, false);
    EXPECT_EQ(measured(pair.left.view(), pair.right.view(), rig, 0).behind_share, 1.0);
    EXPECT_EQ(measured(pair.left.view(), pair.right.view(), rig, -32).behind_share, 0.0);
}

TEST(PairMonitor, NearInfinityTheSignSaysNothing) {
    for (const double disparity : {-1.5, -0.5, 0.0, 1.0}) {
        const PairEvidence evidence = measured(seen_at(disparity));
        EXPECT_EQ(evidence.features, 0) << disparity;
        EXPECT_GE(evidence.matched, 80) << disparity;
    }
}

TEST(PairMonitor, MeasuresHowFarTheRowsAreOff) {
    for (int rows = -4; rows <= 4; ++rows) {
        OwnedPair pair = road(7);
        pair.right = moved(pair.right, rows);
        const PairEvidence evidence = measured(pair);
        EXPECT_GE(evidence.row_features, 20) << rows;
        EXPECT_NEAR(evidence.row_offset_px, rows, 0.05) << rows;
        EXPECT_LT(evidence.row_sigma_px, 0.05) << rows;
    }
}

TEST(PairMonitor, MeasuresPartsOfARow) {
    for (const double rows : {-0.75, -0.5, -0.25, 0.25, 0.5, 0.75}) {
        // Smooth enough that what lies between the rows is known.
        OwnedPair pair = road(8);
        const OwnedLuma right = blurred(pair.right, 1.5);
        pair.left = blurred(pair.left, 1.5);
        pair.right.fill([&](int x, int y) {
            const double from = std::clamp(y - rows, 0.0, 478.0);
            const int above = static_cast<int>(from);
            const double share = from - above;
            return static_cast<int>((1 - share) * right.at(x, above) + share * right.at(x, above + 1) + 0.5);
        });
        EXPECT_NEAR(measured(pair).row_offset_px, rows, 0.06) << rows;
    }
}

TEST(PairMonitor, BlurOfOneViewShowsOnItsSide) {
    for (std::uint32_t seed = 1; seed <= 3; ++seed) {
        const OwnedPair sharp = road(seed);
        const PairEvidence right = measured(OwnedPair{sharp.left, blurred(sharp.right, 2.0)});
        EXPECT_GT(right.left_sharper, 1.12) << seed;
        EXPECT_LT(right.right_sharper, 0.5) << seed;
        const PairEvidence left = measured(OwnedPair{blurred(sharp.left, 2.0), sharp.right});
        EXPECT_GT(left.right_sharper, 1.12) << seed;
        EXPECT_LT(left.left_sharper, 0.5) << seed;
        // Both alike: no camera is worse.
        const PairEvidence both = measured(OwnedPair{blurred(sharp.left, 2.0), blurred(sharp.right, 2.0)});
        EXPECT_NEAR(both.left_sharper, 1.0, 0.1) << seed;
        EXPECT_NEAR(both.right_sharper, 1.0, 0.1) << seed;
    }
}

TEST(PairMonitor, NeitherGainNorNoiseIsBlur) {
    for (const double gain : {0.6, 0.8, 1.25}) {
        OwnedPair pair = road(2);
        for (OwnedLuma* image : {&pair.left, &pair.right})
            image->fill([&](int x, int y) { return 60 + image->at(x, y) / 2; });
        groundline::test::change_exposure(pair.right, gain, 5);
        const PairEvidence evidence = measured(pair);
        EXPECT_NEAR(evidence.left_sharper, 1.0, 0.1) << gain;
        EXPECT_NEAR(evidence.right_sharper, 1.0, 0.1) << gain;
    }
    for (const int side : {0, 1, 2}) {
        OwnedPair pair = road(4);
        if (side != 0) groundline::test::add_noise(pair.left, 1, 20);
        if (side != 1) groundline::test::add_noise(pair.right, 2, 20);
        const PairEvidence evidence = measured(pair);
        EXPECT_LT(evidence.left_sharper, 1.05) << side;
        EXPECT_LT(evidence.right_sharper, 1.05) << side;
    }
}

TEST(PairMonitor, WhereNothingCanBeFollowedNothingIsSaid) {
    OwnedLuma plain(320, 240);
    plain.fill([](int, int) { return 128; });
    const PairEvidence nothing = measured(OwnedPair{plain, plain});
    EXPECT_EQ(nothing.patches, 0);
    EXPECT_EQ(nothing.row_features, 0);
    const PairEvidence noise = measured(
        OwnedPair{groundline::test::noise_image(320, 240, 1), groundline::test::noise_image(320, 240, 2)});
    EXPECT_GE(noise.patches, 50);
    EXPECT_EQ(noise.matched, 0);
}

// A fence: every post matches as well as its neighbours.
TEST(PairMonitor, ARepeatedPatternSaysNothing) {
    const OwnedLuma posts = blurred(groundline::test::textured_image(24, 480, 6), 1.0);
    OwnedPair fence{OwnedLuma(640, 480), OwnedLuma(640, 480)};
    fence.left.fill([&](int x, int y) { return posts.at(x % 24, y); });
    fence.right.fill([&](int x, int y) { return posts.at((x + 10) % 24, y); });
    const PairEvidence evidence = measured(fence);
    EXPECT_GE(evidence.patches, 80);
    EXPECT_EQ(evidence.matched, 0);
}

// The right half is the robot itself, of a texture that lies beyond infinity.
TEST(PairMonitor, LooksAtNoExcludedPixel) {
    const OwnedPair pair = seen_pair(640, 480, 5, [](int x, int) { return x < 320 ? 20 : -20; });
    OwnedLuma body(640, 480);
    body.fill([](int x, int) { return x >= 320 ? 9 : 0; });
    const RectifiedRig rig = rig_of(640, 480);
    Arena arena;
    Serial serial;
    PairMonitor open(rig, 0, 64, {}, {}, arena);
    const PairEvidence all = open.measure(pair.left.view(), pair.right.view(), 1.0, serial);
    EXPECT_GT(all.behind_share, 0.3);
    PairMonitor closed(rig, 0, 64, body.view(), {}, arena);
    const PairEvidence some = closed.measure(pair.left.view(), pair.right.view(), 1.0, serial);
    EXPECT_GE(some.features, 20);
    EXPECT_EQ(some.behind_share, 0.0);
    // In the right view the left half's patches lie 20 px further left.
    PairMonitor right(rig, 0, 64, {}, body.view(), arena);
    const PairEvidence seen = right.measure(pair.left.view(), pair.right.view(), 1.0, serial);
    EXPECT_GE(seen.features, 20);
    EXPECT_EQ(seen.behind_share, 0.0);
}

// Lanes that take the tasks in another order.
class Backwards final : public Parallel {
  public:
    int lanes() const override { return 3; }
    void for_each(int count, FunctionRef<void(int, int)> task) override {
        for (int index = count - 1; index >= 0; --index)
            task(index, index % 3);
    }
};

TEST(PairMonitor, TheSameForAnyLanesAndFromFrameToFrame) {
    const RectifiedRig rig = rig_of(640, 480);
    Arena arena;
    PairMonitor monitor(rig, 0, 64, {}, {}, arena);
    Serial serial;
    Backwards backwards;
    const OwnedPair one = road(1);
    const OwnedPair other = road(2);
    const auto same = [](const PairEvidence& a, const PairEvidence& b) {
        return a.patches == b.patches && a.matched == b.matched && a.features == b.features &&
               a.behind_share == b.behind_share && a.row_features == b.row_features &&
               a.row_offset_px == b.row_offset_px && a.row_sigma_px == b.row_sigma_px &&
               a.left_sharper == b.left_sharper && a.right_sharper == b.right_sharper;
    };
    const PairEvidence first = monitor.measure(one.left.view(), one.right.view(), 1.0, serial);
    const PairEvidence between = monitor.measure(other.left.view(), other.right.view(), 1.0, serial);
    EXPECT_FALSE(same(first, between));
    EXPECT_TRUE(same(first, monitor.measure(one.left.view(), one.right.view(), 1.0, backwards)));
}

TEST(PairMonitor, AllocatesNothing) {
    const RectifiedRig rig = rig_of(640, 480);
    Arena arena;
    PairMonitor monitor(rig, 0, 64, {}, {}, arena);
    arena.seal();
    Serial serial;
    const OwnedPair pair = road(1);
    const OwnedLuma low = moved(pair.right, 4);
    const std::uint64_t before = groundline::test::allocations();
    const PairEvidence level = monitor.measure(pair.left.view(), pair.right.view(), 1.0, serial);
    const PairEvidence off = monitor.measure(pair.left.view(), low.view(), 1.0, serial);
    EXPECT_EQ(groundline::test::allocations(), before);
    EXPECT_GT(level.features + off.features, 0);
}

// Every scale of shrinking, odd sizes, and sizes with no room for a search.
TEST(PairMonitor, AnySizeIsSafe) {
    for (const auto& [width, height] : {std::pair{32, 32},
                                        {33, 47},
                                        {161, 97},
                                        {641, 479},
                                        {1001, 701},
                                        {1299, 977},
                                        {2001, 1203},
                                        {2600, 40}}) {
        const OwnedPair pair = seen_at(6.0, width, height);
        const PairEvidence evidence =
            measured(pair.left.view(), pair.right.view(), rig_of(width, height), 0, 256);
        EXPECT_EQ(evidence.behind_share, 0.0) << width << ' ' << height;
        if (width >= 161 && height >= 97) {
            EXPECT_GE(evidence.features, 40) << width << ' ' << height;
        }
    }
}

// --- real pairs

struct RealPair {
    std::string name;
    cv::Mat left, right;
    double offset_px = 0.0;
    bool calibrated = false;
};

ConstLuma view(const cv::Mat& image) {
    return {image.data, image.cols, image.rows, static_cast<std::ptrdiff_t>(image.step[0])};
}

double offset_of(const fs::path& file) {
    std::ifstream text(file);
    std::string word;
    double cx[2] = {0.0, 0.0};
    while (text >> word)
        if (word == "P0:" || word == "P1:") {
            double p = 0.0;
            for (int i = 0; i < 12; ++i) {
                text >> p;
                if (i == 2) cx[word == "P1:" ? 1 : 0] = p;
            }
        }
    return cx[0] - cx[1];
}

std::vector<RealPair> real_pairs() {
    const fs::path data = fs::path(GROUNDLINE_SOURCE_DIR) / "../shared/data";
    std::vector<RealPair> pairs;
    if (!fs::exists(data)) return pairs;
    for (const auto& set : fs::directory_iterator(data)) {
        const std::string name = set.path().filename().string();
        if (name.rfind("calib_", 0) == 0 || !set.is_directory()) continue;
        RealPair pair{name, {}, {}, 0.0, fs::exists(set.path() / "calib.txt")};
        if (pair.calibrated) pair.offset_px = offset_of(set.path() / "calib.txt");
        std::vector<fs::path> lefts;
        if (fs::exists(set.path() / "left.png"))
            lefts.push_back(set.path() / "left.png");
        else
            for (const auto& file : fs::directory_iterator(set.path() / "left"))
                lefts.push_back(file.path());
        for (const fs::path& left : lefts) {
            const fs::path right =
                lefts.size() == 1 ? set.path() / "right.png" : set.path() / "right" / left.filename();
            pair.left = cv::imread(left.string(), cv::IMREAD_GRAYSCALE);
            pair.right = cv::imread(right.string(), cv::IMREAD_GRAYSCALE);
            if (!pair.left.empty() && pair.left.size() == pair.right.size()) pairs.push_back(pair);
        }
    }
    return pairs;
}

PairEvidence measured(const RealPair& pair, const cv::Mat& left, const cv::Mat& right) {
    const RectifiedRig rig = rig_of(left.cols, left.rows, pair.offset_px, pair.calibrated);
    return measured(view(left), view(right), rig, 0, std::clamp((left.cols / 6 + 15) / 16 * 16, 32, 256));
}

// The limits that the verdict sets, see verdict::Limits.
bool seems_exchanged(const PairEvidence& e) {
    return e.features >= 6 && e.behind_share > 0.35;
}
bool seems_off(const PairEvidence& e) {
    return e.row_features >= 8 && std::abs(e.row_offset_px) - 2.0 * e.row_sigma_px > 0.4;
}
bool seems_blurred(const PairEvidence& e) {
    const double more = std::max(e.left_sharper, e.right_sharper);
    return e.row_features >= 8 && more > 1.08 && more > 1.8 * std::min(e.left_sharper, e.right_sharper);
}

TEST(PairMonitorReal, EveryPairIsKnownFromItsExchangedOne) {
    const std::vector<RealPair> pairs = real_pairs();
    if (pairs.empty()) GTEST_SKIP() << "no real pairs beside the repository";
    for (const RealPair& pair : pairs) {
        const PairEvidence right_way = measured(pair, pair.left, pair.right);
        const PairEvidence exchanged = measured(pair, pair.right, pair.left);
        EXPECT_FALSE(seems_exchanged(right_way)) << pair.name << ' ' << right_way.behind_share;
        EXPECT_TRUE(seems_exchanged(exchanged))
            << pair.name << ' ' << exchanged.features << ' ' << exchanged.behind_share;
    }
}

// Of the published sets only those of the Devon rover have rows that are off, by 0.6 px.
TEST(PairMonitorReal, OnlyTheRowsOfTheDevonRoverAreOff) {
    const std::vector<RealPair> pairs = real_pairs();
    if (pairs.empty()) GTEST_SKIP() << "no real pairs beside the repository";
    for (const RealPair& pair : pairs) {
        const PairEvidence evidence = measured(pair, pair.left, pair.right);
        const bool devon = pair.name.rfind("devon", 0) == 0;
        EXPECT_EQ(seems_off(evidence), devon)
            << pair.name << ' ' << evidence.row_offset_px << " +- " << evidence.row_sigma_px;
        if (devon) {
            EXPECT_NEAR(evidence.row_offset_px, -0.6, 0.1) << pair.name;
        }
    }
}

TEST(PairMonitorReal, BlurOfOneViewIsSeenAndNothingElseTakenForIt) {
    const std::vector<RealPair> pairs = real_pairs();
    if (pairs.empty()) GTEST_SKIP() << "no real pairs beside the repository";
    int judged = 0;
    int missed = 0;
    for (const RealPair& pair : pairs) {
        EXPECT_FALSE(seems_blurred(measured(pair, pair.left, pair.right))) << pair.name;
        cv::Mat other;
        pair.right.convertTo(other, -1, 0.7, 5.0);
        EXPECT_FALSE(seems_blurred(measured(pair, pair.left, other))) << pair.name << ", darker";
        for (const bool left : {false, true}) {
            cv::GaussianBlur(left ? pair.left : pair.right, other, {}, 2.0);
            const PairEvidence evidence =
                left ? measured(pair, other, pair.right) : measured(pair, pair.left, other);
            if (evidence.row_features < 8) continue;
            ++judged;
            if (!seems_blurred(evidence)) {
                ++missed;
                std::printf("%s: blur not seen, %.2f and %.2f\n", pair.name.c_str(), evidence.left_sharper,
                            evidence.right_sharper);
            }
        }
    }
    EXPECT_GE(judged, 100);
    // An indoor camera that is out of focus itself leaves little to lose.
    EXPECT_LE(missed, judged / 50);
}

}  // namespace
}  // namespace groundline::rig
