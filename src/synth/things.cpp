#include "synth/things.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace groundline::synth {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool intersect_box(const Ray& ray, const PlacedThing& placed, double& depth, Vec3& normal) {
    // In the box's own axes the sides are at -half .. half.
    const Thing& thing = placed.thing;
    const double dx = ray.origin.x - thing.x_m;
    const double dz = ray.origin.z - thing.z_m;
    const double c = placed.cos_yaw;
    const double s = placed.sin_yaw;
    const double origin[3] = {c * dx - s * dz, ray.origin.y, s * dx + c * dz};
    const double along[3] = {c * ray.direction.x - s * ray.direction.z, ray.direction.y,
                             s * ray.direction.x + c * ray.direction.z};
    const double low[3] = {-thing.half_x_m, placed.top_y, -thing.half_z_m};
    const double high[3] = {thing.half_x_m, placed.foot_y, thing.half_z_m};
    double enter = -kInfinity;
    double leave = kInfinity;
    int axis = 0;
    for (int i = 0; i < 3; ++i) {
        if (along[i] == 0.0) {
            if (origin[i] < low[i] || origin[i] > high[i]) return false;
            continue;
        }
        const double to_low = (low[i] - origin[i]) / along[i];
        const double to_high = (high[i] - origin[i]) / along[i];
        const double first = std::min(to_low, to_high);
        if (first > enter) {
            enter = first;
            axis = i;
        }
        leave = std::min(leave, std::max(to_low, to_high));
    }
    if (enter <= 0.0 || enter >= leave) return false;
    depth = enter;
    const double side = along[axis] > 0.0 ? -1.0 : 1.0;
    if (axis == 0)
        normal = {side * c, 0.0, -side * s};
    else if (axis == 1)
        normal = {0.0, side, 0.0};
    else
        normal = {side * s, 0.0, side * c};
    return true;
}

bool intersect_pole(const Ray& ray, const PlacedThing& placed, double& depth, Vec3& normal) {
    const double radius = placed.thing.half_x_m;
    const double x = ray.origin.x - placed.thing.x_m;
    const double z = ray.origin.z - placed.thing.z_m;
    const double a = ray.direction.x * ray.direction.x + ray.direction.z * ray.direction.z;
    const double half_b = x * ray.direction.x + z * ray.direction.z;
    const double c = x * x + z * z - radius * radius;
    const double discriminant = half_b * half_b - a * c;
    if (discriminant <= 0.0 || a == 0.0) return false;
    const double root = std::sqrt(discriminant);
    const double side = (-half_b - root) / a;
    if (side > 0.0) {
        const double y = ray.origin.y + side * ray.direction.y;
        if (y >= placed.top_y && y <= placed.foot_y) {
            depth = side;
            normal = {(x + side * ray.direction.x) / radius, 0.0, (z + side * ray.direction.z) / radius};
            return true;
        }
    }
    if (ray.direction.y <= 0.0) return false;
    const double top = (placed.top_y - ray.origin.y) / ray.direction.y;
    if (top <= 0.0 || top < side || top > (-half_b + root) / a) return false;
    depth = top;
    normal = {0.0, -1.0, 0.0};
    return true;
}

bool intersect_rock(const Ray& ray, const PlacedThing& placed, double& depth, Vec3& normal) {
    // Scaled by its half axes the rock is a unit sphere about its foot.
    const Thing& thing = placed.thing;
    const double dx = ray.origin.x - thing.x_m;
    const double dz = ray.origin.z - thing.z_m;
    const double c = placed.cos_yaw;
    const double s = placed.sin_yaw;
    const Vec3 origin{(c * dx - s * dz) / thing.half_x_m, (ray.origin.y - placed.base_y) / thing.height_m,
                      (s * dx + c * dz) / thing.half_z_m};
    const Vec3 along{(c * ray.direction.x - s * ray.direction.z) / thing.half_x_m,
                     ray.direction.y / thing.height_m,
                     (s * ray.direction.x + c * ray.direction.z) / thing.half_z_m};
    const double a = dot(along, along);
    const double half_b = dot(origin, along);
    const double discriminant = half_b * half_b - a * (dot(origin, origin) - 1.0);
    if (discriminant <= 0.0) return false;
    const double enter = (-half_b - std::sqrt(discriminant)) / a;
    if (enter <= 0.0) return false;
    depth = enter;
    const Vec3 on = origin + enter * along;
    const double nx = on.x / thing.half_x_m;
    const double ny = on.y / thing.height_m;
    const double nz = on.z / thing.half_z_m;
    const double length = std::sqrt(nx * nx + ny * ny + nz * nz);
    normal = {(c * nx + s * nz) / length, ny / length, (c * nz - s * nx) / length};
    return true;
}

}  // namespace

bool intersect(const Ray& ray, const PlacedThing& placed, double& depth, Vec3& normal) {
    switch (placed.thing.shape) {
        case Shape::kBox:
            return intersect_box(ray, placed, depth, normal);
        case Shape::kPole:
            return intersect_pole(ray, placed, depth, normal);
        case Shape::kRock:
            return intersect_rock(ray, placed, depth, normal);
    }
    return false;
}

}  // namespace groundline::synth
