// The disparity image: sixteenths of a pixel, with an explicit reason wherever there is no answer.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/arena.hpp"
#include "core/image.hpp"

namespace groundline {

inline constexpr int kDisparityOne = 16;  // disparity_q4 of one pixel
// The nearest whole disparity, the upper of two.
inline constexpr int whole_px(int disparity_q4) {
    return (disparity_q4 + kDisparityOne / 2) >> 4;
}

// Why a pixel has no disparity. kNone means the disparity holds. The numbers are stable.
enum class Invalid : std::uint8_t {
    kNone = 0,
    kBorder,      // the search range leaves the right image, or the window leaves the left one
    kNoImage,     // outside the source image after rectification
    kTexture,     // too little texture to match
    kUniqueness,  // a second match is nearly as good, or a tie
    kLeftRight,   // matching from the right image disagrees
    kSaturation,  // the window is over- or under-exposed
    kCost,        // even the best match is bad
    kSpeckle,     // part of a patch too small to believe
    kRangeEdge,   // best at the last disparity: nearer than the search range
    kBody,        // a part of the robot itself
    kCount,
};

inline constexpr std::array<std::string_view, static_cast<std::size_t>(Invalid::kCount)> kInvalidNames = {
    "valid",      "border", "no_image", "texture",    "uniqueness", "left_right",
    "saturation", "cost",   "speckle",  "range_edge", "body"};

// Disparity of the left view: left(x, y) matches right(x - d, y), measured u_L - u_R, in 1/16 px.
// A pixel holds iff its reason is kNone; disparity_q4 is 0 elsewhere, and 0 is a valid disparity too.
struct DisparityMap {
    ImageView<std::int16_t> disparity_q4;
    ImageView<Invalid> invalid;

    static DisparityMap make(Arena& arena, int width, int height) {
        return {arena.image<std::int16_t>(width, height), arena.image<Invalid>(width, height)};
    }
    int width() const { return disparity_q4.width; }
    int height() const { return disparity_q4.height; }
};

struct ConstDisparityMap {
    ConstImageView<std::int16_t> disparity_q4;
    ConstImageView<Invalid> invalid;

    ConstDisparityMap() = default;
    ConstDisparityMap(const DisparityMap& map)  // NOLINT: implicit like a view of const
        : disparity_q4(map.disparity_q4), invalid(map.invalid) {}
    int width() const { return disparity_q4.width; }
    int height() const { return disparity_q4.height; }
};

}  // namespace groundline
