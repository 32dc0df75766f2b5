// The paper's matcher in integers, stated plainly: what the fast version must equal bit for bit.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/disparity.hpp"
#include "core/image.hpp"
#include "stereo/matcher.hpp"

namespace groundline::stereo {

// Costs of every pixel at every disparity, one plane per disparity. Costs after aggregation are in 1/256
// grey level.
struct CostVolume {
    int width = 0;
    int height = 0;
    int disparities = 0;
    std::vector<std::uint16_t> values;

    CostVolume(int w, int h, int d)
        : width(w),
          height(h),
          disparities(d),
          values(static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * static_cast<std::size_t>(d)) {}
    std::uint16_t& at(int x, int y, int k) { return values[index(x, y, k)]; }
    std::uint16_t at(int x, int y, int k) const { return values[index(x, y, k)]; }
    // Coordinates outside are clamped to the border.
    std::uint16_t clamped(int x, int y, int k) const;

  private:
    std::size_t index(int x, int y, int k) const {
        return (static_cast<std::size_t>(k) * static_cast<std::size_t>(height) +
                static_cast<std::size_t>(y)) *
                   static_cast<std::size_t>(width) +
               static_cast<std::size_t>(x);
    }
};

// Weights of one axis of the window, centre outward: g0 + 2 (g1 + ... + g5) = 256.
using WindowTaps = std::array<std::uint16_t, kWindowReach + 1>;
WindowTaps window_taps(Window window);

// min(|left(x) - right(x - d)|, truncation), the truncation where x - d lies outside; d = min_disparity + k.
CostVolume truncated_differences(ConstLuma left, ConstLuma right, int min_disparity, int disparities,
                                 int truncation);
// floor((sum of 11x11 weighted costs + 128) / 256).
CostVolume aggregated(const CostVolume& costs, const WindowTaps& taps);
// Rule 1 on every cost of the generation before; a missing neighbour in disparity counts as not near.
CostVolume after_rule_one(const CostVolume& costs, RuleOne rule);
// Rule 2: `costs` scaled to floor(10 c / 13) where `looked_at` (the same volume, or the one before rule 1)
// satisfies it.
CostVolume after_rule_two(const CostVolume& costs, const CostVolume& looked_at, RuleTwo rule);

// The whole matcher: the same result as make_matcher(config, ...)->match(), from whole volumes.
void match_paper_integer(const MatcherConfig& config, ConstLuma left, ConstLuma right,
                         const DisparityMap& out);

}  // namespace groundline::stereo
