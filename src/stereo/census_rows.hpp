// Census words of an image, row after row, from the few rows they need.
#pragma once

#include "core/arena.hpp"
#include "core/image.hpp"
#include "stereo/census_kernels.hpp"

namespace groundline::stereo {

class CensusRows {
  public:
    CensusRows() = default;
    // For images `width` wide. `mirrored`: the words of a row come from right to left.
    CensusRows(int width, bool mirrored, Arena& arena);

    // Before the first row of an image or of a part of it.
    void restart() { kept_ = false; }
    // The words of row y, which may not be above an earlier one. Writes up to kWidestVector bytes behind
    // them.
    void take(ConstLuma image, int y, const kernels::CensusRow& out);

  private:
    Luma rows_;  // the last rows with their ends repeated, row y at y % kKeptRows
    bool mirrored_ = false;
    bool kept_ = false;
    int next_ = 0;  // first row not kept yet
};

}  // namespace groundline::stereo
