// What one frame sees of a scene, ready for rays: exact intersection with ground, wall and things.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/fixed_vector.hpp"
#include "synth/scene.hpp"
#include "synth/things.hpp"
#include "synth/undulation.hpp"

namespace groundline::synth {

enum class Surface : std::uint8_t { kGround, kTrenchSide, kTrenchFloor, kWall, kThing };

struct Hit {
    double depth = 0.0;
    Vec3 normal;  // unit, out of the surface
    Surface surface = Surface::kGround;
    std::uint8_t thing = 0;  // index into World::things()
};

inline constexpr std::size_t kMaxThings = 255;
using ThingIndices = FixedVector<std::uint8_t, kMaxThings>;

class World {
  public:
    // All within sight of a camera at z = forward_m.
    World(const Scene& scene, double forward_m);

    std::span<const PlacedThing> things() const { return {things_.data(), things_.size()}; }
    // The local ground without its trenches; lowest_y() is below all of it, trenches included.
    double ground_y(double x, double z) const { return waves_.y(x, z); }
    double lowest_y() const { return waves_.limit_m() + deepest_; }

    // First surface in front of the ray's origin, looking only at those things. False: the sky.
    bool trace(const Ray& ray, std::span<const std::uint8_t> candidates, Hit& hit) const;
    // Whether any of those things lies in front of the origin.
    bool blocked(const Ray& ray, std::span<const std::uint8_t> candidates) const;

  private:
    struct Slab {
        double from_z;
        double depth_m;
        Surface floor;
    };

    void place(const Thing& thing);
    void strew(const Scene& scene, double forward_m);
    void dig(const Scene& scene, double forward_m);
    bool on_one_level(double from_z, double to_z) const;
    bool trace_ground(const Ray& ray, Hit& hit) const;

    Undulation waves_;
    double deepest_ = 0.0;
    FixedVector<Slab, 24> slabs_;  // first begins at -infinity
    bool has_wall_ = false;
    double wall_z_ = 0.0;
    double wall_top_y_ = 0.0;
    FixedVector<PlacedThing, kMaxThings> things_;
};

}  // namespace groundline::synth
