// Patches taken out, against a forest over every pixel, on every vector unit.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "stereo/speckle.hpp"
#include "support/allocation_count.hpp"
#include "support/vector_units.hpp"
#include "unit/stereo_test_tools.hpp"

namespace groundline::stereo {
namespace {

// A root holds minus the size of its patch, every other pixel the index of a parent.
class Forest {
  public:
    explicit Forest(int pixels) : parents_(static_cast<std::size_t>(pixels), -1) {}
    int root_of(int pixel) const {
        while (at(pixel) >= 0)
            pixel = at(pixel);
        return pixel;
    }
    int size_of(int pixel) const { return -at(root_of(pixel)); }
    void unite(int a, int b) {
        a = root_of(a);
        b = root_of(b);
        if (a == b) return;
        if (at(a) > at(b)) std::swap(a, b);
        parents_[static_cast<std::size_t>(a)] += at(b);
        parents_[static_cast<std::size_t>(b)] = a;
    }

    int pixels() const { return static_cast<int>(parents_.size()); }

  private:
    int at(int pixel) const { return parents_[static_cast<std::size_t>(pixel)]; }
    std::vector<int> parents_;
};

int sign(int value) {
    return (value > 0 ? 1 : 0) - (value < 0 ? 1 : 0);
}

// Pairs around each pixel that both views hold, and those ordered alike, summed over each patch at its root.
struct Likeness {
    std::vector<int> compared;
    std::vector<int> alike;

    Likeness(const DisparityMap& map, ConstLuma left, ConstLuma right, const Forest& forest)
        : compared(static_cast<std::size_t>(forest.pixels()), 0), alike(compared) {
        const int width = map.width();
        const auto within = [&](int x, int y) {
            return x >= 4 && y >= 2 && x < width - 4 && y < map.height() - 2;
        };
        for (int y = 0; y < map.height(); ++y)
            for (int x = 0; x < width; ++x) {
                const int match = x - static_cast<int>(std::floor(map.disparity_q4.at(x, y) / 16.0 + 0.5));
                if (map.invalid.at(x, y) != Invalid::kNone || !within(x, y) || !within(match, y)) continue;
                const auto root = static_cast<std::size_t>(forest.root_of(y * width + x));
                for (const auto& [apart, row] : {std::pair{2, y}, {4, y}, {3, y - 2}, {3, y + 2}}) {
                    ++compared[root];
                    alike[root] += sign(left.at(x + apart, row) - left.at(x - apart, row)) ==
                                           sign(right.at(match + apart, row) - right.at(match - apart, row))
                                       ? 1
                                       : 0;
                }
            }
    }
};

void remove_speckles_plainly(const DisparityMap& map, ConstLuma left, ConstLuma right,
                             const PatchLimits& limits) {
    const int width = map.width();
    const int height = map.height();
    Forest forest(width * height);
    const auto belong_together = [&](int x, int y, int u, int v) {
        return map.invalid.at(x, y) == Invalid::kNone && map.invalid.at(u, v) == Invalid::kNone &&
               std::abs(map.disparity_q4.at(x, y) - map.disparity_q4.at(u, v)) <= kDisparityOne;
    };
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            if (x > 0 && belong_together(x, y, x - 1, y)) forest.unite(y * width + x, y * width + x - 1);
            if (y > 0 && belong_together(x, y, x, y - 1)) forest.unite(y * width + x, (y - 1) * width + x);
        }
    const Likeness likeness(map, left, right, forest);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            if (map.invalid.at(x, y) != Invalid::kNone) continue;
            const int size = forest.size_of(y * width + x);
            const auto root = static_cast<std::size_t>(forest.root_of(y * width + x));
            if (size < limits.smallest)
                map.invalid.at(x, y) = Invalid::kSpeckle;
            else if (size < 4096 &&
                     100 * likeness.alike[root] < limits.alike_percent * likeness.compared[root])
                map.invalid.at(x, y) = Invalid::kCost;
            else
                continue;
            map.disparity_q4.at(x, y) = 0;
        }
}

// What a map holds at a pixel; kGap for none.
constexpr int kGap = 1 << 20;

// Maps of one size, filled from disparity(x, y), and one scratch that all of them use.
class Compared {
  public:
    Compared(int width, int height)
        : width_(width),
          height_(height),
          fast_(width, height),
          plain_(width, height),
          left_(test::textured_image(width, height, 5)),
          right_(left_),
          scratch_(width, arena_) {
        // From columns whose pixels are those of the left view to columns that have nothing of it.
        const test::OwnedLuma noise = test::noise_image(width, height, 6);
        right_.fill([&](int x, int y) {
            const int share = x % 40;
            return (left_.at(x, y) * (39 - share) + noise.at(x, y) * share) / 39;
        });
    }

    // Both must leave the same map; erased() is what they erased as too small, unlike() as too unlike.
    template <typename Disparity>
    void compare(const PatchLimits& limits, Disparity disparity) {
        // Behind each row lies what would belong to it.
        for (int y = 0; y < height_; ++y)
            for (int x = 0; x < width_ + 32; ++x) {
                const int d = disparity(x, y);
                const bool valid = d != kGap;
                for (const OwnedResult* result : {&fast_, &plain_}) {
                    result->map.invalid.row(y)[x] = valid ? Invalid::kNone : Invalid::kTexture;
                    result->map.disparity_q4.row(y)[x] = static_cast<std::int16_t>(valid ? d : 0);
                }
            }
        remove_speckles_plainly(plain_.map, left_.view(), right_.view(), limits);
        const std::uint64_t before = test::allocations();
        remove_speckles(fast_.map, left_.view(), right_.view(), limits, scratch_);
        EXPECT_EQ(test::allocations(), before);
        EXPECT_EQ(differing_pixels(fast_, plain_), 0);
        erased_ = count_reason(plain_, Invalid::kSpeckle);
        unlike_ = count_reason(plain_, Invalid::kCost);
    }
    int erased() const { return erased_; }
    int unlike() const { return unlike_; }

  private:
    int width_;
    int height_;
    OwnedResult fast_;
    OwnedResult plain_;
    test::OwnedLuma left_;
    test::OwnedLuma right_;
    Arena arena_;
    SpeckleScratch scratch_;
    int erased_ = 0;
    int unlike_ = 0;
};

// A number of its own for each pixel, the same in every call.
std::uint32_t hash(int x, int y, std::uint32_t seed) {
    std::uint32_t h = static_cast<std::uint32_t>(x) * 0x9E3779B1U ^
                      static_cast<std::uint32_t>(y) * 0x85EBCA77U ^ seed * 0xC2B2AE3DU;
    h = (h ^ h >> 15U) * 0x2C1B3C6DU;
    h = (h ^ h >> 12U) * 0x297A2D39U;
    return h ^ h >> 15U;
}

TEST(StereoSpeckle, ErasesWhatAForestOverAllPixelsErases) {
    on_every_vector_unit([] {
        int unlike = 0;
        for (const int width : {1, 2, 7, 11, 31, 32, 33, 63, 64, 65, 127, 128, 129, 200})
            for (const int height : {1, 2, 37}) {
                Compared maps(width, height);
                for (std::uint32_t seed = 0; seed < 24; ++seed) {
                    const std::uint32_t levels = 1 + seed % 6;
                    const std::uint32_t gaps = seed % 5;
                    const int smallest = std::vector{0, 1, 2, 3, 9, 40, 100000}[hash(0, 1, seed) % 7];
                    const int percent = std::vector{0, 50, 70, 80, 100}[hash(1, 1, seed) % 5];
                    SCOPED_TRACE(std::to_string(width) + "x" + std::to_string(height) + " seed " +
                                 std::to_string(seed) + " smallest " + std::to_string(smallest) + " alike " +
                                 std::to_string(percent));
                    maps.compare({smallest, percent}, [&](int x, int y) {
                        const std::uint32_t h = hash(x, y, seed);
                        return h % 8 < gaps ? kGap : static_cast<int>(h / 8 % levels) * 10 - 20;
                    });
                    unlike += maps.unlike();
                }
            }
        EXPECT_GT(unlike, 1000);
    });
}

// Patches that part and meet again, so that parts which are found to be one come in every order.
TEST(StereoSpeckle, FollowsPatchesOfAnyShape) {
    // A square spiral, one pixel wide and one apart: every other ring, each cut once and led on to the next.
    const auto on_spiral = [](int x, int y, int side) {
        const int ring = std::min({x, y, side - 1 - x, side - 1 - y});
        if (ring < 0) return false;
        return ring % 2 == 0 ? !(x == ring && y == ring + 1) : x == ring && y == ring + 1;
    };
    const std::vector<std::pair<std::string, int (*)(int, int)>> shapes = {
        {"columns", [](int x, int) { return x % 2 * 40; }},
        {"rows", [](int, int y) { return y % 2 * 40; }},
        {"chequer", [](int x, int y) { return (x + y) % 2 * 40; }},
        {"comb open above", [](int x, int y) { return x % 2 != 0 && y < 69 ? kGap : 0; }},
        {"comb open below", [](int x, int y) { return x % 2 != 0 && y > 0 ? kGap : 0; }},
        {"bowls in bowls", [](int x, int y) { return std::max(std::abs(x - 64), y) % 3 == 0 ? kGap : 7; }},
        {"roofs in roofs",
         [](int x, int y) { return std::max(std::abs(x - 64), 70 - y) % 3 == 0 ? kGap : 7; }},
        {"snake", [](int x, int y) { return y % 2 == 0 || x == (y % 4 == 1 ? 128 : 0) ? 0 : kGap; }},
        {"snake upright", [](int x, int y) { return x % 2 == 0 || y == (x % 4 == 1 ? 69 : 0) ? 0 : kGap; }},
        {"diagonals", [](int x, int y) { return (x + y) % 5 < 2 ? 0 : kGap; }},
        {"other diagonals", [](int x, int y) { return (x - y + 700) % 5 < 2 ? 0 : kGap; }},
        {"ramp", [](int x, int y) { return 16 * x + 9 * y; }},
        {"steep ramp", [](int x, int y) { return 17 * x + 9 * y; }},
        {"steps of one pixel", [](int x, int y) { return x % 3 == 2 ? kGap : 16 * (x % 3) + 16 * y; }},
        {"tiles", [](int x, int y) { return (x / 10 + y / 9) % 2 * 100; }},
        {"all", [](int, int) { return 5; }},
        {"none", [](int, int) { return kGap; }},
    };
    on_every_vector_unit([&] {
        Compared maps(129, 70);
        for (const int smallest : {2, 36, 90, 100, 1000, 100000}) {
            for (const auto& [name, shape] : shapes) {
                SCOPED_TRACE(name + ", smallest " + std::to_string(smallest));
                maps.compare({smallest, 80}, shape);
                if (smallest == 100000) {
                    EXPECT_EQ(maps.erased() == 0, name == "none");
                }
            }
            SCOPED_TRACE("spiral, smallest " + std::to_string(smallest));
            maps.compare({smallest, 80}, [&](int x, int y) { return on_spiral(x, y, 70) ? 3 : 90; });
        }
    });
}

TEST(StereoSpeckle, OnePixelApartIsTogetherAndASixteenthMoreIsNot) {
    on_every_vector_unit([] {
        Compared maps(40, 2);
        for (const int base : {0, -32768, 32767 - 17}) {
            maps.compare({2, 0},
                         [&](int x, int y) { return x % 3 == 2 || y == 1 ? kGap : base + x % 3 * 16; });
            EXPECT_EQ(maps.erased(), 1);  // the last pixel, whose neighbour lies outside
            maps.compare({2, 0},
                         [&](int x, int y) { return x % 3 == 2 || y == 1 ? kGap : base + x % 3 * 17; });
            EXPECT_EQ(maps.erased(), 27);
            maps.compare({2, 0}, [&](int x, int y) { return x % 2 == 1 ? kGap : base + y * 16; });
            EXPECT_EQ(maps.erased(), 0);
            maps.compare({2, 0}, [&](int x, int y) { return x % 2 == 1 ? kGap : base + y * 17; });
            EXPECT_EQ(maps.erased(), 40);
        }
        // Differences that do not fit 16 bits.
        maps.compare({2, 0}, [](int x, int y) { return (x + y) % 2 == 0 ? -32768 : 32767; });
        EXPECT_EQ(maps.erased(), 80);
        maps.compare({2, 0}, [](int x, int y) { return (x + y) % 2 == 0 ? -32760 : 32766; });
        EXPECT_EQ(maps.erased(), 80);
    });
}

TEST(StereoSpeckle, OnlyPatchesThatNoiseCouldFormAreComparedWithTheViews) {
    on_every_vector_unit([] {
        Compared maps(129, 70);
        maps.compare({2, 100},
                     [](int x, int y) { return x < 100 && y * 100 + x < kLargestJudged - 1 ? 0 : kGap; });
        EXPECT_EQ(maps.unlike(), kLargestJudged - 1);
        maps.compare({2, 100},
                     [](int x, int y) { return x < 100 && y * 100 + x < kLargestJudged ? 0 : kGap; });
        EXPECT_EQ(maps.unlike(), 0);
        // Where nothing can be compared, nothing is held against a patch.
        maps.compare({2, 100}, [](int x, int) { return x < 4 || (x > 60 && x < 70) ? 0 : kGap; });
        EXPECT_EQ(maps.unlike(), 9 * 70);
    });
}

TEST(StereoSpeckle, StateDoesNotGrowWithTheHeight) {
    Arena arena;
    const SpeckleScratch scratch(640, arena);
    EXPECT_LT(arena.bytes(), std::size_t{80000});
}

}  // namespace
}  // namespace groundline::stereo
