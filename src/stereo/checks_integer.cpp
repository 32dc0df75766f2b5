#include "stereo/checks_integer.hpp"

#include <algorithm>
#include <cstdlib>

#include "core/arena.hpp"
#include "stereo/median.hpp"
#include "stereo/paper_reading.hpp"
#include "stereo/speckle.hpp"

namespace groundline::stereo {
namespace {

// Sum of value(x, y) over the 11x11 window, coordinates clamped to the border.
template <typename Value>
int window_sum(ConstLuma image, int x, int y, Value value) {
    int sum = 0;
    for (int j = -kWindowReach; j <= kWindowReach; ++j)
        for (int i = -kWindowReach; i <= kWindowReach; ++i)
            sum += value(std::clamp(x + i, 0, image.width - 1), std::clamp(y + j, 0, image.height - 1));
    return sum;
}

}  // namespace

Invalid window_reason(ConstLuma given, ConstLuma matched, int x, int y, const CheckLimits& limits) {
    constexpr int kWindowPixels = (2 * kWindowReach + 1) * (2 * kWindowReach + 1);
    const int saturated = window_sum(
        given, x, y, [&](int u, int v) { return given.at(u, v) == 0 || given.at(u, v) == 255 ? 1 : 0; });
    if (100 * saturated > limits.saturated_percent * kWindowPixels) return Invalid::kSaturation;
    const int texture = window_sum(matched, x, y, [&](int u, int v) {
        return std::abs(matched.at(u, v) - matched.at(std::max(u - 1, 0), v));
    });
    return texture < limits.texture ? Invalid::kTexture : Invalid::kNone;
}

void finish_map(const DisparityMap& map, ConstLuma left, ConstLuma right, const CheckLimits& limits) {
    Arena arena;
    if (judges_patches(limits)) {
        SpeckleScratch scratch(map.width(), arena);
        remove_speckles(map, left, right, {limits.speckle_px, limits.alike_percent}, scratch);
    }
    if (limits.median) median_3x3(map, arena.take<std::int16_t>(2 * static_cast<std::size_t>(map.width())));
}

}  // namespace groundline::stereo
