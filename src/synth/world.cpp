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

World::World(const Scene& scene, double forward_m) {
    for (const Wave& wave : scene.waves) {
        const double per_m = 2.0 * det::kPi / wave.length_m;
        waves_.push_back({wave.amplitude_m, per_m * det::sin(wave.heading_rad),
                          per_m * det::cos(wave.heading_rad), wave.phase_rad});
        wave_limit_ += wave.amplitude_m;
    }
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
            place(thing);
}

void World::dig(const Scene& scene, double forward_m) {
    slabs_.push_back({-kInfinity, 0.0});
    const auto add = [&](const Trench& trench, double shift) {
        if (slabs_.size() + 2 > slabs_.capacity()) return;
        slabs_.push_back({trench.near_m + shift, trench.depth_m});
        if (trench.far_m < kInfinity) slabs_.push_back({trench.far_m + shift, 0.0});
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

double World::ground_y(double x, double z) const {
    double y = 0.0;
    for (const WaveTerm& wave : waves_)
        y -= wave.amplitude_m * det::sin(wave.per_x * x + wave.per_z * z + wave.phase);
    return y;
}

Vec3 World::ground_normal(double x, double z) const {
    // Of y = g(x, z), y down: (dg/dx, -1, dg/dz) up to its length.
    double slope_x = 0.0;
    double slope_z = 0.0;
    for (const WaveTerm& wave : waves_) {
        const double rise = -wave.amplitude_m * det::cos(wave.per_x * x + wave.per_z * z + wave.phase);
        slope_x += rise * wave.per_x;
        slope_z += rise * wave.per_z;
    }
    const double scale = 1.0 / std::sqrt(1.0 + slope_x * slope_x + slope_z * slope_z);
    return {slope_x * scale, -scale, slope_z * scale};
}

struct World::AlongRay {
    struct Term {
        double amplitude_m, at, rate;
    };
    FixedVector<Term, 3> terms;
    double gap0 = 0.0;  // how far the origin is below the mean level, negative above
    double descent = 0.0;
    double steepest = 0.0;  // most that the undulation can rise or fall per depth
    double fastest = 0.0;   // radians per depth

    AlongRay(const World& world, const Ray& ray, double level_y)
        : gap0(ray.origin.y - level_y), descent(ray.direction.y) {
        for (const WaveTerm& wave : world.waves_) {
            const double at = wave.per_x * ray.origin.x + wave.per_z * ray.origin.z + wave.phase;
            const double rate = wave.per_x * ray.direction.x + wave.per_z * ray.direction.z;
            terms.push_back({wave.amplitude_m, at, rate});
            steepest += wave.amplitude_m * std::abs(rate);
            fastest = std::max(fastest, std::abs(rate));
        }
    }
    // Metres below the ground at this depth, negative above it.
    double gap(double depth) const {
        double sum = gap0 + depth * descent;
        for (const Term& term : terms)
            sum += term.amplitude_m * det::sin(term.at + term.rate * depth);
        return sum;
    }
    // The root between `above` (gap <= 0) and `below` (gap >= 0): regula falsi with the Illinois rule, which
    // keeps the bracket; below 1e-13 m after about six steps.
    double root(double above, double gap_above, double below, double gap_below) const {
        double depth = below;
        for (int step = 0; step < 60 && gap_below > gap_above; ++step) {
            depth = (above * gap_below - below * gap_above) / (gap_below - gap_above);
            const double value = gap(depth);
            if (std::abs(value) < 1e-13) break;
            if (value > 0.0) {
                below = depth;
                gap_below = value;
                gap_above *= 0.5;
            } else {
                above = depth;
                gap_above = value;
                gap_below *= 0.5;
            }
        }
        return depth;
    }
};

// First depth in from .. to at which the ray reaches the ground around level_y, coming from above.
bool World::meet_level(const Ray& ray, double level_y, double from, double to, double& depth) const {
    const double descent = ray.direction.y;
    if (descent <= 0.0) return false;
    const double mean = (level_y - ray.origin.y) / descent;
    if (waves_.empty()) {
        depth = mean;
        return mean >= from && mean <= to;
    }
    const double band = wave_limit_ / descent;
    const double first = std::max(from, mean - band);
    const double last = std::min(to, mean + band);
    if (first > last) return false;

    const AlongRay along(*this, ray, level_y);
    double above = first;
    double gap_above = along.gap(above);
    if (gap_above >= 0.0) {
        depth = above;
        return true;
    }
    if (descent > along.steepest) {  // falls everywhere: one root at most
        const double gap_last = along.gap(last);
        if (gap_last < 0.0) return false;
        depth = along.root(above, gap_above, last, gap_last);
        return true;
    }
    // No root within gap / (descent + steepest). The least step, 1/48 of a wave or 0.05 % of the depth, can
    // only miss crests thinner than that.
    while (above < last) {
        const double safe = -gap_above / (descent + along.steepest);
        const double least = std::max(2.0 * det::kPi / (48.0 * along.fastest), 5e-4 * above);
        const double next = std::min(last, above + std::max(safe, least));
        const double gap_next = along.gap(next);
        if (gap_next >= 0.0) {
            depth = along.root(above, gap_above, next, gap_next);
            return true;
        }
        above = next;
        gap_above = gap_next;
    }
    return false;
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
        if (meet_level(ray, level, from, to, hit.depth)) {
            const Vec3 point = ray.at(hit.depth);
            hit.normal = waves_.empty() ? Vec3{0.0, -1.0, 0.0} : ground_normal(point.x, point.z);
            hit.surface = level > 0.0 ? Surface::kTrenchFloor : Surface::kGround;
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
