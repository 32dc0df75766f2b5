// Disturbed pictures against their plain definitions, and the noise against its statistics.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <set>
#include <vector>

#include "cli/perturbation.hpp"
#include "support/random_images.hpp"

namespace groundline::cli {
namespace {

using test::noise_image;
using test::OwnedLuma;

// The value of every pixel from function(x, y), with a row stride that no result may depend on.
template <typename Function>
void expect_pixels(const OwnedLuma& found, Function function) {
    for (int y = 0; y < found.height(); ++y)
        for (int x = 0; x < found.width(); ++x)
            ASSERT_EQ(static_cast<int>(found.at(x, y)), function(x, y)) << "at " << x << ", " << y;
}

int level_of(double value) {
    return static_cast<int>(std::min(std::max(std::floor(value + 0.5), 0.0), 255.0));
}

TEST(Perturbation, ExposureIsRoundedAndClamped) {
    OwnedLuma ramp(256, 1, 3);
    ramp.fill([](int x, int) { return x; });
    OwnedLuma found(256, 1, 5);
    change_exposure(ramp.view(), 110, 5, found.view());
    expect_pixels(found, [](int x, int) { return level_of((11 * x + 50) / 10.0); });
    EXPECT_EQ(found.at(5, 0), 11);     // 10.5 and
    EXPECT_EQ(found.at(228, 0), 255);  // 255.8
    change_exposure(ramp.view(), 50, -20, found.view());
    expect_pixels(found, [](int x, int) { return level_of(x / 2.0 - 20.0); });
    change_exposure(ramp.view(), 100, 0, found.view());
    expect_pixels(found, [](int x, int) { return x; });
}

TEST(Perturbation, ShiftRepeatsTheFirstRow) {
    const OwnedLuma image = noise_image(7, 5, 3);
    OwnedLuma found(7, 5, 2);
    for (const int rows : {0, 1, 3, 9}) {
        shift_down(image.view(), rows, found.view());
        expect_pixels(found, [&](int x, int y) { return image.at(x, y < rows ? 0 : y - rows); });
    }
}

TEST(Perturbation, BlurIsTheBinomialWindow) {
    OwnedLuma point(9, 9);
    point.fill([](int x, int y) { return x == 4 && y == 4 ? 255 : 0; });
    OwnedLuma found(9, 9, 4);
    blur_binomial_5x5(point.view(), found.view());
    constexpr int kTaps[] = {0, 0, 1, 4, 6, 4, 1, 0, 0};
    expect_pixels(found, [&](int x, int y) { return level_of(255.0 * kTaps[x] * kTaps[y] / 256.0); });

    OwnedLuma flat(4, 3);  // smaller than the window: the border is repeated
    flat.fill([](int, int) { return 201; });
    OwnedLuma still(4, 3);
    blur_binomial_5x5(flat.view(), still.view());
    expect_pixels(still, [](int, int) { return 201; });

    OwnedLuma step(12, 1);
    step.fill([](int x, int) { return x < 6 ? 40 : 200; });
    OwnedLuma soft(12, 1);
    blur_binomial_5x5(step.view(), soft.view());
    constexpr int kSoft[] = {40, 40, 40, 40, 50, 90, 150, 190, 200, 200, 200, 200};
    expect_pixels(soft, [&](int x, int) { return kSoft[x]; });
}

// The noise of a picture so grey that nothing is clamped.
std::vector<int> noise_of(int width, int height, int sigma, std::uint64_t seed, int grey = 128) {
    OwnedLuma image(width, height);
    image.fill([&](int, int) { return grey; });
    OwnedLuma found(width, height, 1);
    add_noise(image.view(), sigma, seed, found.view());
    std::vector<int> noise;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            noise.push_back(found.at(x, y) - grey);
    return noise;
}

double mean_of_product(const std::vector<int>& a, const std::vector<int>& b, std::size_t lag) {
    double sum = 0.0;
    for (std::size_t i = 0; i + lag < a.size(); ++i)
        sum += static_cast<double>(a[i]) * b[i + lag];
    return sum / static_cast<double>(a.size() - lag);
}

TEST(Perturbation, NoiseIsNearlyGaussian) {
    constexpr int kSigma = 5;
    const std::vector<int> noise = noise_of(500, 400, kSigma, noise_seed(0, 0, 0));
    const auto count = static_cast<double>(noise.size());
    double sum = 0.0;
    int within_one = 0;
    int beyond_two = 0;
    int beyond_three = 0;
    for (const int value : noise) {
        sum += value;
        within_one += std::abs(value) <= kSigma ? 1 : 0;
        beyond_two += std::abs(value) > 2 * kSigma ? 1 : 0;
        beyond_three += std::abs(value) > 3 * kSigma ? 1 : 0;
        ASSERT_LE(std::abs(value), 6 * kSigma);
    }
    EXPECT_NEAR(sum / count, 0.0, 0.04);                                                 // 3.6 deviations
    EXPECT_NEAR(std::sqrt(mean_of_product(noise, noise, 0)), std::sqrt(25.083), 0.035);  // rounding adds 1/12
    EXPECT_NEAR(within_one / count, 0.7287, 0.005);   // a Gaussian's share within 5.5
    EXPECT_NEAR(beyond_two / count, 0.0357, 0.002);   // beyond 10.5
    EXPECT_NEAR(beyond_three / count, 0.0019, 5e-4);  // beyond 15.5
    for (const std::size_t lag : {1U, 2U, 3U, 4U, 500U})
        EXPECT_NEAR(mean_of_product(noise, noise, lag) / 25.0, 0.0, 0.01) << lag;
}

TEST(Perturbation, NoiseDependsOnTheSeedAloneAndIsAdded) {
    const std::vector<int> noise = noise_of(300, 100, 5, 7);
    EXPECT_EQ(noise_of(300, 100, 5, 7), noise);
    EXPECT_EQ(noise_of(300, 100, 5, 7, 90), noise);
    EXPECT_NE(noise_of(300, 100, 5, 8), noise);
    EXPECT_EQ(noise_of(300, 100, 0, 7), std::vector<int>(noise.size(), 0));
    // The numbers themselves: the same on every machine.
    EXPECT_EQ(noise_of(8, 1, 5, 7), (std::vector{-3, -1, 1, -1, 2, 0, 1, -10}));
    for (const int value : noise_of(300, 100, 5, 7, 255))
        ASSERT_LE(value, 0);  // clamped, not wrapped

    // Views, pairs and repetitions have noise of their own.
    std::set<std::uint64_t> seeds;
    for (std::uint64_t repetition = 0; repetition < 5; ++repetition)
        for (std::uint64_t pair = 0; pair < 20; ++pair)
            for (std::uint64_t view = 0; view < 2; ++view)
                seeds.insert(noise_seed(repetition, pair, view));
    EXPECT_EQ(seeds.size(), 200U);
    const std::vector<int> left = noise_of(500, 400, 5, noise_seed(0, 3, 0));
    for (const std::uint64_t other : {noise_seed(0, 3, 1), noise_seed(0, 4, 0), noise_seed(1, 3, 0)})
        for (const std::size_t lag : {0U, 1U, 2U})
            EXPECT_NEAR(mean_of_product(left, noise_of(500, 400, 5, other), lag) / 25.0, 0.0, 0.01);
}

}  // namespace
}  // namespace groundline::cli
