// Properties that both census matchers must have: what no exposure changes, what a shift is found as, which
// reason a place that cannot be matched gets.
#include <gtest/gtest.h>

#include <cstdlib>

#include "stereo/census.hpp"
#include "unit/stereo_test_tools.hpp"

namespace groundline::stereo {
namespace {

using test::OwnedLuma;
using test::OwnedPair;

class CensusProperties : public testing::TestWithParam<MatcherKind> {
  protected:
    static MatcherConfig config(int disparities, int min_disparity = 0) {
        MatcherConfig config;
        config.kind = GetParam();
        config.disparities = disparities;
        config.min_disparity = min_disparity;
        return config;
    }
    static bool whole() { return GetParam() == MatcherKind::kCensus; }
};
INSTANTIATE_TEST_SUITE_P(Of, CensusProperties,
                         testing::Values(MatcherKind::kCensus, MatcherKind::kCensusPyramid),
                         [](const auto& kind) {
                             return kind.param == MatcherKind::kCensus ? "Census" : "CensusPyramid";
                         });

struct Area {
    int left;
    int top;
    int right;
    int bottom;
    int pixels() const { return (right - left) * (bottom - top); }
};

template <typename Property>
int count_in(const Area& area, Property property) {
    int count = 0;
    for (int y = area.top; y < area.bottom; ++y)
        for (int x = area.left; x < area.right; ++x)
            count += property(x, y) ? 1 : 0;
    return count;
}

double percent(int part, int whole) {
    return 100.0 * part / whole;
}

// A texture whose grey levels all lie within lowest .. highest.
OwnedPair scene_within(int lowest, int highest, std::uint32_t seed) {
    OwnedPair pair = stepped_pair(160, 80, seed);
    for (OwnedLuma* view : {&pair.left, &pair.right})
        view->fill([&](int x, int y) { return lowest + view->at(x, y) * (highest - lowest) / 255; });
    return pair;
}

// Pixels that one result answers otherwise than the other, beyond a quarter of a pixel, percent.
double changed_percent(const OwnedResult& a, const OwnedResult& b) {
    const Area all{0, 0, a.map.width(), a.map.height()};
    return percent(count_in(all,
                            [&](int x, int y) {
                                if (a.reason(x, y) != b.reason(x, y)) return true;
                                return std::abs(a.map.disparity_q4.at(x, y) - b.map.disparity_q4.at(x, y)) >
                                       kDisparityOne / 4;
                            }),
                   all.pixels());
}

TEST_P(CensusProperties, EqualViewsHaveDisparityZeroWhereThereIsTexture) {
    const OwnedLuma image = test::textured_image(120, 80, 300);
    const OwnedResult result = match_fast(config(32), image.view(), image.view());
    for (int y = 0; y < 80; ++y)
        for (int x = whole() ? 1 : 2; x < 120; ++x) {
            ASSERT_EQ(result.reason(x, y), Invalid::kNone) << x << " " << y;
            ASSERT_EQ(result.map.disparity_q4.at(x, y), 0) << x << " " << y;
        }
}

TEST_P(CensusProperties, BrightnessOfOneViewChangesNothing) {
    OwnedPair pair = scene_within(0, 235, 301);
    const OwnedResult before = match_fast(config(32), pair.left.view(), pair.right.view());
    test::change_exposure(pair.right, 1.0, 20);
    const OwnedResult after = match_fast(config(32), pair.left.view(), pair.right.view());
    EXPECT_GT(count_reason(before, Invalid::kNone), 160 * 80 / 2);
    EXPECT_EQ(differing_pixels(before, after), 0);
}

// Of the halved view only nearly: a mean of four rounds.
TEST_P(CensusProperties, ContrastOfOneViewChangesNothing) {
    for (const double gain : {2.0, 1.1}) {
        OwnedPair pair = scene_within(1, 120, 302);
        const OwnedResult before = match_fast(config(32), pair.left.view(), pair.right.view());
        test::change_exposure(pair.right, gain, 5);
        const OwnedResult after = match_fast(config(32), pair.left.view(), pair.right.view());
        std::printf("gain %.1f: %.2f %% of the pixels changed\n", gain, changed_percent(before, after));
        if (whole()) {
            EXPECT_EQ(differing_pixels(before, after), 0);
        }
        EXPECT_LT(changed_percent(before, after), 5.0);
    }
}

TEST_P(CensusProperties, ExposureThatClipsChangesLittle) {
    OwnedPair pair = stepped_pair(160, 80, 303);
    const OwnedResult before = match_fast(config(32), pair.left.view(), pair.right.view());
    test::change_exposure(pair.right, 1.1, 5);
    const OwnedResult after = match_fast(config(32), pair.left.view(), pair.right.view());
    std::printf("gain 1.1 and clipping: %.2f %% of the pixels changed\n", changed_percent(before, after));
    EXPECT_LT(changed_percent(before, after), 6.0);
}

TEST_P(CensusProperties, AShiftIsFoundAtEveryDisparityOfAnyRange) {
    int pixels = 0;
    int answered = 0;
    int exact = 0;
    // The last coarse disparity stands for two.
    const int usable = whole() ? 31 : 29;
    for (const int min_disparity : {-23, 0, 18})
        for (int k = 0; k < usable; ++k) {
            const int disparity = min_disparity + k;
            const OwnedPair pair =
                test::shifted_pair(150, 40, 310U + static_cast<std::uint32_t>(k), disparity);
            const OwnedResult result =
                match_fast(config(32, min_disparity), pair.left.view(), pair.right.view());
            for (int y = 4; y < 36; ++y)
                for (int x = 58; x < 120; ++x) {
                    ++pixels;
                    if (result.reason(x, y) != Invalid::kNone) continue;
                    ++answered;
                    const int off_q4 = std::abs(result.map.disparity_q4.at(x, y) - disparity * kDisparityOne);
                    exact += off_q4 <= kDisparityOne / 4 ? 1 : 0;
                    ASSERT_LE(off_q4, whole() ? kDisparityOne / 4 : kDisparityOne + kDisparityOne / 2)
                        << disparity << " px from " << min_disparity << " at " << x << " " << y;
                }
        }
    std::printf("whole shifts: answered %.3f %%, of those within 1/4 px %.3f %%\n", percent(answered, pixels),
                percent(exact, answered));
    EXPECT_GT(percent(answered, pixels), 99.5);
    EXPECT_GT(percent(exact, answered), 99.5);
}

// A texture four times as fine as the pixels, so that its shifts are quarters of a pixel.
TEST_P(CensusProperties, AShiftByAPartOfAPixelIsFoundToAQuarter) {
    constexpr int kWidth = 160;
    constexpr int kHeight = 60;
    const OwnedLuma noise = test::noise_image(4 * kWidth + 200, kHeight + 4, 320);
    OwnedLuma fine(4 * kWidth + 160, kHeight);
    fine.fill([&](int x, int y) {
        // Two boxes of 2 px one after the other, over rows a smaller one; the contrast that takes is put
        // back.
        int sum = 0;
        for (int j = 0; j < 3; ++j)
            for (int i = -7; i <= 7; ++i)
                sum += (8 - std::abs(i)) * (noise.at(x + 7 + i, y + j) - 128);
        return 128 + sum / 48;
    });
    for (int quarters = 20; quarters < 28; ++quarters) {
        OwnedPair pair{OwnedLuma(kWidth, kHeight), OwnedLuma(kWidth, kHeight)};
        pair.right.fill([&](int x, int y) { return fine.at(4 * x + 120, y); });
        pair.left.fill([&](int x, int y) { return fine.at(4 * x + 120 - quarters, y); });
        const OwnedResult result = match_fast(config(16), pair.left.view(), pair.right.view());
        const Area inside{20, 4, kWidth - 8, kHeight - 4};
        int error = 0;
        int off = 0;
        const int answered = count_in(inside, [&](int x, int y) {
            if (result.reason(x, y) != Invalid::kNone) return false;
            const int difference = result.map.disparity_q4.at(x, y) - 4 * quarters;
            error += difference;
            off += std::abs(difference) > 4 ? 1 : 0;
            return true;
        });
        std::printf("%.2f px: answered %.1f %%, off by more than 1/4 px %.2f %%, mean error %.3f px\n",
                    quarters / 4.0, percent(answered, inside.pixels()), percent(off, answered),
                    error / 16.0 / answered);
        EXPECT_GT(percent(answered, inside.pixels()), 90.0);
        EXPECT_LT(percent(off, answered), 10.0);
        EXPECT_LT(std::abs(error / 16.0 / answered), 0.2);
    }
}

TEST_P(CensusProperties, WhatIsAtTheEndOfTheRangeOrNearerIsNotAnswered) {
    for (const int beyond : {0, 1}) {
        const OwnedPair pair = test::shifted_pair(150, 60, 330, 31 + beyond);
        const OwnedResult result = match_fast(config(32), pair.left.view(), pair.right.view());
        const Area inside{50, 5, 140, 55};
        const auto share = [&](Invalid reason) {
            return percent(count_in(inside, [&](int x, int y) { return result.reason(x, y) == reason; }),
                           inside.pixels());
        };
        std::printf("%d px beyond: range edge %.1f %%, answered %.1f %%\n", beyond,
                    share(Invalid::kRangeEdge), share(Invalid::kNone));
        if (beyond == 0) {
            EXPECT_GT(share(Invalid::kRangeEdge), 95.0);
        }
        EXPECT_LT(share(Invalid::kNone), 1.0);
    }
}

TEST_P(CensusProperties, SaturatedAndFlatPatchesGetTheirReasons) {
    OwnedPair pair = test::shifted_pair(160, 80, 340, 6);
    for (OwnedLuma* view : {&pair.left, &pair.right})
        view->fill([&](int x, int y) {
            if (y < 40 && x >= 50 && x < 90) return 255;
            if (y < 40 && x >= 110) return 100;
            return static_cast<int>(view->at(x, y));
        });
    const OwnedResult result = match_fast(config(16), pair.left.view(), pair.right.view());
    for (int y = 0; y < 34; ++y) {
        for (int x = 56; x < 84; ++x)
            ASSERT_EQ(result.reason(x, y), Invalid::kSaturation) << x << " " << y;
        for (int x = 117; x < 160; ++x)
            ASSERT_EQ(result.reason(x, y), Invalid::kTexture) << x << " " << y;
    }
    const Area textured{20, 50, 150, 75};
    EXPECT_GT(count_in(textured, [&](int x, int y) { return result.reason(x, y) == Invalid::kNone; }),
              textured.pixels() * 95 / 100);
}

TEST_P(CensusProperties, NoAnswerPointsOutsideTheRightView) {
    for (const int disparity : {-20, 20}) {
        const OwnedPair pair = test::shifted_pair(150, 60, 350, disparity);
        const OwnedResult result =
            match_fast(config(32, disparity - 14), pair.left.view(), pair.right.view());
        for (int y = 0; y < 60; ++y)
            for (int x = 0; x < 150; ++x) {
                if (result.reason(x, y) != Invalid::kNone) continue;
                const int match_q4 = kDisparityOne * x - result.map.disparity_q4.at(x, y);
                ASSERT_GE(match_q4, kDisparityOne / 2) << x << " " << y;
                ASSERT_LE(match_q4, kDisparityOne * 150 - kDisparityOne / 2) << x << " " << y;
            }
        // The columns whose match is outside.
        const Area outside = disparity > 0 ? Area{0, 5, 17, 55} : Area{133, 5, 150, 55};
        const int border =
            count_in(outside, [&](int x, int y) { return result.reason(x, y) == Invalid::kBorder; });
        const int answered =
            count_in(outside, [&](int x, int y) { return result.reason(x, y) == Invalid::kNone; });
        std::printf("%d px: of what has no match inside, border %.1f %%, answered %.1f %%\n", disparity,
                    percent(border, outside.pixels()), percent(answered, outside.pixels()));
        EXPECT_GT(percent(border, outside.pixels()), 50.0);
        EXPECT_LT(percent(answered, outside.pixels()), 10.0);
    }
}

// A pattern of period 12 fits at 0 and at 12 px, and its surroundings, at 6 px, speak for neither.
TEST_P(CensusProperties, OfARepeatedPatternMoreIsNotUniqueTheMoreIsAsked) {
    constexpr int kPeriod = 12;
    const OwnedLuma tile = test::noise_image(kPeriod, 60, 360);
    OwnedPair pair = test::shifted_pair(220, 60, 361, 6);
    const auto put = [&](OwnedLuma& view, int first, int last) {
        view.fill([&](int x, int y) -> int {
            return x >= first && x < last ? tile.at(x % kPeriod, y) : view.at(x, y);
        });
    };
    put(pair.left, 96, 160);
    put(pair.right, 96 - kPeriod, 160);
    // The rim of the pattern decides most rows for one of the two, clearly enough for small percentages.
    double flagged_before = 0.0;
    for (const int percents : {-1, 5, 50, 100}) {
        MatcherConfig with = config(32);
        with.limits.uniqueness_percent = percents;
        const OwnedResult result = match_fast(with, pair.left.view(), pair.right.view());
        const auto share = [&](const Area& area, Invalid reason) {
            return percent(count_in(area, [&](int x, int y) { return result.reason(x, y) == reason; }),
                           area.pixels());
        };
        const Area pattern{102, 5, 154, 55};
        const Area beside{20, 5, 80, 55};
        const double flagged = share(pattern, Invalid::kUniqueness);
        std::printf("uniqueness %d %%: of the pattern %.1f %% not unique, %.1f %% answered\n", percents,
                    flagged, share(pattern, Invalid::kNone));
        EXPECT_TRUE(percents < 0 ? flagged == 0.0 : flagged > flagged_before + 2.0);
        flagged_before = flagged;
        EXPECT_GT(share(beside, Invalid::kNone), 95.0);
    }
}

TEST_P(CensusProperties, WhatIsHiddenInTheRightViewIsMostlyNotAnswered) {
    // A near surface at 20 px before one at 5 px hides 15 px to its left.
    const OwnedLuma near = test::textured_image(260, 90, 370);
    const OwnedLuma far = test::textured_image(260, 90, 371);
    OwnedPair pair{OwnedLuma(200, 90), OwnedLuma(200, 90)};
    pair.left.fill([&](int x, int y) { return x >= 100 && x < 150 ? near.at(x, y) : far.at(x - 5 + 30, y); });
    pair.right.fill(
        [&](int x, int y) { return x >= 80 && x < 130 ? near.at(x + 20, y) : far.at(x + 30, y); });
    test::add_noise(pair.right, 372, 3);
    const OwnedResult result = match_fast(config(32), pair.left.view(), pair.right.view());
    const Area hidden{85, 5, 100, 85};
    const auto share = [&](Invalid reason) {
        return percent(count_in(hidden, [&](int x, int y) { return result.reason(x, y) == reason; }),
                       hidden.pixels());
    };
    std::printf("hidden band: left-right %.1f %%, uniqueness %.1f %%, answered %.1f %%\n",
                share(Invalid::kLeftRight), share(Invalid::kUniqueness), share(Invalid::kNone));
    EXPECT_GT(share(Invalid::kLeftRight), 40.0);
    EXPECT_LT(share(Invalid::kNone), 30.0);
    const Area seen{105, 5, 145, 85};
    const int right = count_in(seen, [&](int x, int y) {
        return std::abs(result.map.disparity_q4.at(x, y) - 20 * kDisparityOne) <= kDisparityOne;
    });
    EXPECT_GT(percent(right, seen.pixels()), 95.0);
}

// Waves up and down over 40 px: the words of a rise and of a fall are complements, so far from the right
// disparity every path costs the most it can.
TEST_P(CensusProperties, SumsBeyond255AreAsThePlainFormHasThem) {
    OwnedPair pair{OwnedLuma(160, 60), OwnedLuma(160, 60)};
    for (OwnedLuma* view : {&pair.left, &pair.right})
        view->fill([](int x, int y) {
            const int phase = x % 40;
            const int wave = phase < 20 ? phase : 40 - phase;
            return 60 + 6 * wave + (phase < 20 ? y : 60 - y);
        });
    const CostVolume sums = path_sums(smoothed_121(census_costs(pair.left.view(), pair.right.view(), 0, 32)));
    EXPECT_GT(std::count(sums.values.begin(), sums.values.end(), std::uint16_t{255}), 1000);
    for (const int uniqueness : {-1, 5, 100}) {
        MatcherConfig at = config(32);
        at.limits.uniqueness_percent = uniqueness;
        const OwnedResult plain = match_plain(at, pair.left.view(), pair.right.view());
        EXPECT_EQ(differing_pixels(match_fast(at, pair.left.view(), pair.right.view()), plain), 0);
    }
}

}  // namespace
}  // namespace groundline::stereo
