// The robot's own parts in the left picture, as the operator gives them: polygons in a word, or a picture.
#pragma once

#include <cstdint>
#include <string>

#include "core/arena.hpp"
#include "core/image.hpp"

namespace groundline::io {

// `text` is empty (no parts: an empty view), polygons as in rig::parse_polygons, or the path of an 8-bit
// picture of width x height px (the rectified left one's size) that is not 0 where the robot is. Not 0 there
// in the result. Throws Refusal(kConfig): neither polygons nor a picture, a picture of another size, nothing
// marked, or nothing left.
ConstImageView<std::uint8_t> read_body_mask(const std::string& text, int width, int height, Arena& arena);

}  // namespace groundline::io
