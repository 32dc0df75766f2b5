// The streaming matcher against its plain statement, in all readings, sizes, lanes; and its contract.
#include <gtest/gtest.h>

#include "core/error.hpp"
#include "support/allocation_count.hpp"
#include "support/vector_units.hpp"
#include "unit/stereo_test_tools.hpp"

namespace groundline::stereo {
namespace {

using test::OwnedPair;

struct Size {
    int width;
    int height;
};

// What a configuration makes of a pair, stated plainly.
struct Expectation {
    MatcherConfig config = paper();
    const OwnedPair* pair;
    OwnedResult plain;

    Expectation(const MatcherConfig& with, const OwnedPair& of)
        : config(with), pair(&of), plain(match_plain(with, of.left.view(), of.right.view())) {}
};

void expect_on_every_vector_unit(const std::vector<Expectation>& expectations) {
    on_every_vector_unit([&] {
        for (const Expectation& expected : expectations) {
            const MatcherConfig& config = expected.config;
            const PaperReading& reading = config.paper;
            const ConstLuma left = expected.pair->left.view();
            EXPECT_EQ(differing_pixels(match_fast(config, left, expected.pair->right.view()), expected.plain),
                      0)
                << left.width << "x" << left.height << " stride " << left.stride << " from "
                << config.min_disparity << " rules " << static_cast<int>(reading.rule_one)
                << static_cast<int>(reading.rule_two) << " at once " << reading.rules_at_once << " window "
                << static_cast<int>(reading.window) << " truncation " << reading.truncation << " checks "
                << config.checks << " normalise " << config.normalise_local_mean;
        }
    });
}

TEST(PaperMatcher, C7_EqualsThePlainFormInEveryReading) {
    const OwnedPair pair = stepped_pair(97, 41, 100);
    std::vector<Expectation> expectations;
    for (const bool checks : {false, true})
        for (const PaperReading& reading : all_readings()) {
            MatcherConfig config = pure(32);
            config.checks = checks;
            config.limits.speckle_px = 20;
            config.paper = reading;
            expectations.emplace_back(config, pair);
        }
    expect_on_every_vector_unit(expectations);
}

TEST(PaperMatcher, C7_EqualsThePlainFormAtOddSizesAndStrides) {
    std::vector<OwnedPair> pairs;
    for (const Size size : {Size{17, 11}, Size{65, 33}, Size{97, 41}, Size{130, 77}})
        for (const int extra : {0, 5})
            pairs.push_back(stepped_pair(size.width, size.height, 101, 0, extra));
    std::vector<Expectation> expectations;
    for (const OwnedPair& pair : pairs)
        for (const bool normalise : {false, true}) {
            MatcherConfig config = paper();
            config.disparities = pair.left.width() > 64 ? 64 : 16;
            config.normalise_local_mean = normalise;
            expectations.emplace_back(config, pair);
        }
    expect_on_every_vector_unit(expectations);
}

TEST(PaperMatcher, C7_EqualsThePlainFormOnPureNoiseAndAtEveryOffset) {
    const OwnedPair pair{test::noise_image(83, 37, 102), test::noise_image(83, 37, 103)};
    std::vector<Expectation> expectations;
    for (const int offset : {-82, -40, -9, 0, 6, 30, 50}) {
        MatcherConfig config = paper();
        config.min_disparity = offset;
        config.disparities = 32;
        config.limits.speckle_px = 3;
        config.limits.median = offset > 0;
        expectations.emplace_back(config, pair);
    }
    expect_on_every_vector_unit(expectations);
}

// Limits in the middle of what the scene has, so that each test decides both ways.
TEST(PaperMatcher, C7_EqualsThePlainFormWhereEveryTestBites) {
    OwnedPair pair = stepped_pair(130, 77, 111);
    for (test::OwnedLuma* view : {&pair.left, &pair.right}) {
        const auto spots = test::noise_image(130, 77, 112);
        view->fill([&](int x, int y) {
            if (y > 40 && spots.at(x, y) < 12) return 255;
            const int contrast = y < 20 ? 12 : 1;
            return 128 + (view->at(x, y) - 128) / contrast;
        });
    }
    for (const bool normalise : {false, true}) {
        MatcherConfig config = paper();
        config.disparities = 32;
        config.min_disparity = -12;  // the nearer surface, 19 px, is the last of the range
        config.normalise_local_mean = normalise;
        config.limits = {true, 5, 400, 40, 8, 20, 1, 30};
        const OwnedResult plain = match_plain(config, pair.left.view(), pair.right.view());
        EXPECT_EQ(differing_pixels(match_fast(config, pair.left.view(), pair.right.view()), plain), 0);
        for (const Invalid reason :
             {Invalid::kNone, Invalid::kBorder, Invalid::kTexture, Invalid::kUniqueness, Invalid::kLeftRight,
              Invalid::kSaturation, Invalid::kCost, Invalid::kSpeckle, Invalid::kRangeEdge})
            EXPECT_GT(count_reason(plain, reason), 0) << kInvalidNames[static_cast<std::size_t>(reason)];
    }
}

TEST(PaperMatcher, C7_ResultDependsNeitherOnLanesNorOnTheirOrderNorOnBands) {
    const OwnedPair pair = stepped_pair(130, 77, 104);
    MatcherConfig config = paper();
    config.normalise_local_mean = true;
    const OwnedResult expected = match_plain(config, pair.left.view(), pair.right.view());
    for (const int lanes : {1, 2, 3}) {
        Arena arena;
        const auto matcher = make_matcher(config, 130, 77, lanes, arena);
        ShuffledLanes shuffled(lanes, 7U + static_cast<std::uint32_t>(lanes));
        ThreadedLanes threaded(lanes);
        for (Parallel* parallel : {static_cast<Parallel*>(&shuffled), static_cast<Parallel*>(&threaded)}) {
            OwnedResult result(130, 77);
            matcher->match(pair.left.view(), pair.right.view(), result.map, *parallel);
            EXPECT_EQ(differing_pixels(result, expected), 0) << lanes << " lanes";
        }
    }
    for (const int band_rows : {1, 2, 5, 7, 31, 77, 200}) {
        Arena arena;
        Serial serial;
        OwnedResult result(130, 77);
        PaperMatcher(config, 130, 77, 1, arena, band_rows)
            .match(pair.left.view(), pair.right.view(), result.map, serial);
        EXPECT_EQ(differing_pixels(result, expected), 0) << band_rows << " rows a band";
    }
}

TEST(PaperMatcher, SecondCallKnowsNothingOfTheFirst) {
    const OwnedPair first = stepped_pair(97, 41, 105);
    const OwnedPair second = stepped_pair(97, 41, 106);
    MatcherConfig config = paper();
    config.disparities = 32;
    Arena arena;
    Serial serial;
    const auto matcher = make_matcher(config, 97, 41, 1, arena);
    OwnedResult result(97, 41);
    matcher->match(first.left.view(), first.right.view(), result.map, serial);
    matcher->match(second.left.view(), second.right.view(), result.map, serial);
    EXPECT_EQ(differing_pixels(result, match_fast(config, second.left.view(), second.right.view())), 0);
}

TEST(PaperMatcher, ReportsAbsoluteDisparityForAnySearchRange) {
    for (const int offset : {-20, 0, 25}) {
        const OwnedPair pair = test::shifted_pair(140, 60, 107, offset + 5);
        MatcherConfig config = paper();
        config.min_disparity = offset;
        config.disparities = 16;
        const OwnedResult result = match_fast(config, pair.left.view(), pair.right.view());
        for (int y = 10; y < 50; ++y)
            for (int x = 55; x < 85; ++x) {
                ASSERT_EQ(result.reason(x, y), Invalid::kNone) << "offset " << offset;
                ASSERT_NEAR(result.map.disparity_q4.at(x, y), (offset + 5) * kDisparityOne, 4);
            }
    }
}

TEST(PaperMatcher, PureFormAnswersEveryPixelInWholePixels) {
    const auto left = test::noise_image(90, 40, 108);
    const auto right = test::noise_image(90, 40, 109);
    const OwnedResult result = match_fast(pure(32), left.view(), right.view());
    EXPECT_EQ(count_reason(result, Invalid::kNone), 90 * 40);
    for (int y = 0; y < 40; ++y)
        for (int x = 0; x < 90; ++x) {
            const int disparity_q4 = result.map.disparity_q4.at(x, y);
            ASSERT_EQ(disparity_q4 % kDisparityOne, 0);
            ASSERT_GE(disparity_q4, 0);
            ASSERT_LT(disparity_q4, 32 * kDisparityOne);
        }
}

TEST(PaperMatcher, MatchingAllocatesNothing) {
    const OwnedPair pair = stepped_pair(130, 77, 110);
    MatcherConfig config = paper();
    config.normalise_local_mean = true;
    Arena arena;
    Serial serial;
    const auto matcher = make_matcher(config, 130, 77, 1, arena);
    OwnedResult result(130, 77);
    arena.seal();
    const auto before = test::allocations();
    matcher->match(pair.left.view(), pair.right.view(), result.map, serial);
    EXPECT_EQ(test::allocations(), before);
}

TEST(PaperMatcher, StateIsWhatTheArenaGaveAndFarBelowACostVolume) {
    Arena arena;
    MatcherConfig config = paper();
    const auto matcher = make_matcher(config, 640, 480, 1, arena);
    EXPECT_EQ(matcher->state_bytes(), arena.bytes());
    EXPECT_LT(matcher->state_bytes(), std::size_t{640} * 480 * 64 / 8);
    EXPECT_EQ(matcher->min_disparity(), 0);
    EXPECT_EQ(matcher->disparities(), 64);
}

TEST(PaperMatcher, RefusesWhatCannotWorkWithASentence) {
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
    MatcherConfig config = paper();
    EXPECT_EQ(refusal(config, 640, 480), "");
    EXPECT_EQ(refusal(config, 65, 11), "");
    EXPECT_NE(refusal(config, 640, 10).find("too small"), std::string::npos);
    EXPECT_NE(refusal(config, 64, 480).find("0 to 63"), std::string::npos);
    for (const int disparities : {0, -16, 8, 40, 272}) {
        config.disparities = disparities;
        EXPECT_NE(refusal(config, 640, 480).find("multiple of 16"), std::string::npos) << disparities;
    }
    config = paper();
    config.min_disparity = -640;
    EXPECT_NE(refusal(config, 640, 480).find("-640"), std::string::npos);
    config.min_disparity = 2040;
    EXPECT_NE(refusal(config, 4000, 480).find("do not fit"), std::string::npos);
    config = paper();
    config.paper.truncation = 0;
    EXPECT_NE(refusal(config, 640, 480).find("truncation"), std::string::npos);
}

}  // namespace
}  // namespace groundline::stereo
