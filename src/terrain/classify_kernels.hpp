// The class of every pixel of a row from its disparity and the ground's, on the processor's best vector unit.
#pragma once

#include <cstdint>

#include "core/disparity.hpp"
#include "core/terrain_class.hpp"

namespace groundline::terrain::kernels {

// Columns that share one table of limits.
inline constexpr int kClassColumns = 64;

// Ground disparities are true and in 1/16 px with 16 fractional bits ("q20"), so that 4096 px fit 32 bits.
// Tables are by measured disparity in 1/16 px from first_q4 on; `size` entries for what lies within the
// certified range of its column, then as many for what lies beyond.
struct Limit {
    std::int32_t up_q20;    // obstacle where the ground's disparity is below
    std::int32_t down_q20;  // drop where it is above; its last bit says that level ground is class 1
};
struct ClassLimits {
    const Limit* table;
    std::int32_t size;
};

struct ClassRow {
    const std::int16_t* disparity_q4;
    const Invalid* invalid;
    const std::int32_t* certified_q4;  // per column, the least measured disparity within its range
    std::int32_t first_q4;
    std::int32_t ground_q20;       // of the true ground at the first column
    std::int32_t ground_step_q20;  // from one column to the next
    std::int32_t last_q20;         // a range-edge pixel is an obstacle where the ground is below
    int count;                     // columns, at most kClassColumns
};

// The same limits where they grow evenly with the disparity, as above a plane whose cells are alike: no
// table. Products of disparities and factors must fit 32 bits.
struct EvenLimits {
    std::int32_t up_q16, down_q16;          // factors of the measured disparity
    std::int32_t up_off_q20, down_off_q20;  // taken off: the factors times the offset
    std::int32_t offset_q20;                // measured minus true disparity
    std::int32_t uncertain_q20;             // beyond its range a pixel must be nearer than the ground by this
    bool level;                             // level ground is class 1
};

// Writes row.count classes. Reads and writes up to 15 columns behind them: rows are padded.
void classify_columns(const ClassRow& row, const ClassLimits& limits, TerrainClass* out);
void classify_columns(const ClassRow& row, const EvenLimits& limits, TerrainClass* out);
// The same, pixel by pixel: what they must equal.
void classify_columns_plain(const ClassRow& row, const ClassLimits& limits, TerrainClass* out);
void classify_columns_plain(const ClassRow& row, const EvenLimits& limits, TerrainClass* out);

}  // namespace groundline::terrain::kernels
