// Elementary functions from + - * / and sqrt alone, so that every processor gives the same bits.
// The C library's versions differ in the last place between machines; anything between pixels and mask, the
// rectification maps and the renderer use these instead. Error below 4e-16 relative to the result's range
// unless said otherwise; tests compare with the C library.
#pragma once

namespace groundline::det {

double sin(double radians);
double cos(double radians);
double tan(double radians);
double atan(double x);
double atan2(double y, double x);  // 0 for (0, 0); no distinction of signed zeros
double asin(double x);             // |x| clamped to 1
double exp(double x);

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double degrees(double radians) {
    return radians * (180.0 / kPi);
}
inline constexpr double radians(double degrees) {
    return degrees * (kPi / 180.0);
}

}  // namespace groundline::det
