#include "terrain/shares.hpp"

#include <cstdint>

namespace groundline::terrain {

void shares_of(ConstMask mask, std::array<double, kTerrainClasses>& share) {
    std::array<std::int64_t, kTerrainClasses> counts{};
    for (int v = 0; v < mask.height; ++v) {
        const TerrainClass* kinds = mask.row(v);
        // Three sums without branches; class 0 is the rest.
        std::int32_t ones = 0;
        std::int32_t twos = 0;
        std::int32_t threes = 0;
        for (int u = 0; u < mask.width; ++u) {
            ones += kinds[u] == TerrainClass::kTraversable ? 1 : 0;
            twos += kinds[u] == TerrainClass::kObstacle ? 1 : 0;
            threes += kinds[u] == TerrainClass::kDrop ? 1 : 0;
        }
        counts[1] += ones;
        counts[2] += twos;
        counts[3] += threes;
        counts[0] += mask.width - ones - twos - threes;
    }
    const double pixels = static_cast<double>(mask.width) * mask.height;
    for (std::size_t i = 0; i < counts.size(); ++i)
        share[i] = pixels > 0.0 ? static_cast<double>(counts[i]) / pixels : 0.0;
}

}  // namespace groundline::terrain
