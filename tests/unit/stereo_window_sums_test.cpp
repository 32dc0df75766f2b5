// The window tests against their definition, on every vector unit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "stereo/window_sums.hpp"
#include "support/allocation_count.hpp"
#include "support/random_images.hpp"
#include "support/vector_units.hpp"

namespace groundline::stereo {
namespace {

using test::OwnedLuma;

struct Sums {
    int saturated = 0;
    int texture = 0;
};

Sums window_sums(ConstLuma given, ConstLuma matched, int x, int y) {
    Sums sums;
    for (int j = -5; j <= 5; ++j)
        for (int i = -5; i <= 5; ++i) {
            const int u = std::clamp(x + i, 0, given.width - 1);
            const int v = std::clamp(y + j, 0, given.height - 1);
            sums.saturated += given.at(u, v) == 0 || given.at(u, v) == 255 ? 1 : 0;
            sums.texture += std::abs(matched.at(u, v) - matched.at(std::max(u - 1, 0), v));
        }
    return sums;
}

Invalid reason(const Sums& sums, const CheckLimits& limits) {
    if (100 * sums.saturated > limits.saturated_percent * 121) return Invalid::kSaturation;
    return sums.texture < limits.texture ? Invalid::kTexture : Invalid::kNone;
}

// Counts of each reason, summed over all comparisons, to see that each was met.
struct Met {
    int none = 0;
    int saturation = 0;
    int texture = 0;
};

// Rows in bands of `band`, as tasks would take them, under several limits each.
void compare(ConstLuma given, ConstLuma matched, int band, Met& met) {
    const int width = given.width;
    const int height = given.height;
    std::vector<Sums> sums;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            sums.push_back(window_sums(given, matched, x, y));
    const int some_texture = sums[sums.size() / 2].texture;
    for (const auto& [percent, texture] : std::vector<std::pair<int, int>>{{25, 60},
                                                                           {0, some_texture},
                                                                           {100, some_texture},
                                                                           {50, some_texture + 1},
                                                                           {1, 0},
                                                                           {99, 100000},
                                                                           {100, 30855},
                                                                           {100, 30856}}) {
        CheckLimits limits;
        limits.saturated_percent = percent;
        limits.texture = texture;
        Arena arena;
        const WindowColumns columns(width, arena);
        const auto out = arena.image<Invalid>(width, 1);
        for (int y = 0; y < height; ++y) {
            const std::uint64_t before = test::allocations();
            judge_windows(given, matched, y, y % band == 0, limits, columns, out.row(0));
            ASSERT_EQ(test::allocations(), before);
            for (int x = 0; x < width; ++x) {
                const Invalid expected = reason(sums[static_cast<std::size_t>(y * width + x)], limits);
                ASSERT_EQ(out.at(x, 0), expected) << x << ", " << y << " of " << width << "x" << height
                                                  << ", limits " << percent << " " << texture;
                met.none += expected == Invalid::kNone ? 1 : 0;
                met.saturation += expected == Invalid::kSaturation ? 1 : 0;
                met.texture += expected == Invalid::kTexture ? 1 : 0;
            }
        }
    }
}

TEST(StereoWindowSums, JudgeEachPixelByItsWindow) {
    on_every_vector_unit([] {
        Met met;
        std::uint32_t seed = 1;
        for (const int width : {11, 12, 13, 16, 31, 32, 33, 63, 64, 65, 100, 129})
            for (const auto& [height, band] : {std::pair{11, 16}, std::pair{12, 5}, std::pair{35, 16}}) {
                const OwnedLuma matched = test::noise_image(width, height, ++seed, 100, 104, 3);
                // Left and lower parts ever more often at 0 or 255.
                OwnedLuma given = test::noise_image(width, height, ++seed);
                given.fill([&](int x, int y) {
                    const int pixel = given.at(x, y);
                    return pixel * height > 256 * y ? pixel : x % 2 * 255;
                });
                compare(given.view(), matched.view(), band, met);
                compare(given.view(), given.view(), band, met);
            }
        EXPECT_GT(met.none, 1000);
        EXPECT_GT(met.saturation, 1000);
        EXPECT_GT(met.texture, 1000);
    });
}

TEST(StereoWindowSums, HoldTheLargestSums) {
    on_every_vector_unit([] {
        Met met;
        for (const int width : {11, 40, 77}) {
            OwnedLuma image(width, 23, 1);
            image.fill([](int, int) { return 255; });
            compare(image.view(), image.view(), 16, met);
            image.fill([](int x, int y) { return (x + y) % 2 * 255; });
            compare(image.view(), image.view(), 16, met);
            image.fill([](int x, int y) { return 1 + (x + y) % 2 * 253; });
            compare(image.view(), image.view(), 16, met);
            image.fill([](int, int) { return 128; });
            compare(image.view(), image.view(), 16, met);
        }
        EXPECT_GT(met.none, 0);
        EXPECT_GT(met.saturation, 0);
        EXPECT_GT(met.texture, 0);
    });
}

}  // namespace
}  // namespace groundline::stereo
