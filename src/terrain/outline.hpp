// The edges of obstacles: gaps inside them closed, and the ground beside them kept unknown.
#pragma once

#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/image.hpp"
#include "core/terrain_class.hpp"

namespace groundline::terrain {

// Used by one thread.
class Outline {
  public:
    void take(Arena& arena, int width, int height);
    // Unmatched class 0 in a gap of at most 2 gap_px between pixels of class 2 in a row or a column becomes
    // 2; then class 1 within blur_px of class 2 or 3, rows and columns alike, becomes 0. Nothing else
    // changes: never does a pixel become traversable. A reach of 0 leaves its step out.
    void apply(int gap_px, int blur_px, ConstImageView<Invalid> invalid, Mask mask);

  private:
    int width_ = 0;
    int height_ = 0;
    ImageView<std::uint8_t> marks_;   // 1: obstacle
    ImageView<std::uint8_t> across_;  // work
    ImageView<std::uint8_t> along_;   // work
};

}  // namespace groundline::terrain
