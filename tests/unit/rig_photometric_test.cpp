// Brightness comparison: exact cases, exposure steps under parallax, broken cameras, real pairs with truth.
#include "rig/photometric.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "support/random_images.hpp"
#include "unit/rig_support.hpp"

namespace groundline::rig {
namespace {

using groundline::test::OwnedLuma;
using groundline::test::OwnedPair;

// A textured pair: far above, near below, as on a road.
OwnedPair road(std::uint32_t seed) {
    return groundline::test::warped_pair(400, 240, seed, [](int, int y) { return 2 + y / 6; });
}

TEST(Photometric, EqualViewsAreEqual) {
    const OwnedLuma image = groundline::test::textured_image(320, 200, 1);
    Serial serial;
    const PhotometricEvidence evidence = measure_photometric(image.view(), image.view(), serial);
    EXPECT_NEAR(evidence.gain, 1.0, 1e-9);
    EXPECT_NEAR(evidence.offset, 0.0, 1e-7);
    EXPECT_NEAR(evidence.mismatch, 0.0, 1e-7);
}

TEST(Photometric, StaysSmallUnderParallax) {
    Serial serial;
    for (std::uint32_t seed = 1; seed <= 20; ++seed) {
        const OwnedPair pair = road(seed);
        const PhotometricEvidence evidence = measure_photometric(pair.left.view(), pair.right.view(), serial);
        EXPECT_NEAR(evidence.gain, 1.0, 0.03) << seed;
        EXPECT_LT(evidence.mismatch, 1.5) << seed;
    }
}

TEST(Photometric, MeasuresAnExposureStepUnderParallax) {
    Serial serial;
    struct Step {
        double gain;
        int offset;
    };
    for (const Step& step : {Step{1.06, 4}, Step{1.10, 5}, Step{0.9, 0}, Step{1.0, -8}})
        for (std::uint32_t seed = 1; seed <= 10; ++seed) {
            OwnedPair pair = road(seed);
            groundline::test::change_exposure(pair.left, step.gain, step.offset);
            const PhotometricEvidence evidence =
                measure_photometric(pair.left.view(), pair.right.view(), serial);
            EXPECT_NEAR(evidence.gain, step.gain, 0.03) << seed;
            // What counts is the line where the picture is: at its mean of 128.
            const double there = evidence.gain * 128 + evidence.offset;
            EXPECT_NEAR(there, step.gain * 128 + step.offset, 1.5) << seed;
            EXPECT_GT(evidence.mismatch, 5.0) << seed;
        }
}

TEST(Photometric, AThingThatOneViewSeesDoesNotBendTheLine) {
    Serial serial;
    OwnedPair pair = road(3);
    for (int y = 60; y < 180; ++y)
        for (int x = 0; x < 60; ++x)  // 7.5 % of the picture
            pair.left.at(x, y) = 240;
    const PhotometricEvidence evidence = measure_photometric(pair.left.view(), pair.right.view(), serial);
    EXPECT_NEAR(evidence.gain * 128 + evidence.offset, 128, 4.0);
    EXPECT_LT(evidence.mismatch, 5.0);
}

TEST(Photometric, GrossDifferencesShowEvenWhereNoLineFits) {
    Serial serial;
    OwnedLuma white(64, 48), grey(64, 48), black(64, 48);
    white.fill([](int, int) { return 255; });
    grey.fill([](int, int) { return 100; });
    const PhotometricEvidence white_grey = measure_photometric(white.view(), grey.view(), serial);
    EXPECT_NEAR(white_grey.mismatch, 155.0, 1.0);
    EXPECT_EQ(white_grey.overexposed_share, 1.0);
    EXPECT_EQ(white_grey.dark_share, 0.0);
    EXPECT_LE(white_grey.contrast, 1.0);
    black.fill([](int, int) { return 0; });
    const PhotometricEvidence grey_black = measure_photometric(grey.view(), black.view(), serial);
    EXPECT_NEAR(grey_black.mismatch, 100.0, 1.0);
    EXPECT_EQ(grey_black.dark_share, 1.0);
}

// Each eighth of the height is off by another amount: no line speaks for a third of the picture.
TEST(Photometric, ALineThroughLittleOfThePictureIsNotBelieved) {
    Serial serial;
    const OwnedLuma right = groundline::test::noise_image(64, 80, 4, 100, 140);
    OwnedLuma left = right;
    left.fill([&](int x, int y) { return right.at(x, y) - 60 + 20 * (y / 10); });
    const PhotometricEvidence evidence = measure_photometric(left.view(), right.view(), serial);
    EXPECT_GT(evidence.mismatch, 25.0);
    EXPECT_EQ(evidence.gain, 1.0);
    EXPECT_EQ(evidence.offset, 0.0);
}

TEST(Photometric, AConstantStepHasNoGain) {
    Serial serial;
    OwnedLuma a(64, 48), b(64, 48);
    a.fill([](int, int) { return 107; });
    b.fill([](int, int) { return 100; });
    const PhotometricEvidence evidence = measure_photometric(a.view(), b.view(), serial);
    EXPECT_EQ(evidence.gain, 1.0);
    EXPECT_NEAR(evidence.offset, 7.0, 1e-9);
    EXPECT_NEAR(evidence.mismatch, 7.0, 1e-9);
}

TEST(Photometric, CountsSharesOfTheWorseView) {
    Serial serial;
    OwnedLuma a(100, 80), b(100, 80);
    a.fill([](int x, int y) { return x < 20 ? 255 : x < 30 ? kDarkLevel : 60 + y; });
    b.fill([](int x, int y) { return x < 5 ? 254 : x < 45 ? kDarkLevel + 1 : x < 60 ? 0 : 60 + y; });
    const PhotometricEvidence evidence = measure_photometric(a.view(), b.view(), serial);
    EXPECT_DOUBLE_EQ(evidence.overexposed_share, 0.20);
    EXPECT_DOUBLE_EQ(evidence.dark_share, 0.15);
    OwnedLuma light(100, 80);
    light.fill([](int, int y) { return 60 + y; });
    EXPECT_DOUBLE_EQ(measure_photometric(a.view(), light.view(), serial).dark_share, 0.10);
    EXPECT_DOUBLE_EQ(measure_photometric(light.view(), a.view(), serial).dark_share, 0.10);
}

// The sky may be white and the trees before it black: the ground is below.
TEST(Photometric, CountsEveryRowOfTheLowerHalfAlone) {
    Serial serial;
    const OwnedLuma grey = groundline::test::noise_image(50, 43, 9, 100, 120);
    for (int bright = 0; bright < 43; ++bright) {
        OwnedLuma image = grey;
        for (int x = 0; x < 50; ++x)
            image.at(x, bright) = 255;
        const double share = bright < 21 ? 0.0 : 1.0 / 22;
        EXPECT_DOUBLE_EQ(measure_photometric(image.view(), grey.view(), serial).overexposed_share, share);
        EXPECT_DOUBLE_EQ(measure_photometric(grey.view(), image.view(), serial).overexposed_share, share);
        for (int x = 0; x < 50; ++x)
            image.at(x, bright) = kDarkLevel;
        EXPECT_DOUBLE_EQ(measure_photometric(image.view(), grey.view(), serial).dark_share, share);
    }
}

// Four levels of 25 % each: 5 % lies a fifth into the lowest, 95 % four fifths into the highest.
TEST(Photometric, QuantilesLieBetweenGreyLevels) {
    Serial serial;
    OwnedLuma image(40, 20);
    image.fill([](int x, int) { return 100 + x / 10; });
    EXPECT_NEAR(measure_photometric(image.view(), image.view(), serial).contrast, 3.6, 1e-12);
}

// Against sorting: the contrast is the distance of two order statistics.
TEST(Photometric, ContrastIsThatOfTheFlatterView) {
    Serial serial;
    const OwnedLuma wide = groundline::test::noise_image(101, 77, 5, 0, 255);
    const OwnedLuma narrow = groundline::test::noise_image(101, 77, 6, 90, 130);
    std::vector<int> sorted;
    for (int y = 0; y < 77; ++y)
        for (int x = 0; x < 101; ++x)
            sorted.push_back(narrow.at(x, y));
    std::sort(sorted.begin(), sorted.end());
    const auto at = [&](double share) { return sorted[static_cast<std::size_t>(share * sorted.size())]; };
    const PhotometricEvidence evidence = measure_photometric(wide.view(), narrow.view(), serial);
    EXPECT_NEAR(evidence.contrast, at(0.95) - at(0.05), 1.0);
    EXPECT_EQ(measure_photometric(narrow.view(), wide.view(), serial).contrast, evidence.contrast);
}

TEST(Photometric, DoesNotDependOnOrderLanesOrPadding) {
    Serial serial;
    test::Backwards backwards;
    const OwnedPair pair = groundline::test::shifted_pair(203, 101, 7, 5);
    const OwnedPair padded = groundline::test::shifted_pair(203, 101, 7, 5, 37);
    const PhotometricEvidence a = measure_photometric(pair.left.view(), pair.right.view(), serial);
    const PhotometricEvidence b = measure_photometric(padded.left.view(), padded.right.view(), backwards);
    EXPECT_EQ(a.gain, b.gain);
    EXPECT_EQ(a.offset, b.offset);
    EXPECT_EQ(a.mismatch, b.mismatch);
    EXPECT_EQ(a.contrast, b.contrast);
}

TEST(Photometric, TinyPicturesAreMeasuredToo) {
    Serial serial;
    for (const int height : {1, 3, 7, 9}) {
        const OwnedLuma image = groundline::test::noise_image(5, height, 8);
        const PhotometricEvidence evidence = measure_photometric(image.view(), image.view(), serial);
        EXPECT_NEAR(evidence.mismatch, 0.0, 1e-6) << height;
    }
}

// Real pairs taken by equal, equally exposed cameras stay below 3 grey levels, and with gain 1.06 and offset
// 4 on one of them rise above 5.
TEST(Photometric, TellsEqualFromUnequalExposureOnRealPairs) {
    const std::filesystem::path data = GROUNDLINE_SOURCE_DIR "/../shared/data";
    if (!std::filesystem::exists(data)) GTEST_SKIP() << "no real pairs at " << data;
    Serial serial;
    const auto load = [](const std::filesystem::path& path) {
        const cv::Mat bgr = cv::imread(path.string(), cv::IMREAD_COLOR);
        OwnedLuma image(bgr.cols, bgr.rows);
        image.fill([&](int x, int y) {
            const auto& p = bgr.at<cv::Vec3b>(y, x);
            return luma_of(p[2], p[1], p[0]);
        });
        return image;
    };
    for (const char* set :
         {"devon_rover1", "devon_rover2", "kitti2012_000000", "kitti2012_000003", "kitti2012_000065",
          "kitti2012_000072", "kitti2012_000084", "mb_aloe", "mb_motorcycle", "mb_teddy", "mb_tsukuba",
          "mb_wood2", "road_course_46", "road_course_89"}) {
        const OwnedLuma left = load(data / set / "left.png");
        OwnedLuma right = load(data / set / "right.png");
        EXPECT_LT(measure_photometric(left.view(), right.view(), serial).mismatch, 3.0) << set;
        groundline::test::change_exposure(right, 1.06, 4);
        EXPECT_GT(measure_photometric(left.view(), right.view(), serial).mismatch, 5.0) << set;
    }
}

}  // namespace
}  // namespace groundline::rig
