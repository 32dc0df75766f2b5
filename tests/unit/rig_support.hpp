// Sample rigs, and camera models written a second time with the C library and iterative inversion.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "core/parallel.hpp"
#include "rig/calibration.hpp"

namespace groundline::rig::test {

class Random {
  public:
    explicit Random(std::uint32_t seed) : engine_(seed) {}
    double between(double low, double high) {
        return low + (high - low) * (static_cast<double>(engine_()) / 4294967296.0);
    }

  private:
    std::mt19937 engine_;
};

// Rotation about x, then y, then z, angles in radians.
inline Matrix3 turned(double x, double y, double z) {
    const Matrix3 about_x = {1, 0, 0, 0, std::cos(x), -std::sin(x), 0, std::sin(x), std::cos(x)};
    const Matrix3 about_y = {std::cos(y), 0, std::sin(y), 0, 1, 0, -std::sin(y), 0, std::cos(y)};
    const Matrix3 about_z = {std::cos(z), -std::sin(z), 0, std::sin(z), std::cos(z), 0, 0, 0, 1};
    return about_z * (about_y * about_x);
}

inline CameraModel sample_camera(Random& random, Lens lens, int width, int height) {
    CameraModel camera;
    camera.width = width;
    camera.height = height;
    camera.fx = width * random.between(0.7, 1.1);
    camera.fy = camera.fx * random.between(0.99, 1.01);
    camera.cx = 0.5 * width + random.between(-0.03, 0.03) * width;
    camera.cy = 0.5 * height + random.between(-0.03, 0.03) * height;
    camera.lens = lens;
    auto& k = camera.distortion;
    if (lens == Lens::kEquidistant) {
        k[0] = random.between(-0.05, 0.05);
        k[1] = random.between(-0.02, 0.02);
        k[2] = random.between(-0.01, 0.01);
        k[3] = random.between(-0.005, 0.005);
    } else {
        k[0] = random.between(-0.35, 0.1);
        k[1] = random.between(0.0, 0.15);
        k[2] = random.between(-0.002, 0.002);
        k[3] = random.between(-0.002, 0.002);
        k[4] = random.between(-0.02, 0.02);
        k[5] = random.between(-0.03, 0.03);
        k[6] = random.between(-0.01, 0.01);
        k[7] = random.between(-0.005, 0.005);
    }
    return camera;
}

// A pair as a careful amateur builds it: a few degrees and millimetres off.
inline StereoCalibration sample_rig(Random& random, Lens lens, int width, int height) {
    StereoCalibration rig;
    rig.left = sample_camera(random, lens, width, height);
    rig.right = sample_camera(random, lens, width, height);
    rig.rotation =
        turned(random.between(-0.04, 0.04), random.between(-0.06, 0.06), random.between(-0.03, 0.03));
    const double baseline_m = random.between(0.05, 0.4);
    rig.translation_m = {-baseline_m, baseline_m * random.between(-0.08, 0.08),
                         baseline_m * random.between(-0.08, 0.08)};
    rig.source = "sample";
    return rig;
}

struct Point2 {
    double x = 0.0;
    double y = 0.0;
};

// Distorted from ideal normalised coordinates.
inline Point2 distorted(const CameraModel& camera, Point2 p) {
    const auto& k = camera.distortion;
    const double r = std::hypot(p.x, p.y);
    if (camera.lens == Lens::kEquidistant) {
        const double t = std::atan(r);
        const double td =
            t + k[0] * std::pow(t, 3) + k[1] * std::pow(t, 5) + k[2] * std::pow(t, 7) + k[3] * std::pow(t, 9);
        return r == 0.0 ? p : Point2{p.x * td / r, p.y * td / r};
    }
    const double radial = (1 + k[0] * std::pow(r, 2) + k[1] * std::pow(r, 4) + k[4] * std::pow(r, 6)) /
                          (1 + k[5] * std::pow(r, 2) + k[6] * std::pow(r, 4) + k[7] * std::pow(r, 6));
    return {p.x * radial + 2 * k[2] * p.x * p.y + k[3] * (r * r + 2 * p.x * p.x),
            p.y * radial + k[2] * (r * r + 2 * p.y * p.y) + 2 * k[3] * p.x * p.y};
}

// Pixel of a point in the camera frame, z > 0.
inline Point2 pixel_of(const CameraModel& camera, const Vector3& point) {
    const Point2 d = distorted(camera, {point[0] / point[2], point[1] / point[2]});
    return {camera.fx * d.x + camera.cx, camera.fy * d.y + camera.cy};
}

// The ray (x, y, 1) of a pixel, by Newton's iteration on the forward model with a numeric derivative.
inline Vector3 ray_of(const CameraModel& camera, Point2 pixel) {
    const Point2 wanted = {(pixel.x - camera.cx) / camera.fx, (pixel.y - camera.cy) / camera.fy};
    Point2 p = wanted;
    for (int i = 0; i < 60; ++i) {
        constexpr double kStep = 1e-6;
        const Point2 at = distorted(camera, p);
        const Point2 dx = distorted(camera, {p.x + kStep, p.y});
        const Point2 dy = distorted(camera, {p.x, p.y + kStep});
        const double a = (dx.x - at.x) / kStep, b = (dy.x - at.x) / kStep;
        const double c = (dx.y - at.y) / kStep, d = (dy.y - at.y) / kStep;
        const double ex = wanted.x - at.x, ey = wanted.y - at.y;
        const double det = a * d - b * c;
        p.x += (d * ex - b * ey) / det;
        p.y += (a * ey - c * ex) / det;
    }
    return {p.x, p.y, 1.0};
}

// Runs tasks last to first on three lanes in turn: what depends on order or lane shows.
class Backwards final : public Parallel {
  public:
    int lanes() const override { return 3; }
    void for_each(int count, FunctionRef<void(int, int)> task) override {
        for (int index = count - 1; index >= 0; --index)
            task(index, index % 3);
    }
};

}  // namespace groundline::rig::test
