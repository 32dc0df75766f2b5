#include "synth/scatter.hpp"

#include <algorithm>
#include <cmath>

#include "core/deterministic_math.hpp"
#include "synth/texture.hpp"

namespace groundline::synth {
namespace {

// A number between the two, the `nth` of this key.
double between(double low, double high, std::uint64_t key, std::uint64_t nth) {
    return low + (high - low) * unit(mix(key, nth));
}

constexpr Colour kPaints[] = {{40, 105, 205}, {165, 100, 45}, {45, 165, 205}, {55, 60, 185}, {130, 140, 50}};
constexpr Colour kPoleColour = {185, 190, 195};
constexpr Colour kRockColour = {118, 124, 130};

}  // namespace

Thing random_thing(Shape shape, std::uint64_t key) {
    Thing thing;
    thing.shape = shape;
    switch (shape) {
        case Shape::kBox:
            thing.half_x_m = between(0.15, 0.4, key, 1);
            thing.half_z_m = between(0.15, 0.4, key, 2);
            thing.height_m = between(0.3, 0.9, key, 3);
            thing.yaw_rad = det::radians(between(-40.0, 40.0, key, 4));
            thing.colour = kPaints[mix(key, 5) % std::size(kPaints)];
            break;
        case Shape::kPole:
            thing.half_x_m = thing.half_z_m = between(0.035, 0.07, key, 1);
            thing.height_m = between(1.1, 1.8, key, 3);
            thing.colour = kPoleColour;
            break;
        case Shape::kRock:
            thing.half_x_m = between(0.12, 0.45, key, 1);
            thing.half_z_m = thing.half_x_m * between(0.6, 1.1, key, 2);
            thing.height_m = std::min(0.4, thing.half_x_m * between(0.65, 1.0, key, 3));
            thing.yaw_rad = det::radians(between(-90.0, 90.0, key, 4));
            thing.colour = kRockColour;
            break;
    }
    return thing;
}

double reach_m(const Thing& thing) {
    return std::sqrt(thing.half_x_m * thing.half_x_m + thing.half_z_m * thing.half_z_m);
}

void place_apart(std::vector<Thing>& things, Thing thing, double from_z, double to_z, std::uint64_t key) {
    constexpr std::uint64_t kTries = 100;
    constexpr double kGap_m = 0.15;
    for (std::uint64_t attempt = 0; attempt < kTries; ++attempt) {
        thing.z_m = between(from_z, to_z, key, 100 + 2 * attempt);
        thing.x_m = between(-0.4, 0.4, key, 101 + 2 * attempt) * thing.z_m;
        const bool free = std::none_of(things.begin(), things.end(), [&](const Thing& other) {
            const double dx = other.x_m - thing.x_m;
            const double dz = other.z_m - thing.z_m;
            const double apart = reach_m(other) + reach_m(thing) + kGap_m;
            const double beside = std::abs(other.x_m / other.z_m - thing.x_m / thing.z_m);
            const bool hides = beside < reach_m(other) / other.z_m + reach_m(thing) / thing.z_m;
            return dx * dx + dz * dz < apart * apart || (hides && attempt < kTries / 2);
        });
        if (free) {
            things.push_back(thing);
            return;
        }
    }
}

FixedVector<Thing, kStrewnPerCell> strewn_in_cell(std::uint32_t seed, std::int64_t cell, double path_end_m) {
    // How likely each of the places of a cell holds something, and what.
    struct Place {
        Shape shape;
        double chance;
    };
    constexpr Place kPlaces[kStrewnPerCell] = {{Shape::kBox, 0.7},  {Shape::kBox, 0.4},  {Shape::kPole, 0.6},
                                               {Shape::kRock, 0.9}, {Shape::kRock, 0.9}, {Shape::kRock, 0.7}};
    constexpr double kFree_m = 0.8;
    constexpr double kSide_m = 5.5;
    FixedVector<Thing, kStrewnPerCell> found;
    const std::uint64_t cell_key = mix(seed, static_cast<std::uint64_t>(cell));
    for (std::uint64_t i = 0; i < kStrewnPerCell; ++i) {
        const std::uint64_t key = mix(cell_key, i);
        if (unit(mix(key, 50)) >= kPlaces[i].chance) continue;
        Thing thing = random_thing(kPlaces[i].shape, key);
        // Each place has its own strip of the cell, so that neighbours hardly ever meet.
        thing.z_m = kStrewnCell_m * (static_cast<double>(cell) +
                                     (static_cast<double>(i) + unit(mix(key, 51))) / kStrewnPerCell);
        thing.x_m = between(-kSide_m, kSide_m, key, 52);
        const double reach = reach_m(thing);
        const bool in_the_way = thing.z_m - reach < path_end_m && std::abs(thing.x_m) < kFree_m + reach;
        if (in_the_way) thing.x_m += thing.x_m < 0.0 ? -(kFree_m + reach) : kFree_m + reach;
        found.push_back(thing);
    }
    return found;
}

}  // namespace groundline::synth
