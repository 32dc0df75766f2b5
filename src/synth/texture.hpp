// Deterministic noise: integer hashes, and a texture that is fixed to the points of the world.
#pragma once

#include <cstdint>

#include "synth/vec3.hpp"

namespace groundline::synth {

// A well mixed 64-bit number of another (the finaliser of splitmix64, public domain formula).
constexpr std::uint64_t mix(std::uint64_t x) {
    x += 0x9E3779B97F4A7C15U;
    x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9U;
    x = (x ^ (x >> 27U)) * 0x94D049BB133111EBU;
    return x ^ (x >> 31U);
}
constexpr std::uint64_t mix(std::uint64_t a, std::uint64_t b) {
    return mix(mix(a) ^ b);
}
// In 0 .. 1, from the upper 32 bits.
constexpr double unit(std::uint64_t hash) {
    return static_cast<double>(hash >> 32U) * (1.0 / 4294967296.0);
}

// Smooth value noise with one random value, within -1 .. 1, on each corner of a grid with the given cell
// size. |coordinates / cell_m| must stay below 2^31.
double value_noise(const Vec3& point, double cell_m, std::uint32_t seed);

// Sum of octaves with cells of 1.2, 3, 8, 25 and 90 cm, within about -1 .. 1 and 0.2 deviation. Cells smaller
// than the footprint of a pixel are left out and those up to twice as large faded in, so that far surfaces
// do not flicker from row to row.
double texture(const Vec3& point, double footprint_m, std::uint32_t seed);

// Approximately normal with deviation 1 (sum of eight uniform numbers, |value| <= 4.9).
double normal_noise(std::uint64_t key);

}  // namespace groundline::synth
