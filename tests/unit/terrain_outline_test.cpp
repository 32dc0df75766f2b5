#include "terrain/outline.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <vector>

#include "unit/terrain_scene.hpp"

namespace groundline::terrain {
namespace {

using test::Dice;

// What the header says, pixel by pixel.
struct Plain {
    ConstMask before;
    ConstImageView<Invalid> invalid;
    OutlineReach reach;

    bool obstacle(int u, int v) const {
        return u >= 0 && v >= 0 && u < before.width && v < before.height &&
               before.at(u, v) == TerrainClass::kObstacle;
    }
    // In a gap of the row (or, with `down`, of the column) that ends at obstacles and is short enough.
    bool in_gap(int u, int v, bool down) const {
        const int here = down ? v : u;
        const int size = down ? before.height : before.width;
        const auto mark = [&](int x) { return down ? obstacle(u, x) : obstacle(x, v); };
        int low = here;
        while (low >= 0 && !mark(low))
            --low;
        int high = here;
        while (high < size && !mark(high))
            ++high;
        if (low == here) return true;
        if (low < 0 && high == size) return false;
        const int gap = high - low - 1;
        return gap <= (low < 0 || high == size ? reach.gap : 2 * reach.gap);
    }
    TerrainClass filled(int u, int v) const {
        const TerrainClass kind = before.at(u, v);
        const bool open = kind == TerrainClass::kUnknown && invalid.at(u, v) != Invalid::kNone;
        return open && (in_gap(u, v, false) || in_gap(u, v, true)) ? TerrainClass::kObstacle : kind;
    }
    TerrainClass after(int u, int v, const std::vector<TerrainClass>& all_filled) const {
        const auto at = [&](int x, int y) {
            return all_filled[static_cast<std::size_t>(y * before.width + x)];
        };
        if (at(u, v) != TerrainClass::kTraversable) return at(u, v);
        for (int y = 0; y < before.height; ++y)
            for (int x = 0; x < before.width; ++x) {
                const int aside = std::abs(x - u);
                const int down = v - y;  // of the thing
                if (at(x, y) == TerrainClass::kObstacle && aside <= reach.beside && down <= reach.before &&
                    -down <= reach.beyond)
                    return TerrainClass::kUnknown;
                if (at(x, y) == TerrainClass::kDrop && aside <= reach.lip && std::abs(down) <= reach.lip)
                    return TerrainClass::kUnknown;
            }
        return TerrainClass::kTraversable;
    }
};

// `rarity`: one pixel of this many begins another class.
void expect_like_plain(int width, int height, const OutlineReach& reach, std::uint32_t rarity, Dice& dice) {
    Arena arena;
    Outline outline;
    outline.take(arena, width, height);
    const Mask mask = arena.image<TerrainClass>(width, height);
    const Mask before = arena.image<TerrainClass>(width, height);
    const auto invalid = arena.image<Invalid>(width, height);
    for (int v = 0; v < height; ++v) {
        for (int u = 0; u < width; ++u) {
            const bool as_left = u > 0 && dice.bits() % rarity != 0;
            const bool as_above = !as_left && v > 0 && dice.bits() % 3 != 0;
            mask.at(u, v) = as_left    ? mask.at(u - 1, v)
                            : as_above ? mask.at(u, v - 1)
                                       : static_cast<TerrainClass>(dice.bits() % 4);
            invalid.at(u, v) = dice.bits() % 4 == 0 ? Invalid::kNone : static_cast<Invalid>(dice.bits() % 11);
        }
        for (int u = width; u < width + 64; ++u) {  // means nothing
            mask.row(v)[u] = static_cast<TerrainClass>(dice.bits() % 4);
            invalid.row(v)[u] = static_cast<Invalid>(dice.bits() % 11);
        }
    }
    copy_pixels<TerrainClass>(mask, before);
    // Twice: nothing may be left over from another frame.
    for (int round = 0; round < 2; ++round) {
        copy_pixels<TerrainClass>(before, mask);
        outline.apply(reach, invalid, mask);
    }
    const Plain plain{before, invalid, reach};
    std::vector<TerrainClass> filled;
    for (int v = 0; v < height; ++v)
        for (int u = 0; u < width; ++u)
            filled.push_back(plain.filled(u, v));
    for (int v = 0; v < height; ++v)
        for (int u = 0; u < width; ++u)
            ASSERT_EQ(mask.at(u, v), plain.after(u, v, filled))
                << u << ' ' << v << " of " << width << 'x' << height << ", reaches " << reach.gap << ' '
                << reach.beside << ' ' << reach.beyond << ' ' << reach.before << ' ' << reach.lip;
}

TEST(Outline, IsWhatTheRuleSaysPixelByPixel) {
    Dice dice(11);
    const auto reaches = [&](int gap_px, std::uint32_t below) {
        const auto any = [&] { return static_cast<int>(dice.bits() % below); };
        return OutlineReach{gap_px, any(), any(), any(), any()};
    };
    for (const int width : {1, 5, 8, 63, 64, 65, 100, 128, 131, 200})
        for (const int gap_px : {0, 1, 2, 3, 8, 40})
            for (const std::uint32_t rarity : {2U, 12U, 60U})
                expect_like_plain(width, 1 + static_cast<int>(dice.bits() % 40), reaches(gap_px, 7), rarity,
                                  dice);
    expect_like_plain(150, 60, {8, 75, 75, 75, 75}, 60, dice);
    expect_like_plain(150, 60, {8, 3, 70, 0, 1}, 60, dice);
    expect_like_plain(320, 48, {8, 4, 8, 3, 4}, 40, dice);
}

TEST(Outline, NothingBecomesTraversableAndThingsStay) {
    Arena arena;
    Outline outline;
    outline.take(arena, 90, 50);
    const Mask mask = arena.image<TerrainClass>(90, 50);
    const Mask before = arena.image<TerrainClass>(90, 50);
    const auto invalid = arena.image<Invalid>(90, 50);
    Dice dice(5);
    for (int v = 0; v < 50; ++v)
        for (int u = 0; u < 90; ++u) {
            before.at(u, v) = dice.bits() % 4 == 0 ? static_cast<TerrainClass>(dice.bits() % 4)
                                                   : TerrainClass::kTraversable;
            invalid.at(u, v) = dice.bits() % 2 == 0 ? Invalid::kNone : Invalid::kTexture;
        }
    copy_pixels<TerrainClass>(before, mask);
    outline.apply({8, 4, 8, 3, 4}, invalid, mask);
    int filled = 0;
    for (int v = 0; v < 50; ++v)
        for (int u = 0; u < 90; ++u) {
            const TerrainClass was = before.at(u, v);
            const TerrainClass is = mask.at(u, v);
            if (was == TerrainClass::kObstacle || was == TerrainClass::kDrop) {
                EXPECT_EQ(is, was);
            } else if (is != was) {
                EXPECT_EQ(
                    is, was == TerrainClass::kTraversable ? TerrainClass::kUnknown : TerrainClass::kObstacle);
                filled += was == TerrainClass::kUnknown ? 1 : 0;
            }
        }
    EXPECT_GT(filled, 10);
}

}  // namespace
}  // namespace groundline::terrain
