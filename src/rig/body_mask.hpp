// The robot's own parts in the picture, drawn as polygons.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "core/image.hpp"

namespace groundline::rig {

// Pixels of the rectified left picture; the middle of the first pixel is (0, 0).
struct Corner {
    double x;
    double y;
};
using Polygon = std::vector<Corner>;

// "x,y x,y x,y; x,y ...": polygons of three corners and more, apart by semicolons; nothing else but blanks.
// None where the text is not that. Numbers may lie outside the picture.
std::optional<std::vector<Polygon>> parse_polygons(std::string_view text);

// Sets the pixels to 1 whose middle lies inside (even-odd rule: what two outlines of one polygon surround is
// outside again); the others stay. A middle on a left or upper edge is inside, on a right or lower one
// outside.
void fill_polygon(const Polygon& polygon, ImageView<std::uint8_t> mask);

}  // namespace groundline::rig
