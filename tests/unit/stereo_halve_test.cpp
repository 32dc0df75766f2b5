// Views at half their size against the plain statement, in one go and in parts.
#include "stereo/halve.hpp"

#include <gtest/gtest.h>

#include "core/arena.hpp"
#include "stereo/pyramid_integer.hpp"
#include "support/random_images.hpp"

namespace groundline::stereo {
namespace {

TEST(Halve, IsTheRoundedMeanOfFourAtEverySize) {
    for (const int width : {1, 2, 31, 64, 97})
        for (const int height : {1, 2, 15, 32}) {
            const auto view = test::noise_image(width, height, static_cast<unsigned>(width + 100 * height));
            Arena arena;
            const auto expected = arena.image<std::uint8_t>(halved(width), halved(height));
            const auto half = arena.image<std::uint8_t>(halved(width), halved(height));
            halve(view.view(), expected);
            for (int y = 0; y < half.height; y += 5)
                halve_rows(view.view(), y, std::min(y + 5, half.height), half);
            for (int y = 0; y < half.height; ++y)
                for (int x = 0; x < half.width; ++x)
                    ASSERT_EQ(half.at(x, y), expected.at(x, y)) << width << "x" << height;
        }
}

TEST(Halve, RoundsHalvesUp) {
    Arena arena;
    const auto view = arena.image<std::uint8_t>(2, 2);
    const auto half = arena.image<std::uint8_t>(1, 1);
    view.at(0, 0) = view.at(1, 0) = 1;
    halve_rows(view, 0, 1, half);
    EXPECT_EQ(half.at(0, 0), 1);
    fill_pixels(view, 255);
    halve_rows(view, 0, 1, half);
    EXPECT_EQ(half.at(0, 0), 255);
}

}  // namespace
}  // namespace groundline::stereo
