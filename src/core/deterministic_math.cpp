#include "core/deterministic_math.hpp"

#include <bit>
#include <cmath>
#include <cstdint>

namespace groundline::det {
namespace {

constexpr double kHalfPi = kPi / 2;
// pi/2 in two parts: the first has 33 bits, so that k times it is exact for |k| < 2^20.
constexpr double kHalfPiHigh = 1.57079632673412561417e+00;
constexpr double kHalfPiLow = 6.07710050650619224932e-11;

// Nearest integer, by the rounding of the addition itself (default rounding mode, |x| < 2^51).
double nearest(double x) {
    constexpr double kShift = 6755399441055744.0;  // 1.5 * 2^52
    const volatile double shifted = x + kShift;
    return shifted - kShift;
}

// Taylor series on |x| <= pi/4: the first term left out is below 2^-54.
double sin_small(double x) {
    const double z = x * x;
    double sum = 1.0 / 355687428096000.0;  // 1/17!
    sum = -1.0 / 1307674368000.0 + z * sum;
    sum = 1.0 / 6227020800.0 + z * sum;
    sum = -1.0 / 39916800.0 + z * sum;
    sum = 1.0 / 362880.0 + z * sum;
    sum = -1.0 / 5040.0 + z * sum;
    sum = 1.0 / 120.0 + z * sum;
    sum = -1.0 / 6.0 + z * sum;
    return x + x * z * sum;
}

double cos_small(double x) {
    const double z = x * x;
    double sum = 1.0 / 20922789888000.0;  // 1/16!
    sum = -1.0 / 87178291200.0 + z * sum;
    sum = 1.0 / 479001600.0 + z * sum;
    sum = -1.0 / 3628800.0 + z * sum;
    sum = 1.0 / 40320.0 + z * sum;
    sum = -1.0 / 720.0 + z * sum;
    sum = 1.0 / 24.0 + z * sum;
    sum = -1.0 / 2.0 + z * sum;
    return 1.0 + z * sum;
}

struct Reduced {
    double rest;   // in -pi/4 .. pi/4
    int quadrant;  // 0 .. 3
};

Reduced reduce(double radians) {
    const double quarters = nearest(radians / kHalfPi);
    const double rest = (radians - quarters * kHalfPiHigh) - quarters * kHalfPiLow;
    return {rest, static_cast<int>(static_cast<std::int64_t>(quarters) & 3)};
}

// |x| <= tan(pi/16): arctangent series, the first term left out is below 2^-54.
double atan_small(double x) {
    const double z = x * x;
    double sum = 0.0;
    for (int n = 23; n >= 3; n -= 2)
        sum = z * (((n / 2) % 2 == 0 ? 1.0 : -1.0) / n + sum);
    return x + x * sum;
}

}  // namespace

double sin(double radians) {
    const Reduced reduced = reduce(radians);
    switch (reduced.quadrant) {
        case 0:
            return sin_small(reduced.rest);
        case 1:
            return cos_small(reduced.rest);
        case 2:
            return -sin_small(reduced.rest);
        default:
            return -cos_small(reduced.rest);
    }
}

double cos(double radians) {
    const Reduced reduced = reduce(radians);
    switch (reduced.quadrant) {
        case 0:
            return cos_small(reduced.rest);
        case 1:
            return -sin_small(reduced.rest);
        case 2:
            return -cos_small(reduced.rest);
        default:
            return sin_small(reduced.rest);
    }
}

double tan(double radians) {
    return sin(radians) / cos(radians);
}

double atan(double x) {
    if (x < 0.0) return -atan(-x);
    if (x > 1.0) return kHalfPi - atan(1.0 / x);
    // atan x = atan c + atan((x - c) / (1 + c x)), c = tan(pi/8), leaves |argument| <= tan(pi/8);
    // halving once more, atan y = 2 atan(y / (1 + sqrt(1 + y^2))), leaves |argument| <= tan(pi/16).
    constexpr double kTanPi8 = 0.41421356237309504880;
    const bool upper = x > 0.19891236737965800691;  // tan(pi/16)
    const double y = upper ? (x - kTanPi8) / (1.0 + kTanPi8 * x) : x;
    const double half = y / (1.0 + std::sqrt(1.0 + y * y));
    return (upper ? kPi / 8 : 0.0) + 2.0 * atan_small(half);
}

double atan2(double y, double x) {
    if (x == 0.0 && y == 0.0) return 0.0;
    if (x == 0.0) return y > 0.0 ? kHalfPi : -kHalfPi;
    const double angle = atan(y / x);
    if (x > 0.0) return angle;
    return y >= 0.0 ? angle + kPi : angle - kPi;
}

double asin(double x) {
    if (x >= 1.0) return kHalfPi;
    if (x <= -1.0) return -kHalfPi;
    return atan(x / std::sqrt((1.0 - x) * (1.0 + x)));
}

double exp(double x) {
    if (x < -700.0) return 0.0;
    if (x > 700.0) return std::bit_cast<double>(std::uint64_t{0x7FF0000000000000});
    constexpr double kLn2High = 6.93147180369123816490e-01;
    constexpr double kLn2Low = 1.90821492927058770002e-10;
    const double power = nearest(x / (kLn2High + kLn2Low));
    const double rest = (x - power * kLn2High) - power * kLn2Low;  // |rest| <= ln2 / 2
    double sum = 1.0;
    for (int n = 14; n >= 1; --n)
        sum = 1.0 + rest * sum / n;
    const auto exponent = static_cast<std::uint64_t>(static_cast<std::int64_t>(power) + 1023);
    return sum * std::bit_cast<double>(exponent << 52U);
}

}  // namespace groundline::det
