#include "synth/world.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/deterministic_math.hpp"
#include "synth/scatter.hpp"

namespace groundline::synth {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kSight_m = 60.0;  // things farther away are left out of a drive
constexpr double kBehind_m = 3.0;  // and those this far behind the camera
constexpr double kFoot_m = 0.3;    // how far things go on under the ground

std::int64_t floor_div(double a, double b) {
    return static_cast<std::int64_t>(std::floor(a / b));
}

}  // namespace

World::World(const Scene& scene, double forward_m) : waves_({scene.waves.data(), scene.waves.size()}) {
    has_wall_ = scene.wall_z_m > 0.0;
    wall_z_ = scene.wall_z_m;
    wall_top_y_ = -scene.wall_height_m;
    dig(scene, forward_m);
    for (const Thing& thing : scene.things)
        if (thing.z_m > forward_m - kBehind_m) place(thing);
    if (scene.strewn) strew(scene, forward_m);
}

void World::place(const Thing& thing) {
    if (things_.size() == things_.capacity()) return;
    PlacedThing placed;
    placed.thing = thing;
    placed.base_y = ground_y(thing.x_m, thing.z_m);
    placed.top_y = placed.base_y - thing.height_m;
    placed.foot_y = placed.base_y + deepest_ + kFoot_m;
    placed.cos_yaw = det::cos(thing.yaw_rad);
    placed.sin_yaw = det::sin(thing.yaw_rad);
    things_.push_back(placed);
}

void World::strew(const Scene& scene, double forward_m) {
    const double path_end = scene.speed_mps * static_cast<double>(scene.frames) / scene.rate_hz + 1.5;
    const std::int64_t first = floor_div(forward_m - kBehind_m, kStrewnCell_m);
    const std::int64_t last = floor_div(forward_m + kSight_m, kStrewnCell_m);
    for (std::int64_t cell = first; cell <= last; ++cell)
        for (const Thing& thing : strewn_in_cell(scene.seed, cell, path_end))
            if (on_one_level(thing.z_m - reach_m(thing), thing.z_m + reach_m(thing))) place(thing);
}

// Whether the ground between the two is not cut by a trench, nor inside one.
bool World::on_one_level(double from_z, double to_z) const {
    for (std::size_t i = 0; i < slabs_.size(); ++i) {
        const double end = i + 1 < slabs_.size() ? slabs_[i + 1].from_z : kInfinity;
        if (slabs_[i].depth_m > 0.0 && slabs_[i].from_z < to_z && end > from_z) return false;
    }
    return true;
}

void World::dig(const Scene& scene, double forward_m) {
    slabs_.push_back({-kInfinity, 0.0, Surface::kGround});
    const auto add = [&](const Trench& trench, double shift) {
        if (slabs_.size() + 2 > slabs_.capacity()) return;
        const bool ends = trench.far_m < kInfinity;
        slabs_.push_back(
            {trench.near_m + shift, trench.depth_m, ends ? Surface::kTrenchFloor : Surface::kGround});
        if (ends) slabs_.push_back({trench.far_m + shift, 0.0, Surface::kGround});
        deepest_ = std::max(deepest_, trench.depth_m);
    };
    if (scene.trench_period_m <= 0.0) {
        for (const Trench& trench : scene.trenches)
            add(trench, 0.0);
        return;
    }
    const double period = scene.trench_period_m;
    for (std::int64_t turn = std::max<std::int64_t>(0, floor_div(forward_m - kSight_m, period));
         turn <= floor_div(forward_m + kSight_m, period); ++turn)
        for (const Trench& trench : scene.trenches)
            add(trench, static_cast<double>(turn) * period);
}

// Slab by slab along the ray: the ground of the slab first, then the upright side at its end.
bool World::trace_ground(const Ray& ray, Hit& hit) const {
    if (ray.direction.y <= 0.0) return false;
    std::size_t slab = slabs_.size() - 1;
    while (slab > 0 && slabs_[slab].from_z > ray.origin.z)
        --slab;
    const double speed = ray.direction.z;
    double from = 0.0;
    while (true) {
        const bool is_last = speed > 0.0 ? slab + 1 == slabs_.size() : slab == 0;
        double to = kInfinity;
        if (speed > 0.0 && !is_last) to = (slabs_[slab + 1].from_z - ray.origin.z) / speed;
        if (speed < 0.0 && !is_last) to = (slabs_[slab].from_z - ray.origin.z) / speed;
        const double level = slabs_[slab].depth_m;
        if (waves_.meet(ray, level, from, to, hit.depth)) {
            const Vec3 point = ray.at(hit.depth);
            hit.normal = waves_.normal(point.x, point.z);
            hit.surface = slabs_[slab].floor;
            return true;
        }
        if (is_last || speed == 0.0) return false;
        slab = speed > 0.0 ? slab + 1 : slab - 1;
        const Vec3 point = ray.at(to);
        if (point.y > slabs_[slab].depth_m + ground_y(point.x, point.z)) {
            hit.depth = to;
            hit.normal = {0.0, 0.0, speed > 0.0 ? -1.0 : 1.0};
            hit.surface = Surface::kTrenchSide;
            return true;
        }
        from = to;
    }
}

bool World::trace(const Ray& ray, std::span<const std::uint8_t> candidates, Hit& hit) const {
    bool found = trace_ground(ray, hit);
    if (!found) hit.depth = kInfinity;
    if (has_wall_ && ray.direction.z > 0.0) {
        const double depth = (wall_z_ - ray.origin.z) / ray.direction.z;
        if (depth > 0.0 && depth < hit.depth && ray.origin.y + depth * ray.direction.y >= wall_top_y_) {
            hit = {depth, {0.0, 0.0, -1.0}, Surface::kWall, 0};
            found = true;
        }
    }
    for (const std::uint8_t index : candidates) {
        double depth = 0.0;
        Vec3 normal;
        if (intersect(ray, things_[index], depth, normal) && depth < hit.depth) {
            hit = {depth, normal, Surface::kThing, index};
            found = true;
        }
    }
    return found;
}

bool World::blocked(const Ray& ray, std::span<const std::uint8_t> candidates) const {
    double depth = 0.0;
    Vec3 normal;
    return std::any_of(candidates.begin(), candidates.end(),
                       [&](std::uint8_t index) { return intersect(ray, things_[index], depth, normal); });
}

}  // namespace groundline::synth
