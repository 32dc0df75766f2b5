#include "terrain/outline.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstddef>
#include <cstring>
#include <utility>

namespace groundline::terrain {
namespace {

constexpr int kBits = 64;
constexpr std::uint64_t kEach = 0x0101010101010101U;  // one in each of eight bytes

static_assert(std::endian::native == std::endian::little);
static_assert(static_cast<int>(TerrainClass::kUnknown) == 0 &&
              static_cast<int>(TerrainClass::kTraversable) == 1 &&
              static_cast<int>(TerrainClass::kObstacle) == 2 && static_cast<int>(TerrainClass::kDrop) == 3);

template <typename T>
std::uint64_t load_eight(const T* bytes) {
    static_assert(sizeof(T) == 1);
    std::uint64_t word;
    std::memcpy(&word, bytes, sizeof word);
    return word;
}

// Eight bytes of 0 or 1 to eight bits, the first the lowest, and back. Byte k is moved to bit 56 + k; no two
// partial products meet.
std::uint64_t bits_of(std::uint64_t bytes) {
    return bytes * 0x0102040810204080U >> 56U;
}
std::uint64_t bytes_of(std::uint64_t bits) {
    return ((bits * kEach & 0x8040201008040201U) + 0x7f * kEach) >> 7U & kEach;
}

// 1 in each byte that is not 0; bytes are below 128.
std::uint64_t not_zero(std::uint64_t bytes) {
    return (bytes + 0x7f * kEach) >> 7U & kEach;
}

// Calls step(reached, by) with steps that together reach `reach_px`, each at most one more than all before
// it: then a step needs nothing of what lies outside the picture.
template <typename Step>
void in_steps(int reach_px, Step step) {
    for (int reached = 0; reached < reach_px;) {
        const int by = std::min({reached + 1, reach_px - reached, kBits / 2});
        step(reached, by);
        reached += by;
    }
}

}  // namespace

void Outline::take(Arena& arena, int width, int height) {
    width_ = width;
    height_ = height;
    words_ = (width + kBits - 1) / kBits;
    last_word_ = ~Word{0} >> static_cast<unsigned>(words_ * kBits - width);
    for (Plane* plane : {&obstacles_, &drops_, &along_, &across_, &spare_})
        *plane = arena.take<Word>(static_cast<std::size_t>(words_ + 2) * static_cast<std::size_t>(height));
}

// Fills obstacles_ and drops_; returns whether there are any.
bool Outline::collect(ConstMask mask) {
    Word any = 0;
    for (int v = 0; v < height_; ++v) {
        const TerrainClass* kinds = mask.row(v);
        Word* obstacles = row(obstacles_, v);
        Word* drops = row(drops_, v);
        for (int i = 0; i < words_; ++i) {
            Word low = 0;
            Word high = 0;
            const int first = i * kBits;
            for (int k = 0; k < kBits && first + k < width_; k += 8) {
                const std::uint64_t eight = load_eight(kinds + first + k);
                if ((eight & 2 * kEach) == 0) continue;
                high |= bits_of(eight >> 1U & kEach) << k;
                low |= bits_of(eight & kEach) << k;
            }
            if (i == words_ - 1) high &= last_word_;
            obstacles[i] = high & ~low;
            drops[i] = high & low;
            any |= high;
        }
    }
    return any != 0;
}

// Sets what lies within reach_px of a set bit of its row.
void Outline::widen_along(Plane plane, int reach_px) {
    for (int v = 0; v < height_; ++v) {
        Word* here = row(plane, v);
        if (std::all_of(here, here + words_, [](Word word) { return word == 0; })) continue;
        Word* before = row(spare_, 0);
        in_steps(reach_px, [&](int /*reached*/, int by) {
            std::copy_n(here, words_, before);
            for (int i = 0; i < words_; ++i)
                here[i] = before[i] | before[i] << by | before[i - 1] >> (kBits - by) | before[i] >> by |
                          before[i + 1] << (kBits - by);
        });
        here[words_ - 1] &= last_word_;
    }
}

// Sets what lies in a column at most up_px above a set bit or down_px below one.
void Outline::widen_across(Plane& plane, int up_px, int down_px) {
    in_steps(std::max(up_px, down_px), [&](int reached, int by) {
        const int up = std::clamp(up_px - reached, 0, by);
        const int down = std::clamp(down_px - reached, 0, by);
        for (int v = 0; v < height_; ++v) {
            const Word* here = row(plane, v);
            const Word* above = row(plane, std::max(v - down, 0));
            const Word* below = row(plane, std::min(v + up, height_ - 1));
            Word* out = row(spare_, v);
            for (int i = 0; i < words_; ++i)
                out[i] = here[i] | above[i] | below[i];
        }
        std::swap(plane, spare_);
    });
}

void Outline::invert(Plane plane) const {
    for (int v = 0; v < height_; ++v) {
        Word* here = row(plane, v);
        for (int i = 0; i < words_; ++i)
            here[i] = ~here[i];
        here[words_ - 1] &= last_word_;
    }
}

// Widening, then widening what is left out: gaps up to twice the reach are closed.
void Outline::fill_gaps(int gap_px, ConstImageView<Invalid> invalid, Mask mask) {
    std::copy(obstacles_.begin(), obstacles_.end(), along_.begin());
    widen_along(along_, gap_px);
    invert(along_);
    widen_along(along_, gap_px);
    std::copy(obstacles_.begin(), obstacles_.end(), across_.begin());
    widen_across(across_, gap_px, gap_px);
    invert(across_);
    widen_across(across_, gap_px, gap_px);
    for (int v = 0; v < height_; ++v) {
        Word* obstacles = row(obstacles_, v);
        const Word* open_along = row(along_, v);
        const Word* open_across = row(across_, v);
        for (int i = 0; i < words_; ++i) {
            Word gaps = ~(open_along[i] & open_across[i]) & ~obstacles[i];
            if (i == words_ - 1) gaps &= last_word_;
            for (; gaps != 0;) {
                const int first = std::countr_zero(gaps) & ~7;
                TerrainClass* kinds = mask.row(v) + i * kBits + first;
                const std::uint64_t eight = load_eight(kinds);
                const std::uint64_t unmatched = not_zero(load_eight(invalid.row(v) + i * kBits + first));
                const std::uint64_t filled = bytes_of(gaps >> first & 0xffU) & unmatched & ~not_zero(eight);
                const std::uint64_t result = eight | filled << 1U;
                std::memcpy(kinds, &result, sizeof result);
                obstacles[i] |= bits_of(filled) << first;
                gaps &= ~(Word{0xff} << first);
            }
        }
    }
}

void Outline::blur(const OutlineReach& reach, Mask mask) {
    std::copy(obstacles_.begin(), obstacles_.end(), along_.begin());
    widen_along(along_, reach.beside);
    widen_across(along_, reach.beyond, reach.before);
    std::copy(drops_.begin(), drops_.end(), across_.begin());
    widen_along(across_, reach.lip);
    widen_across(across_, reach.lip, reach.lip);
    for (int v = 0; v < height_; ++v) {
        const Word* near_obstacles = row(along_, v);
        const Word* near_drops = row(across_, v);
        const Word* obstacles = row(obstacles_, v);
        const Word* drops = row(drops_, v);
        for (int i = 0; i < words_; ++i) {
            const Word things = obstacles[i] | drops[i];
            for (Word beside = (near_obstacles[i] | near_drops[i]) & ~things; beside != 0;) {
                const int first = std::countr_zero(beside) & ~7;
                TerrainClass* kinds = mask.row(v) + i * kBits + first;
                const std::uint64_t eight = load_eight(kinds);
                // None of these is of class 2 or 3.
                const std::uint64_t result = eight & ~bytes_of(beside >> first & 0xffU);
                std::memcpy(kinds, &result, sizeof result);
                beside &= ~(Word{0xff} << first);
            }
        }
    }
}

void Outline::apply(const OutlineReach& reach, ConstImageView<Invalid> invalid, Mask mask) {
    assert(mask.same_size(width_, height_) && invalid.same_size(width_, height_));
    if (!collect(mask)) return;
    if (reach.gap > 0) fill_gaps(reach.gap, invalid, mask);
    blur(reach, mask);
}

}  // namespace groundline::terrain
