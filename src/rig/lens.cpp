#include "rig/lens.hpp"

#include <cmath>

#include "core/deterministic_math.hpp"

namespace groundline::rig {
namespace {

constexpr double kWidestTangent = 12.0;  // 85 degrees off the axis: no plane picture reaches farther

// Factor on the normalised coordinates at squared radius r2.
double pinhole_scale(const std::array<double, 8>& k, double r2) {
    const double above = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    const double below = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    return above / below;
}

// Distorted radius of tangent r for the equidistant lens.
double equidistant_radius(const std::array<double, 8>& k, double radius) {
    const double theta = det::atan(radius);
    const double t2 = theta * theta;
    return theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
}

}  // namespace

LensProjection::LensProjection(const CameraModel& camera) : camera_(camera), radius_limit_(0.0) {
    // 1/256 of a radius is below 0.3 degrees everywhere, far finer than a polynomial of degree 9 can bend.
    constexpr double kStep = 1.0 / 256;
    double before = 0.0;
    for (double radius = kStep; radius <= kWidestTangent; radius += kStep) {
        const double now = distorted(radius);
        if (!(now > before)) break;
        before = now;
        radius_limit_ = radius;
    }
}

double LensProjection::distorted(double radius) const {
    return camera_.lens == Lens::kEquidistant ? equidistant_radius(camera_.distortion, radius)
                                              : radius * pinhole_scale(camera_.distortion, radius * radius);
}

std::optional<Pixel> LensProjection::project(const Vector3& ray) const {
    if (!(ray[2] > 0.0)) return std::nullopt;
    const double x = ray[0] / ray[2];
    const double y = ray[1] / ray[2];
    const double r2 = x * x + y * y;
    if (r2 > radius_limit_ * radius_limit_) return std::nullopt;
    const auto& k = camera_.distortion;
    double xd = 0.0;
    double yd = 0.0;
    if (camera_.lens == Lens::kEquidistant) {
        const double radius = std::sqrt(r2);
        const double scale = radius > 1e-9 ? equidistant_radius(k, radius) / radius : 1.0;
        xd = x * scale;
        yd = y * scale;
    } else {
        const double scale = pinhole_scale(k, r2);
        xd = x * scale + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x);
        yd = y * scale + k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y;
    }
    return Pixel{camera_.fx * xd + camera_.cx, camera_.fy * yd + camera_.cy};
}

}  // namespace groundline::rig
