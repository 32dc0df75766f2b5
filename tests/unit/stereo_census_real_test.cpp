// The census matchers on real pairs with truth, where they are at hand.
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>

#include "unit/stereo_real_pairs.hpp"
#include "unit/stereo_test_tools.hpp"

namespace groundline::stereo {
namespace {

constexpr std::array kFrames = {"kitti2012_000000", "kitti2012_000043", "kitti2012_000089"};

MatcherConfig config_of(MatcherKind kind, bool checks) {
    MatcherConfig config;
    config.kind = kind;
    config.disparities = 208;
    config.checks = checks;
    return config;
}

// Pooled over all pixels with truth of the frames, percent; density -1 where the frames are not at hand.
struct Score {
    double bad3 = 0.0;  // of the answered, off by more than 3 px
    double density = -1.0;
};

Score score_of(MatcherKind kind, bool checks) {
    int known = 0;
    int answered = 0;
    int bad = 0;
    for (const char* const name : kFrames) {
        const RealPair pair = load(name);
        if (pair.truth.empty()) return {};
        const OwnedResult result =
            match_fast(config_of(kind, checks), view_of(pair.left), view_of(pair.right));
        for (int y = 0; y < pair.truth.rows; ++y)
            for (int x = 0; x < pair.truth.cols; ++x) {
                const int truth_q8 = pair.truth.at<std::uint16_t>(y, x);
                if (truth_q8 == 0) continue;
                ++known;
                if (result.reason(x, y) != Invalid::kNone) continue;
                ++answered;
                bad += std::abs(16 * result.map.disparity_q4.at(x, y) - truth_q8) > 3 * 256 ? 1 : 0;
            }
    }
    const Score score{100.0 * bad / answered, 100.0 * answered / known};
    std::printf("%s%s: bad-3 %.2f %% at density %.1f %%\n",
                kind == MatcherKind::kCensus ? "census" : "census_pyramid", checks ? "" : ", dense",
                score.bad3, score.density);
    return score;
}

struct Bounds {
    MatcherKind kind;
    double dense_bad3;
    double bad3;
    double density;
};
constexpr std::array kBounds = {Bounds{MatcherKind::kCensus, 6.0, 3.2, 88.0},
                                Bounds{MatcherKind::kCensusPyramid, 5.2, 3.8, 90.0}};

TEST(CensusRealPairs, KittiDenseAndChecked) {
    for (const Bounds& bounds : kBounds) {
        const Score dense = score_of(bounds.kind, false);
        if (dense.density < 0.0)
            GTEST_SKIP() << "the KITTI pairs are not at hand (../shared/data/kitti2012_*)";
        EXPECT_LT(dense.bad3, bounds.dense_bad3);
        EXPECT_EQ(dense.density, 100.0);
        const Score checked = score_of(bounds.kind, true);
        EXPECT_LT(checked.bad3, bounds.bad3);
        EXPECT_GT(checked.density, bounds.density);
    }
}

TEST(CensusRealPairs, FourLanesEqualOne) {
    const RealPair pair = load(kFrames[1]);
    if (pair.truth.empty()) GTEST_SKIP() << "the KITTI pairs are not at hand (../shared/data/kitti2012_*)";
    for (const MatcherKind kind : {MatcherKind::kCensus, MatcherKind::kCensusPyramid}) {
        const MatcherConfig config = config_of(kind, true);
        Arena arena;
        ThreadedLanes lanes(4);
        OwnedResult result(pair.left.cols, pair.left.rows);
        make_matcher(config, pair.left.cols, pair.left.rows, 4, arena)
            ->match(view_of(pair.left), view_of(pair.right), result.map, lanes);
        EXPECT_EQ(differing_pixels(result, match_fast(config, view_of(pair.left), view_of(pair.right))), 0);
    }
}

}  // namespace
}  // namespace groundline::stereo
