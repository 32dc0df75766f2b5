// Removal of the local mean against its formula.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "stereo/local_mean.hpp"
#include "support/random_images.hpp"

namespace groundline::stereo {
namespace {

using test::OwnedLuma;

int expected_at(const OwnedLuma& image, int x, int y) {
    int sum = 0;
    for (int j = -7; j <= 7; ++j)
        for (int i = -7; i <= 7; ++i)
            sum +=
                image.at(std::clamp(x + i, 0, image.width() - 1), std::clamp(y + j, 0, image.height() - 1));
    return std::clamp(image.at(x, y) - (sum + 112) / 225 + 128, 0, 255);
}

TEST(LocalMean, EqualsTheFormulaAtAnySizeStrideAndSplit) {
    for (const auto& [width, height] :
         {std::pair{1, 1}, std::pair{3, 40}, std::pair{11, 11}, std::pair{65, 33}, std::pair{97, 41}})
        for (const int rows : {1, 7, 100}) {
            const OwnedLuma image = test::noise_image(width, height, 300, 0, 255, 3);
            OwnedLuma result(width, height, 9);
            std::vector<std::uint16_t> scratch(static_cast<std::size_t>(local_mean_scratch(width)));
            for (int first = 0; first < height; first += rows)
                subtract_local_mean(image.view(), result.view(), first, std::min(first + rows, height),
                                    scratch);
            for (int y = 0; y < height; ++y)
                for (int x = 0; x < width; ++x)
                    ASSERT_EQ(result.at(x, y), expected_at(image, x, y)) << x << ", " << y;
        }
}

TEST(LocalMean, WhiteStaysWithinSixteenBitsAndBecomesMiddleGrey) {
    OwnedLuma white(40, 40);
    white.fill([](int, int) { return 255; });
    OwnedLuma result(40, 40);
    std::vector<std::uint16_t> scratch(static_cast<std::size_t>(local_mean_scratch(40)));
    subtract_local_mean(white.view(), result.view(), 0, 40, scratch);
    for (int y = 0; y < 40; ++y)
        for (int x = 0; x < 40; ++x)
            ASSERT_EQ(result.at(x, y), 128);
}

TEST(LocalMean, AConstantAddedToTheImageChangesNothing) {
    OwnedLuma image = test::textured_image(80, 50, 301);
    OwnedLuma before(80, 50);
    OwnedLuma after(80, 50);
    std::vector<std::uint16_t> scratch(static_cast<std::size_t>(local_mean_scratch(80)));
    subtract_local_mean(image.view(), before.view(), 0, 50, scratch);
    image.fill([&](int x, int y) { return image.at(x, y) + 8; });
    subtract_local_mean(image.view(), after.view(), 0, 50, scratch);
    for (int y = 0; y < 50; ++y)
        for (int x = 0; x < 80; ++x)
            ASSERT_EQ(after.at(x, y), before.at(x, y));
}

}  // namespace
}  // namespace groundline::stereo
