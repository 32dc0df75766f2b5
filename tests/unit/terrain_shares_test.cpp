#include "terrain/shares.hpp"

#include <gtest/gtest.h>

#include "unit/terrain_scene.hpp"

namespace groundline::terrain {
namespace {

TEST(Shares, CountPixelsOfEachClassAndNoneBehindTheRows) {
    test::Dice dice(7);
    // 2040 pixels fill a byte of every counter.
    for (const int width : {1, 7, 8, 9, 64, 97, 2039, 2040, 2041, 2048, 4100})
        for (const int one_kind : {-1, 0, 1, 2, 3}) {
            Arena arena;
            const Mask mask = arena.image<TerrainClass>(width, 3);
            std::array<int, kTerrainClasses> counts{};
            for (int v = 0; v < 3; ++v)
                for (int u = 0; u < width + 32; ++u) {
                    const int kind = one_kind >= 0 ? one_kind : static_cast<int>(dice.bits() % 4);
                    mask.row(v)[u] = static_cast<TerrainClass>(kind);
                    if (u < width) ++counts[static_cast<std::size_t>(kind)];
                }
            std::array<double, kTerrainClasses> share{};
            shares_of(mask, share);
            for (std::size_t i = 0; i < counts.size(); ++i)
                EXPECT_EQ(share[i], counts[i] / (3.0 * width)) << width << ' ' << one_kind << ' ' << i;
        }
    std::array<double, kTerrainClasses> share{1.0, 1.0, 1.0, 1.0};
    shares_of({}, share);
    for (const double each : share)
        EXPECT_EQ(each, 0.0);
}

}  // namespace
}  // namespace groundline::terrain
