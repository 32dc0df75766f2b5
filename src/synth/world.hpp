// What one frame sees of a scene, ready for rays: exact intersection with ground, wall and things.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/fixed_vector.hpp"
#include "synth/scene.hpp"
#include "synth/vec3.hpp"

namespace groundline::synth {

// Points are origin + depth * direction. Camera rays have a direction whose part along the optical axis is 1,
// so that `depth` is the depth of stereo geometry.
struct Ray {
    Vec3 origin;
    Vec3 direction;
    Vec3 at(double depth) const { return origin + depth * direction; }
};

enum class Surface : std::uint8_t { kGround, kTrenchSide, kTrenchFloor, kWall, kThing };

struct Hit {
    double depth = 0.0;
    Vec3 normal;  // unit, out of the surface
    Surface surface = Surface::kGround;
    std::uint8_t thing = 0;  // index into World::things()
};

// A thing where it stands, with what the rays need.
struct PlacedThing {
    Thing thing;
    double top_y = 0.0;
    double base_y = 0.0;  // ground where it stands
    double foot_y = 0.0;  // its lower end, under the ground
    double cos_yaw = 1.0;
    double sin_yaw = 0.0;
};

inline constexpr std::size_t kMaxThings = 255;
using ThingIndices = FixedVector<std::uint8_t, kMaxThings>;

class World {
  public:
    // All within sight of a camera at z = forward_m.
    World(const Scene& scene, double forward_m);

    std::span<const PlacedThing> things() const { return {things_.data(), things_.size()}; }
    // The local ground without its trenches; lowest_y() is below all of it, trenches included.
    double ground_y(double x, double z) const;
    double lowest_y() const { return wave_limit_ + deepest_; }

    // First surface in front of the ray's origin, looking only at those things. False: the sky.
    bool trace(const Ray& ray, std::span<const std::uint8_t> candidates, Hit& hit) const;
    // Whether any of those things lies in front of the origin.
    bool blocked(const Ray& ray, std::span<const std::uint8_t> candidates) const;

  private:
    struct WaveTerm {
        double amplitude_m, per_x, per_z, phase;
    };
    struct Slab {
        double from_z;
        double depth_m;
    };
    // The undulation along one ray: sum of amplitude * sin(at + rate * depth).
    struct AlongRay;

    void place(const Thing& thing);
    void strew(const Scene& scene, double forward_m);
    void dig(const Scene& scene, double forward_m);
    bool trace_ground(const Ray& ray, Hit& hit) const;
    bool meet_level(const Ray& ray, double level_y, double from, double to, double& depth) const;
    Vec3 ground_normal(double x, double z) const;

    FixedVector<WaveTerm, 3> waves_;
    double wave_limit_ = 0.0;  // sum of amplitudes
    double deepest_ = 0.0;
    FixedVector<Slab, 24> slabs_;  // first begins at -infinity
    bool has_wall_ = false;
    double wall_z_ = 0.0;
    double wall_top_y_ = 0.0;
    FixedVector<PlacedThing, kMaxThings> things_;
};

// Distance along the ray at which it enters the thing, and the normal there. False: missed, or behind.
bool intersect(const Ray& ray, const PlacedThing& placed, double& depth, Vec3& normal);

}  // namespace groundline::synth
