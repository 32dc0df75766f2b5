#include "pipeline/stages.hpp"

#include <algorithm>

namespace groundline::pipeline {
namespace {

// Writes `reason` where a marked pixel lies within `reach` px, rows and columns alike.
void widen(ConstImageView<std::uint8_t> marked, int reach, Invalid reason, ImageView<std::uint8_t> result) {
    for (int y = 0; y < marked.height; ++y)
        for (int x = 0; x < marked.width; ++x) {
            if (marked.at(x, y) == 0) continue;
            for (int v = std::max(y - reach, 0); v <= std::min(y + reach, marked.height - 1); ++v)
                for (int u = std::max(x - reach, 0); u <= std::min(x + reach, marked.width - 1); ++u)
                    result.at(u, v) = static_cast<std::uint8_t>(reason);
        }
}

// The robot's own parts come last: there nothing is to be seen, matched or not.
ConstImageView<std::uint8_t> reasons_of(ConstImageView<std::uint8_t> outside,
                                        ConstImageView<std::uint8_t> body, const RectifiedRig& rig,
                                        Arena& arena) {
    if (outside.empty() && body.empty()) return {};
    const auto result = arena.image<std::uint8_t>(rig.width, rig.height);
    widen(outside, stereo::kWindowReach, Invalid::kNoImage, result);
    widen(body, stereo::kWindowReach, Invalid::kBody, result);
    return result;
}

}  // namespace

Stages::Stages(const StagesConfig& config, const RectifiedRig& rig, const RectifiedRig& shared,
               const Unusable& unusable, int lanes, Arena& arena)
    : matcher(stereo::make_matcher(config.matcher, rig.width, rig.height, lanes, arena)),
      ground_finder(config.terrain, rig, matcher->min_disparity(), matcher->disparities(), arena),
      classifier(config.terrain, rig, matcher->min_disparity(), matcher->disparities(), arena),
      sector_finder(config.terrain, rig, matcher->min_disparity(), matcher->disparities(), arena, shared),
      unusable_left(reasons_of(unusable.outside_left, unusable.body, rig, arena)),
      unusable_right(reasons_of(unusable.outside_right, {}, rig, arena)) {
    if (config.grid.on)
        elevation_grid.emplace(config.grid, config.terrain, rig, matcher->min_disparity(),
                               matcher->disparities(), arena);
}

void Stages::tune(const terrain::TerrainConfig& config) {
    ground_finder.tune(config);
    classifier.tune(config);
    sector_finder.tune(config);
    if (elevation_grid) elevation_grid->tune(config);
}

void Stages::mark_unusable_pixels(const DisparityMap& map) const {
    const ConstImageView<std::uint8_t>& left = unusable_left;
    const ConstImageView<std::uint8_t>& right = unusable_right;
    if (left.empty() && right.empty()) return;
    for (int y = 0; y < map.height(); ++y) {
        std::int16_t* disparity = map.disparity_q4.row(y);
        Invalid* invalid = map.invalid.row(y);
        for (int x = 0; x < map.width(); ++x) {
            Invalid reason = left.empty() ? Invalid::kNone : static_cast<Invalid>(left.at(x, y));
            if (reason != Invalid::kBody && invalid[x] != Invalid::kNone) continue;
            if (reason == Invalid::kNone && !right.empty()) {
                const int matched = x - whole_px(disparity[x]);
                if (matched >= 0 && matched < map.width())
                    reason = static_cast<Invalid>(right.at(matched, y));
            }
            if (reason == Invalid::kNone) continue;
            invalid[x] = reason;
            disparity[x] = 0;
        }
    }
}

}  // namespace groundline::pipeline
