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

}  // namespace
}  // namespace groundline::stereo
