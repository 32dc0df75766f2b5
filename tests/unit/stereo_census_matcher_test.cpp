// The census matcher against its plain statement on every vector unit; lanes, memory, allocations.
#include <gtest/gtest.h>

#include "core/error.hpp"
#include "stereo/census.hpp"
#include "support/allocation_count.hpp"
#include "support/vector_units.hpp"
#include "unit/stereo_test_tools.hpp"

namespace groundline::stereo {
namespace {

using test::OwnedPair;

// Both census matchers keep one contract.
class CensusMatchers : public testing::TestWithParam<MatcherKind> {};
INSTANTIATE_TEST_SUITE_P(Of, CensusMatchers,
                         testing::Values(MatcherKind::kCensus, MatcherKind::kCensusPyramid),
                         [](const auto& kind) {
                             return kind.param == MatcherKind::kCensus ? "Census" : "CensusPyramid";
                         });

MatcherConfig census(MatcherKind kind, int disparities, bool checks = true) {
    MatcherConfig config;
    config.kind = kind;
    config.disparities = disparities;
    config.checks = checks;
    config.limits.speckle_px = 8;
    return config;
}

// Plain form once, fast form on every vector unit.
void expect_equal(const MatcherConfig& config, ConstLuma left, ConstLuma right, const std::string& what) {
    const OwnedResult plain = match_plain(config, left, right);
    for (const VectorUnit unit : vector_units()) {
        use_vector_unit(unit);
        EXPECT_EQ(differing_pixels(match_fast(config, left, right), plain), 0)
            << what << " on " << name_of(unit);
    }
    use_best_vector_unit();
}

TEST_P(CensusMatchers, EqualsThePlainFormAtEveryNumberOfDisparities) {
    on_every_vector_unit([] {});  // says which ran
    for (int disparities = 16; disparities <= 256; disparities += 16) {
        const OwnedPair pair = stepped_pair(disparities + 45, 33, 200);
        for (const bool checks : {false, true})
            expect_equal(census(GetParam(), disparities, checks), pair.left.view(), pair.right.view(),
                         std::to_string(disparities) + " disparities");
    }
}

TEST_P(CensusMatchers, EqualsThePlainFormAtOddSizesAndStrides) {
    struct Size {
        int width;
        int height;
    };
    for (const Size size : {Size{17, 11}, Size{33, 13}, Size{65, 67}, Size{97, 41}, Size{131, 131}})
        for (const int extra : {0, 5}) {
            const OwnedPair pair = stepped_pair(size.width, size.height, 201, 0, extra);
            for (const int uniqueness : {-1, 5}) {
                MatcherConfig config = census(GetParam(), size.width > 64 ? 48 : 16);
                config.limits.uniqueness_percent = uniqueness;
                expect_equal(config, pair.left.view(), pair.right.view(),
                             std::to_string(size.width) + " px wide");
            }
        }
}

TEST_P(CensusMatchers, EqualsThePlainFormOnPureNoiseAndAtEveryOffset) {
    for (const int offset : {-40, -9, 0, 6, 30}) {
        MatcherConfig config = census(GetParam(), 32);
        config.min_disparity = offset;
        config.limits.speckle_px = 3;
        config.limits.median = offset > 0;
        const auto left = test::noise_image(83, 37, 202);
        const auto right = test::noise_image(83, 37, 203);
        expect_equal(config, left.view(), right.view(), "offset " + std::to_string(offset));
    }
}

TEST_P(CensusMatchers, EqualsThePlainFormWhereEveryTestBites) {
    OwnedPair pair = stepped_pair(130, 150, 204);
    for (test::OwnedLuma* view : {&pair.left, &pair.right}) {
        const auto spots = test::noise_image(130, 150, 205);
        view->fill([&](int x, int y) {
            if (y > 110 && spots.at(x, y) < 80) return 255;
            return y < 20 ? 128 + (view->at(x, y) - 128) / 12 : view->at(x, y);
        });
    }
    MatcherConfig config = census(GetParam(), 32);
    config.min_disparity = -12;  // the nearer surface, 19 px, is the last of the range
    config.limits = {true, 25, 400, 100, 8, 0, 0, 30, true};
    expect_equal(config, pair.left.view(), pair.right.view(), "all tests");
    const OwnedResult plain = match_plain(config, pair.left.view(), pair.right.view());
    for (const Invalid reason :
         {Invalid::kNone, Invalid::kBorder, Invalid::kTexture, Invalid::kUniqueness, Invalid::kLeftRight,
          Invalid::kSaturation, Invalid::kSpeckle, Invalid::kRangeEdge})
        EXPECT_GT(count_reason(plain, reason), 0) << kInvalidNames[static_cast<std::size_t>(reason)];
}

TEST_P(CensusMatchers, EqualsThePlainFormWithEveryTestSwitchedOff) {
    const OwnedPair pair = stepped_pair(97, 41, 206);
    for (int off = 0; off < 6; ++off) {
        MatcherConfig config = census(GetParam(), 32);
        if (off == 0) config.limits.subpixel = false;
        if (off == 1) config.limits.saturated_percent = 100;
        if (off == 2) config.limits.texture = 0;
        if (off == 3) config.limits.uniqueness_percent = -1;
        if (off == 4) config.limits.left_right_px = -1;
        if (off == 5) config.limits.speckle_px = 0;
        expect_equal(config, pair.left.view(), pair.right.view(), "switch " + std::to_string(off));
    }
}

TEST_P(CensusMatchers, ResultDependsNeitherOnLanesNorOnTheirOrder) {
    // Every band and three parts of the fine level; then fewer bands and parts than lanes.
    for (const int height : {290, 75}) {
        constexpr int kWidth = 401;
        const OwnedPair pair = stepped_pair(kWidth, height, 207);
        const MatcherConfig config = census(GetParam(), 32);
        const OwnedResult expected = match_fast(config, pair.left.view(), pair.right.view());
        for (const int lanes : {1, 2, 3, 4, 5, 8}) {
            Arena arena;
            const auto matcher = make_matcher(config, kWidth, height, lanes, arena);
            ShuffledLanes shuffled(lanes, 7U + static_cast<std::uint32_t>(lanes));
            ThreadedLanes threaded(lanes);
            for (Parallel* parallel :
                 {static_cast<Parallel*>(&shuffled), static_cast<Parallel*>(&threaded)}) {
                OwnedResult result(kWidth, height);
                matcher->match(pair.left.view(), pair.right.view(), result.map, *parallel);
                EXPECT_EQ(differing_pixels(result, expected), 0) << lanes << " lanes, " << height << " rows";
            }
        }
    }
}

TEST_P(CensusMatchers, FindsTheLastOfAllDisparities) {
    const OwnedPair pair = test::warped_pair(330, 24, 220, [](int, int) { return 255; });
    for (const bool checks : {false, true})
        expect_equal(census(GetParam(), 256, checks), pair.left.view(), pair.right.view(), "256 disparities");
}

TEST_P(CensusMatchers, SecondCallKnowsNothingOfTheFirst) {
    const OwnedPair first{test::noise_image(97, 141, 208), test::noise_image(97, 141, 209)};
    const OwnedPair second = stepped_pair(97, 141, 210);
    const MatcherConfig config = census(GetParam(), 32);
    Arena arena;
    Serial serial;
    const auto matcher = make_matcher(config, 97, 141, 1, arena);
    OwnedResult result(97, 141);
    matcher->match(first.left.view(), first.right.view(), result.map, serial);
    matcher->match(second.left.view(), second.right.view(), result.map, serial);
    EXPECT_EQ(differing_pixels(result, match_fast(config, second.left.view(), second.right.view())), 0);
}

TEST_P(CensusMatchers, MatchingAllocatesNothing) {
    const OwnedPair pair = stepped_pair(130, 177, 211);
    MatcherConfig config = census(GetParam(), 64);
    config.limits.median = true;
    Arena arena;
    Serial serial;
    const auto matcher = make_matcher(config, 130, 177, 1, arena);
    OwnedResult result(130, 177);
    arena.seal();
    const auto allocations = test::allocations();
    const auto locks = test::mutex_locks();
    matcher->match(pair.left.view(), pair.right.view(), result.map, serial);
    EXPECT_EQ(test::allocations(), allocations);
    EXPECT_EQ(test::mutex_locks(), locks);
}

TEST_P(CensusMatchers, StateIsWhatTheArenaGaveAndBelowAMillionBytes) {
    MatcherConfig config;
    config.kind = GetParam();
    for (const int lanes : {1, 2, 4}) {
        Arena arena;
        const auto matcher = make_matcher(config, 640, 480, lanes, arena);
        EXPECT_EQ(matcher->state_bytes(), arena.bytes());
        std::printf("640x480x64, %d lanes: %zu bytes\n", lanes, matcher->state_bytes());
        EXPECT_TRUE(lanes > 1 || matcher->state_bytes() < 1000000) << matcher->state_bytes();
        EXPECT_EQ(matcher->min_disparity(), 0);
        EXPECT_EQ(matcher->disparities(), 64);
    }
}

TEST_P(CensusMatchers, RefusesWhatCannotWorkWithASentence) {
    const auto refusal = [](MatcherConfig config, int width, int height) -> std::string {
        Arena arena;
        try {
            make_matcher(config, width, height, 1, arena);
        } catch (const Refusal& refused) {
            EXPECT_EQ(refused.status(), ExitStatus::kConfig);
            return refused.what();
        }
        return "";
    };
    MatcherConfig config;
    config.kind = GetParam();
    EXPECT_EQ(refusal(config, 640, 480), "");
    EXPECT_EQ(refusal(config, 65, 11), "");
    EXPECT_NE(refusal(config, 640, 10).find("too small"), std::string::npos);
    EXPECT_NE(refusal(config, 64, 480).find("0 to 63"), std::string::npos);
    for (const int disparities : {0, -16, 8, 40, 272}) {
        config.disparities = disparities;
        EXPECT_NE(refusal(config, 640, 480).find("multiple of 16"), std::string::npos) << disparities;
    }
    config.disparities = 64;
    config.min_disparity = -640;
    EXPECT_NE(refusal(config, 640, 480).find("-640"), std::string::npos);
    config.min_disparity = 2040;
    EXPECT_NE(refusal(config, 4000, 480).find("do not fit"), std::string::npos);
}

TEST_P(CensusMatchers, WithoutChecksEveryPixelIsAnsweredWithinTheRange) {
    const auto left = test::noise_image(90, 40, 212);
    const auto right = test::noise_image(90, 40, 213);
    for (const bool subpixel : {false, true}) {
        MatcherConfig config = census(GetParam(), 32, false);
        config.min_disparity = -11;
        config.limits.subpixel = subpixel;
        const OwnedResult result = match_fast(config, left.view(), right.view());
        EXPECT_EQ(count_reason(result, Invalid::kNone), 90 * 40);
        for (int y = 0; y < 40; ++y)
            for (int x = 0; x < 90; ++x) {
                const int disparity_q4 = result.map.disparity_q4.at(x, y);
                ASSERT_TRUE(subpixel || disparity_q4 % kDisparityOne == 0);
                ASSERT_GE(disparity_q4, -11 * kDisparityOne);
                ASSERT_LE(disparity_q4, 20 * kDisparityOne);
            }
    }
}

TEST_P(CensusMatchers, ResultDoesNotDependOnTheStrideOfTheViews) {
    const OwnedPair tight = stepped_pair(97, 61, 214);
    for (const int extra : {1, 29, 64}) {
        const OwnedPair loose = stepped_pair(97, 61, 214, 0, extra);
        const MatcherConfig config = census(GetParam(), 48);
        const OwnedResult expected = match_fast(config, tight.left.view(), tight.right.view());
        EXPECT_EQ(differing_pixels(match_fast(config, loose.left.view(), loose.right.view()), expected), 0);
    }
}

}  // namespace
}  // namespace groundline::stereo
