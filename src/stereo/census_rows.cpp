#include "stereo/census_rows.hpp"

#include <algorithm>
#include <array>
#include <cstring>

namespace groundline::stereo {
namespace {

using kernels::kWidestVector;

constexpr int kKeptRows = 8;
static_assert(kKeptRows > 2 * kCensusReachY);

}  // namespace

CensusRows::CensusRows(int width, bool mirrored, Arena& arena)
    : rows_(arena.image<std::uint8_t>(2 * kWidestVector + width, kKeptRows)), mirrored_(mirrored) {}

void CensusRows::take(ConstLuma image, int y, const kernels::CensusRow& out) {
    const int width = image.width;
    const auto kept_row = [&](int row) { return rows_.row(row % kKeptRows) + kWidestVector; };
    const int first = std::max(0, y - kCensusReachY);
    if (!kept_ || next_ < first) next_ = first;
    kept_ = true;
    for (; next_ <= std::min(y + kCensusReachY, image.height - 1); ++next_) {
        std::uint8_t* const kept = kept_row(next_);
        if (mirrored_)
            kernels::mirror_row(image.row(next_), width, kept);
        else
            std::memcpy(kept, image.row(next_), static_cast<std::size_t>(width));
        std::memset(kept - kCensusReachX, kept[0], kCensusReachX);
        std::memset(kept + width, kept[width - 1], kCensusReachX);
    }
    std::array<const std::uint8_t*, 2 * kCensusReachY + 1> rows;
    for (int j = 0; j < static_cast<int>(rows.size()); ++j)
        rows[static_cast<std::size_t>(j)] = kept_row(std::clamp(y + j - kCensusReachY, 0, image.height - 1));
    kernels::census_row(rows, width, mirrored_, out);
}

}  // namespace groundline::stereo
