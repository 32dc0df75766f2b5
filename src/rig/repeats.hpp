// Do cameras still deliver new pictures, and two different ones?
#pragma once

#include <cstdint>

#include "core/image.hpp"

namespace groundline::rig {

// True where both pictures are the same to the last pixel: one camera opened twice. Views of one size.
bool identical(ConstLuma left, ConstLuma right);

// Counts how often a pair comes again. Noise changes every picture of a camera that runs, so every eighth row
// is looked at; a source that repeats its pictures on purpose (files, scenes) is none to ask.
class RepeatCounter {
  public:
    // Pairs in a row, this one included, whose looked-at pixels are all the same: 1 for a new one. Pictures
    // as delivered.
    int count(ConstLuma left, ConstLuma right);

  private:
    std::uint64_t last_ = 0;
    int same_ = 0;
};

}  // namespace groundline::rig
