// The little 3x3 algebra that the geometry of the pair needs: row-major, fixed order of operations.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace groundline::rig {

using Vector3 = std::array<double, 3>;
using Matrix3 = std::array<double, 9>;  // row-major

inline constexpr Matrix3 kIdentity3 = {1, 0, 0, 0, 1, 0, 0, 0, 1};

constexpr double dot(const Vector3& a, const Vector3& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
constexpr Vector3 cross(const Vector3& a, const Vector3& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double norm(const Vector3& a) {
    return std::sqrt(dot(a, a));
}
// `a` must not be zero.
inline Vector3 normalised(const Vector3& a) {
    const double length = norm(a);
    return {a[0] / length, a[1] / length, a[2] / length};
}
constexpr Vector3 operator*(const Matrix3& m, const Vector3& a) {
    return {m[0] * a[0] + m[1] * a[1] + m[2] * a[2], m[3] * a[0] + m[4] * a[1] + m[5] * a[2],
            m[6] * a[0] + m[7] * a[1] + m[8] * a[2]};
}
constexpr Matrix3 operator*(const Matrix3& a, const Matrix3& b) {
    Matrix3 product{};
    for (std::size_t row = 0; row < 3; ++row)
        for (std::size_t column = 0; column < 3; ++column)
            product[3 * row + column] =
                a[3 * row] * b[column] + a[3 * row + 1] * b[3 + column] + a[3 * row + 2] * b[6 + column];
    return product;
}
constexpr Matrix3 transposed(const Matrix3& m) {
    return {m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]};
}
constexpr double determinant(const Matrix3& m) {
    return dot({m[0], m[1], m[2]}, cross({m[3], m[4], m[5]}, {m[6], m[7], m[8]}));
}
// Largest difference of an element.
inline double distance(const Matrix3& a, const Matrix3& b) {
    double largest = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i)
        if (const double difference = std::abs(a[i] - b[i]); !(difference <= largest)) largest = difference;
    return largest;
}

}  // namespace groundline::rig
