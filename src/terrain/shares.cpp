#include "terrain/shares.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>

namespace groundline::terrain {
namespace {

constexpr std::uint64_t kEach = 0x0101010101010101U;  // one in each of eight bytes

// The sum of the eight bytes.
std::int64_t fold(std::uint64_t bytes) {
    constexpr std::uint64_t kEven = 0x00ff00ff00ff00ffU;
    const std::uint64_t pairs = (bytes & kEven) + (bytes >> 8U & kEven);
    return static_cast<std::int64_t>(pairs * 0x0001000100010001U >> 48U);
}

}  // namespace

void shares_of(ConstMask mask, std::array<double, kTerrainClasses>& share) {
    static_assert(kTerrainClasses == 4 && sizeof(TerrainClass) == 1);
    // Of the two bits of a class: set low ones, high ones and both; a byte counts to 255.
    std::int64_t low = 0;
    std::int64_t high = 0;
    std::int64_t both = 0;
    for (int v = 0; v < mask.height; ++v) {
        const TerrainClass* kinds = mask.row(v);
        int u = 0;
        while (u + 8 <= mask.width) {
            const int end = std::min(mask.width - 7, u + 8 * 255);
            std::uint64_t lows = 0;
            std::uint64_t highs = 0;
            std::uint64_t boths = 0;
            for (; u < end; u += 8) {
                std::uint64_t eight;
                std::memcpy(&eight, kinds + u, sizeof eight);
                lows += eight & kEach;
                highs += eight >> 1U & kEach;
                boths += eight & eight >> 1U & kEach;
            }
            low += fold(lows);
            high += fold(highs);
            both += fold(boths);
        }
        for (; u < mask.width; ++u) {
            const auto kind = static_cast<unsigned>(kinds[u]);
            low += kind & 1U;
            high += kind >> 1U & 1U;
            both += kind & kind >> 1U & 1U;
        }
    }
    const std::int64_t pixels = std::int64_t{mask.width} * mask.height;
    const std::array<std::int64_t, kTerrainClasses> counts = {pixels - low - high + both, low - both,
                                                              high - both, both};
    for (std::size_t i = 0; i < counts.size(); ++i)
        share[i] = pixels > 0 ? static_cast<double>(counts[i]) / static_cast<double>(pixels) : 0.0;
}

}  // namespace groundline::terrain
