// The edges of obstacles: gaps inside them closed, and the ground beside them kept unknown.
#pragma once

#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/image.hpp"
#include "core/terrain_class.hpp"

namespace groundline::terrain {

// How far, in px, things reach beyond their own pixels.
struct OutlineReach {
    int gap = 0;     // half the longest unmatched gap inside an obstacle
    int beside = 0;  // of an obstacle to both sides,
    int beyond = 0;  // up the picture
    int before = 0;  // and down it
    int lip = 0;     // of a drop to all sides
};

// Used by one thread. Works on a bit a pixel: 64 pixels of a row at a time, for any mask in the same time.
class Outline {
  public:
    void take(Arena& arena, int width, int height);
    // Unmatched class 0 in a gap of at most 2 gap between pixels of class 2 in a row or a column becomes 2;
    // so does such a gap of at most gap between class 2 and the picture's edge. Then class 1 becomes 0 in the
    // rectangle about each pixel of class 2 that ends `beside` to its left and right, `beyond` above and
    // `before` below it, and in the square about each pixel of class 3 that ends `lip` away. Nothing else
    // changes: never does a pixel become traversable.
    void apply(const OutlineReach& reach, ConstImageView<Invalid> invalid, Mask mask);

  private:
    using Word = std::uint64_t;
    // The rows of a picture, each of words_ words between two that are 0.
    using Plane = std::span<Word>;

    Word* row(Plane plane, int v) const {
        return &plane[static_cast<std::size_t>(v) * static_cast<std::size_t>(words_ + 2) + 1];
    }
    bool collect(ConstMask mask);
    void widen_along(Plane plane, int reach_px);
    void widen_across(Plane& plane, int up_px, int down_px);
    void invert(Plane plane) const;
    void fill_gaps(int gap_px, ConstImageView<Invalid> invalid, Mask mask);
    void blur(const OutlineReach& reach, Mask mask);

    int width_ = 0;
    int height_ = 0;
    int words_ = 0;
    std::uint64_t last_word_ = 0;  // bits of it that are pixels
    Plane obstacles_, drops_;
    Plane along_, across_, spare_;
};

}  // namespace groundline::terrain
