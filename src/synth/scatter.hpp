// Things of random size, turn and colour, and their random but reproducible places.
#pragma once

#include <cstdint>
#include <vector>

#include "core/fixed_vector.hpp"
#include "synth/scene.hpp"

namespace groundline::synth {

// Size, yaw and colour from the key alone; not yet placed. Boxes are 0.3 to 0.9 m high, poles 1.1 to 1.8 m,
// rocks 0.08 to 0.4 m.
Thing random_thing(Shape shape, std::uint64_t key);

// Radius of the circle around its foot.
double reach_m(const Thing& thing);

// Places `thing` between the two ranges, within 40 % of the range to either side, where it touches nothing
// that is in `things`, and if possible neither hides nor is hidden; left out when there is no room after 100
// tries. Appends it.
void place_apart(std::vector<Thing>& things, Thing thing, double from_z, double to_z, std::uint64_t key);

// What lies in one cell of kStrewnCell_m of an endless drive. |x| is below 5.5 m; up to path_end_m the strip
// |x| < 0.8 m stays free.
inline constexpr double kStrewnCell_m = 3.0;
inline constexpr int kStrewnPerCell = 6;
FixedVector<Thing, kStrewnPerCell> strewn_in_cell(std::uint32_t seed, std::int64_t cell, double path_end_m);

}  // namespace groundline::synth
