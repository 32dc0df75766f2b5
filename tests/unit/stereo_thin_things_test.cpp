// Thin things before a far background: what of a pole the census matchers see, and that they see none where
// there is none.
#include <gtest/gtest.h>

#include <cstdlib>

#include "unit/stereo_test_tools.hpp"

namespace groundline::stereo {
namespace {

using test::OwnedLuma;
using test::OwnedPair;

constexpr int kWidth = 240;
constexpr int kHeight = 160;
constexpr int kNear = 40;  // disparity of the pole, px
constexpr int kFar = 10;   // ... and of what is behind it

// Adds noise of standard deviation 2: the sum of two independent uniform -2 .. 2.
void add_grain(OwnedLuma& image, std::uint32_t seed) {
    test::add_noise(image, seed, 2);
    test::add_noise(image, seed + 1, 2);
}

struct Pole {
    int x;  // first column in the left view
    int width;
    int top;
    int bottom;
};

Pole pole_of(int width, int rows, std::uint32_t seed) {
    const int top = (kHeight - rows) / 2 + static_cast<int>(seed % 4);
    return {120 + static_cast<int>(seed % 7), width, top, top + rows};
}

OwnedPair pole_pair(const Pole& pole, std::uint32_t seed) {
    const OwnedLuma far = test::textured_image(kWidth + kFar, kHeight, 1000 + seed);
    const OwnedLuma near = test::textured_image(pole.width, kHeight, 2000 + seed);
    OwnedPair pair{OwnedLuma(kWidth, kHeight), OwnedLuma(kWidth, kHeight)};
    const auto draw = [&](OwnedLuma& view, int first, int shift) {
        view.fill([&](int x, int y) {
            const bool on_pole = x >= first && x < first + pole.width && y >= pole.top && y < pole.bottom;
            return on_pole ? near.at(x - first, y) : far.at(x + shift, y);
        });
    };
    draw(pair.left, pole.x, 0);
    draw(pair.right, pole.x - kNear, kFar);
    add_grain(pair.left, 3000 + 10 * seed);
    add_grain(pair.right, 3005 + 10 * seed);
    return pair;
}

MatcherConfig config_of(MatcherKind kind, int speckle_px = CheckLimits{}.speckle_px) {
    MatcherConfig config;
    config.kind = kind;
    config.limits.speckle_px = speckle_px;
    return config;
}

// Of a pole, percent.
struct Seen {
    double right = 0.0;   // of its pixels within 1 px
    double behind = 0.0;  // of its pixels at the background's disparity
    double rows = 0.0;    // of its rows, those with two right pixels
};

Seen seen_of(const MatcherConfig& config, int width, int rows, std::uint32_t seed) {
    const Pole pole = pole_of(width, rows, seed);
    const OwnedPair pair = pole_pair(pole, seed);
    const OwnedResult result = match_fast(config, pair.left.view(), pair.right.view());
    int right = 0;
    int behind = 0;
    int seen_rows = 0;
    for (int y = pole.top; y < pole.bottom; ++y) {
        const int right_before = right;
        for (int x = pole.x; x < pole.x + pole.width; ++x) {
            if (result.reason(x, y) != Invalid::kNone) continue;
            const int disparity_q4 = result.map.disparity_q4.at(x, y);
            right += std::abs(disparity_q4 - kDisparityOne * kNear) <= kDisparityOne ? 1 : 0;
            behind += std::abs(disparity_q4 - kDisparityOne * kFar) <= 2 * kDisparityOne ? 1 : 0;
        }
        seen_rows += right - right_before >= 2 ? 1 : 0;
    }
    const double pixels = pole.width * rows;
    return {100.0 * right / pixels, 100.0 * behind / pixels, 100.0 * seen_rows / rows};
}

// Mean over ten scenes.
Seen mean_of(const MatcherConfig& config, int width, int rows) {
    constexpr std::uint32_t kScenes = 10;
    Seen mean;
    double least_rows = 100.0;
    for (std::uint32_t seed = 1; seed <= kScenes; ++seed) {
        const Seen seen = seen_of(config, width, rows, seed);
        mean.right += seen.right / kScenes;
        mean.behind += seen.behind / kScenes;
        mean.rows += seen.rows / kScenes;
        least_rows = std::min(least_rows, seen.rows);
    }
    std::printf(
        "%s, pole %d px wide, %d rows, speckles of %d px: %.1f %% of its pixels right, %.1f %% as behind "
        "it, two in %.1f %% of its rows (worst scene %.1f)\n",
        config.kind == MatcherKind::kCensus ? "census" : "pyramid", width, rows, config.limits.speckle_px,
        mean.right, mean.behind, mean.rows, least_rows);
    return mean;
}

// The outer columns and the ends of a pole share every window with what is behind it and go to that.
TEST(ThinThings, ATallPoleIsFoundInMostOfItsRows) {
    struct Expected {
        int width;
        double right;
        double behind;
        double rows;
    };
    for (const Expected& expected :
         {Expected{5, 68.0, 27.0, 76.0}, Expected{6, 74.0, 23.0, 82.0}, Expected{8, 76.0, 22.0, 84.0}}) {
        const Seen seen = mean_of(config_of(MatcherKind::kCensusPyramid), expected.width, 120);
        EXPECT_GE(seen.right, expected.right) << expected.width << " px";
        EXPECT_LE(seen.behind, expected.behind) << expected.width << " px";
        EXPECT_GE(seen.rows, expected.rows) << expected.width << " px";
        // The whole matcher at full resolution lets its paths run over it.
        EXPECT_LT(mean_of(config_of(MatcherKind::kCensus), expected.width, 120).right, seen.right);
    }
    mean_of(config_of(MatcherKind::kCensusPyramid), 4, 120);
}

TEST(ThinThings, OfAPoleOf40RowsTheSpecklesTakeMostOfWhatWasFound) {
    const Seen seen = mean_of(config_of(MatcherKind::kCensusPyramid, 0), 5, 40);
    const Seen left_over = mean_of(config_of(MatcherKind::kCensusPyramid), 5, 40);
    EXPECT_GE(seen.rows, 45.0);
    EXPECT_LT(left_over.rows, seen.rows / 2);
}

// Percent of the answered that are nearer than the truth by more than 3 px.
template <typename Truth>
double invented(MatcherKind kind, const char* scene, const OwnedPair& pair, Truth truth) {
    const OwnedResult result = match_fast(config_of(kind), pair.left.view(), pair.right.view());
    int answered = 0;
    int nearer = 0;
    for (int y = 0; y < pair.left.height(); ++y)
        for (int x = 0; x < pair.left.width(); ++x) {
            if (result.reason(x, y) != Invalid::kNone) continue;
            ++answered;
            nearer += result.map.disparity_q4.at(x, y) > kDisparityOne * (truth(x, y) + 3) ? 1 : 0;
        }
    std::printf("%s, %s: %.1f %% answered, %.3f %% of these too near\n",
                kind == MatcherKind::kCensus ? "census" : "pyramid", scene,
                100.0 * answered / (pair.left.width() * pair.left.height()), 100.0 * nearer / answered);
    return 100.0 * nearer / answered;
}

TEST(ThinThings, NothingIsInventedWhereNothingThinIs) {
    for (const MatcherKind kind : {MatcherKind::kCensus, MatcherKind::kCensusPyramid})
        for (std::uint32_t seed = 1; seed <= 3; ++seed) {
            const auto steps = [](int x, int y) {
                if (x > 160 && y > 50 && y < 110) return 30;
                return x < 80 ? 8 : 14;
            };
            const auto slant = [](int /*x*/, int y) { return 4 + y / 5; };
            OwnedPair stepped = test::warped_pair(kWidth, kHeight, 400 + seed, steps);
            OwnedPair slanted = test::warped_pair(kWidth, kHeight, 410 + seed, slant);
            OwnedPair noise = test::shifted_pair(kWidth, kHeight, 420 + seed, 12);
            OwnedPair weak = test::shifted_pair(kWidth, kHeight, 425 + seed, 12);
            for (OwnedLuma* view : {&weak.left, &weak.right})
                view->fill([&](int x, int y) { return 100 + view->at(x, y) / 32; });
            std::uint32_t grain = 430 + 10 * seed;
            for (OwnedPair* pair : {&stepped, &slanted, &noise, &weak}) {
                add_grain(pair->left, grain++);
                add_grain(pair->right, 100 + grain++);
            }
            test::add_noise(noise.right, 500 + seed, 20);
            EXPECT_LT(invented(kind, "steps", stepped, steps), 0.1);
            EXPECT_LT(invented(kind, "slant", slanted, slant), 0.1);
            EXPECT_LT(invented(kind, "much noise", noise, [](int, int) { return 12; }), 0.1);
            EXPECT_LT(invented(kind, "weak texture", weak, [](int, int) { return 12; }), 1.0);
        }
}

// The hard case: pickets every 16 px look alike, and each is a thin upright thing.
TEST(ThinThings, AFenceIsNotTakenForANearerOne) {
    for (const MatcherKind kind : {MatcherKind::kCensus, MatcherKind::kCensusPyramid})
        for (const bool alike : {true, false}) {
            constexpr int kPeriod = 16;
            constexpr int kPicket = 5;
            constexpr int kFence = 12;
            constexpr int kBehind = 6;
            const OwnedLuma far = test::textured_image(kWidth + kBehind, kHeight, 600);
            const OwnedLuma wood = test::textured_image(kWidth + kFence, kHeight, 601);
            OwnedPair pair{OwnedLuma(kWidth, kHeight), OwnedLuma(kWidth, kHeight)};
            const auto draw = [&](OwnedLuma& view, int fence, int shift) {
                view.fill([&](int x, int y) {
                    const int u = x + fence;
                    if (u % kPeriod >= kPicket) return static_cast<int>(far.at(x + shift, y));
                    return static_cast<int>(wood.at(alike ? u % kPeriod : u, y));
                });
            };
            draw(pair.left, 0, 0);
            draw(pair.right, kFence, kBehind);
            add_grain(pair.left, 602);
            add_grain(pair.right, 604);
            // Behind the gaps the fence's own disparity does not count: a picket's windows reach into them.
            const double share = invented(kind, alike ? "fence of equal pickets" : "fence", pair,
                                          [](int, int) { return kFence; });
            EXPECT_LT(share, alike ? 12.0 : 0.5);
        }
}

}  // namespace
}  // namespace groundline::stereo
