#include "synth/texture.hpp"

namespace groundline::synth {
namespace {

std::int32_t floor_to_int(double x) {
    const auto truncated = static_cast<std::int32_t>(x);
    return truncated - (static_cast<double>(truncated) > x ? 1 : 0);
}

// Value on the grid corner whose coordinates went into `key`, -1 .. 1.
double corner(std::uint32_t key) {
    key ^= key >> 16U;
    key *= 0x7FEB352DU;
    key ^= key >> 15U;
    key *= 0x846CA68BU;
    key ^= key >> 16U;
    return static_cast<double>(static_cast<std::int32_t>(key)) * (1.0 / 2147483648.0);
}

constexpr double smooth(double t) {
    return t * t * (3.0 - 2.0 * t);
}
constexpr double mixed(double a, double b, double share) {
    return a + (b - a) * share;
}

struct Octave {
    double cell_m;
    double weight;
};
constexpr Octave kOctaves[] = {{0.012, 0.26}, {0.03, 0.28}, {0.08, 0.28}, {0.25, 0.26}, {0.90, 0.22}};

}  // namespace

double value_noise(const Vec3& point, double cell_m, std::uint32_t seed) {
    const double scale = 1.0 / cell_m;
    const double x = point.x * scale;
    const double y = point.y * scale;
    const double z = point.z * scale;
    const std::int32_t cell_x = floor_to_int(x);
    const std::int32_t cell_y = floor_to_int(y);
    const std::int32_t cell_z = floor_to_int(z);
    const double share_x = smooth(x - cell_x);
    const double share_y = smooth(y - cell_y);
    const double share_z = smooth(z - cell_z);

    constexpr std::uint32_t kX = 0x8DA6B343U;
    constexpr std::uint32_t kY = 0xD8163841U;
    constexpr std::uint32_t kZ = 0xCB1AB31FU;
    const std::uint32_t x0 = static_cast<std::uint32_t>(cell_x) * kX;
    const std::uint32_t y0 = static_cast<std::uint32_t>(cell_y) * kY;
    const std::uint32_t z0 = static_cast<std::uint32_t>(cell_z) * kZ + seed * 0x9E3779B9U;
    const std::uint32_t x1 = x0 + kX;
    const std::uint32_t y1 = y0 + kY;
    const std::uint32_t z1 = z0 + kZ;
    const double near = mixed(mixed(corner(x0 ^ y0 ^ z0), corner(x1 ^ y0 ^ z0), share_x),
                              mixed(corner(x0 ^ y1 ^ z0), corner(x1 ^ y1 ^ z0), share_x), share_y);
    const double far = mixed(mixed(corner(x0 ^ y0 ^ z1), corner(x1 ^ y0 ^ z1), share_x),
                             mixed(corner(x0 ^ y1 ^ z1), corner(x1 ^ y1 ^ z1), share_x), share_y);
    return mixed(near, far, share_z);
}

double texture(const Vec3& point, double footprint_m, std::uint32_t seed) {
    double sum = 0.0;
    std::uint32_t octave_seed = seed * 8U;
    for (const Octave& octave : kOctaves) {
        ++octave_seed;
        const double presence = octave.cell_m / footprint_m - 1.0;
        if (presence <= 0.0) continue;
        const double weight = presence < 1.0 ? octave.weight * presence : octave.weight;
        sum += weight * value_noise(point, octave.cell_m, octave_seed);
    }
    return sum;
}

double normal_noise(std::uint64_t key) {
    std::int64_t sum = 0;
    for (std::uint64_t part = 0; part < 2; ++part) {
        const std::uint64_t bits = mix(key + part);
        sum += static_cast<std::int64_t>((bits & 0xFFFFU) + ((bits >> 16U) & 0xFFFFU) +
                                         ((bits >> 32U) & 0xFFFFU) + (bits >> 48U));
    }
    // Eight numbers of 0 .. 65535: mean 4 * 65535, deviation 65536 sqrt(8 / 12) = 53509.6.
    return static_cast<double>(sum - 4 * 65535) * (1.0 / 53509.6);
}

}  // namespace groundline::synth
