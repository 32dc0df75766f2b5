#include "terrain/v_disparity.hpp"

#include <algorithm>
#include <cassert>
#include <cstdint>

namespace groundline::terrain {
namespace {

constexpr int kBinsPerPx = 4;
constexpr int kStepsPerBin = kDisparityOne / kBinsPerPx;
constexpr int kColumnStep = 2;
constexpr int kUnits = 16;

}  // namespace

VDisparity make_v_disparity(Arena& arena, int height, int min_disparity, int disparities) {
    VDisparity result;
    result.histogram = arena.image<std::uint16_t>(disparities * kBinsPerPx + 1, height);
    result.bins_per_px = kBinsPerPx;
    result.first_px = min_disparity;
    return result;
}

void build_v_disparity(ConstDisparityMap map, VDisparity& out, Parallel& parallel) {
    assert(out.histogram.height == map.height() && out.bins_per_px == kBinsPerPx);
    const int first_q4 = static_cast<int>(out.first_px) * kDisparityOne;
    const int bins = out.histogram.width;
    const int end_q4 = (bins - 1) * kStepsPerBin;
    // A row of up to 4095 pixels cannot exceed 16 bits even when all fall into one bin.
    const bool may_saturate = (map.width() + 1) * kUnits > 65535;
    parallel.for_each(map.height(), [&](int v, int) {
        const std::int16_t* disparity = map.disparity_q4.row(v);
        const Invalid* invalid = map.invalid.row(v);
        std::uint16_t* cells = out.histogram.row(v);
        std::fill_n(cells, bins, std::uint16_t{0});
        for (int u = 0; u < map.width(); u += kColumnStep) {
            if (invalid[u] != Invalid::kNone) continue;
            const int above = disparity[u] - first_q4;
            if (above < 0 || above > end_q4) continue;
            const int bin = above / kStepsPerBin;
            const int upper = (above % kStepsPerBin) * (kColumnStep * kUnits / kStepsPerBin);
            const int lower = kColumnStep * kUnits - upper;
            if (may_saturate) {
                cells[bin] = static_cast<std::uint16_t>(std::min(cells[bin] + lower, 65535));
                if (upper > 0)
                    cells[bin + 1] = static_cast<std::uint16_t>(std::min(cells[bin + 1] + upper, 65535));
            } else {
                cells[bin] = static_cast<std::uint16_t>(cells[bin] + lower);
                // Behind the last bin, where nothing is added, rows are padded.
                cells[bin + 1] = static_cast<std::uint16_t>(cells[bin + 1] + upper);
            }
        }
    });
}

}  // namespace groundline::terrain
