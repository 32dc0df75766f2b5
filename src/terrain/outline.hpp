// The edges of obstacles: gaps inside them closed, and the ground beside them kept unknown.
#pragma once

#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/image.hpp"
#include "core/terrain_class.hpp"

namespace groundline::terrain {

// Used by one thread. Works on a bit a pixel: 64 pixels of a row at a time, for any mask in the same time.
class Outline {
  public:
    void take(Arena& arena, int width, int height);
    // Unmatched class 0 in a gap of at most 2 gap_px between pixels of class 2 in a row or a column becomes
    // 2; so does such a gap of at most gap_px between class 2 and the picture's edge. Then class 1 within
    // blur_px of class 2 or 3, rows and columns alike, becomes 0. Nothing else changes: never does a pixel
    // become traversable. A reach of 0 leaves its step out.
    void apply(int gap_px, int blur_px, ConstImageView<Invalid> invalid, Mask mask);

  private:
    using Word = std::uint64_t;
    // The rows of a picture, each of words_ words between two that are 0.
    using Plane = std::span<Word>;

    Word* row(Plane plane, int v) const {
        return &plane[static_cast<std::size_t>(v) * static_cast<std::size_t>(words_ + 2) + 1];
    }
    bool collect(ConstMask mask);
    void widen_along(Plane plane, int reach_px);
    void widen_across(Plane& plane, int reach_px);
    void invert(Plane plane) const;
    void fill_gaps(int gap_px, ConstImageView<Invalid> invalid, Mask mask);
    void blur(int blur_px, Mask mask);

    int width_ = 0;
    int height_ = 0;
    int words_ = 0;
    std::uint64_t last_word_ = 0;  // bits of it that are pixels
    Plane obstacles_;
    Plane things_;  // obstacles and drops
    Plane along_, across_, spare_;
};

}  // namespace groundline::terrain
