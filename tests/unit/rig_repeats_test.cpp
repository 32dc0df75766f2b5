// New pictures, the same again, and one camera for two.
#include "rig/repeats.hpp"

#include <gtest/gtest.h>

#include "support/random_images.hpp"

namespace groundline::rig {
namespace {

using groundline::test::noise_image;
using groundline::test::OwnedLuma;

TEST(Repeats, OnePixelTellsTwoViewsApart) {
    const OwnedLuma left = noise_image(67, 43, 1);
    OwnedLuma right(67, 43, 9);
    right.fill([&](int x, int y) { return left.at(x, y); });
    EXPECT_TRUE(identical(left.view(), right.view())) << "padding does not count";
    for (const auto& [x, y] : {std::pair{0, 0}, {66, 0}, {31, 21}, {0, 42}, {66, 42}}) {
        OwnedLuma other = right;
        other.at(x, y) = static_cast<std::uint8_t>(other.at(x, y) ^ 1);
        EXPECT_FALSE(identical(left.view(), other.view())) << x << ' ' << y;
    }
}

TEST(Repeats, CountsTheSamePairInARow) {
    const OwnedLuma a = noise_image(64, 48, 1);
    const OwnedLuma b = noise_image(64, 48, 2);
    RepeatCounter counter;
    EXPECT_EQ(counter.count(a.view(), b.view()), 1);
    EXPECT_EQ(counter.count(a.view(), b.view()), 2);
    EXPECT_EQ(counter.count(a.view(), b.view()), 3);
    EXPECT_EQ(counter.count(b.view(), a.view()), 1) << "exchanged is another pair";
    EXPECT_EQ(counter.count(a.view(), b.view()), 1);
    EXPECT_EQ(counter.count(a.view(), b.view()), 2);
    EXPECT_EQ(counter.count(a.view(), a.view()), 1) << "one camera that goes on is enough";
}

TEST(Repeats, BlackIsAPictureLikeAnyOther) {
    OwnedLuma black(64, 48);
    black.fill([](int, int) { return 0; });
    RepeatCounter counter;
    for (int n = 1; n <= 4; ++n)
        EXPECT_EQ(counter.count(black.view(), black.view()), n);
}

// A camera's noise, one grey level in one pixel of ten, anywhere; widths that are no whole words.
TEST(Repeats, NoiseMakesEveryPictureNew) {
    for (const int width : {61, 64, 71}) {
        OwnedLuma left = noise_image(width, 48, 1);
        const OwnedLuma right = noise_image(width, 48, 2);
        RepeatCounter counter;
        std::uint32_t state = 7;
        for (int frame = 0; frame < 200; ++frame) {
            EXPECT_EQ(counter.count(left.view(), right.view()), 1) << frame;
            left.fill([&](int x, int y) {
                state = state * 1664525U + 1013904223U;
                return (state >> 16U) % 10U == 0 ? left.at(x, y) ^ 1 : left.at(x, y);
            });
        }
    }
}

TEST(Repeats, EveryPixelOfALookedAtRowCounts) {
    const OwnedLuma left = noise_image(67, 17, 1);
    const OwnedLuma right = noise_image(67, 17, 2);
    for (int x = 0; x < 67; ++x)
        for (const int y : {0, 8, 16}) {
            RepeatCounter counter;
            counter.count(left.view(), right.view());
            OwnedLuma other = right;
            other.at(x, y) = static_cast<std::uint8_t>(other.at(x, y) ^ 128);
            EXPECT_EQ(counter.count(left.view(), other.view()), 1) << x << ' ' << y;
        }
}

}  // namespace
}  // namespace groundline::rig
