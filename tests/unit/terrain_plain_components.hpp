// The rules of components.hpp stated pixel by pixel, by flooding; slow.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <utility>
#include <vector>

#include "terrain/components.hpp"

namespace groundline::terrain::test {

struct PlainSearch {
    int min_disparity = 0;
    int disparities = 64;
};

// As Components::find.
inline std::vector<Thing> plain_things(const PlainSearch& search, const DisparityMap& map,
                                       const ThingRules& rules, Mask mask) {
    struct Found {
        Thing thing;
        std::int64_t sum_q4 = 0;
        std::vector<int> depths;
        std::vector<std::pair<int, int>> pixels;
        double area = 0.0;
    };
    const int first_q4 = 16 * search.min_disparity;
    const int last_q4 = first_q4 + 16 * search.disparities;
    const auto depth = [&](int u, int v) {
        const bool edge = map.invalid.at(u, v) == Invalid::kRangeEdge;
        return std::clamp<int>(edge ? rules.range_edge_q4 : map.disparity_q4.at(u, v), first_q4, last_q4);
    };
    const auto inverse_px = [&](int depth_q4) {
        return 1.0 / std::max(depth_q4 / 16.0 - rules.offset_px, 1.0 / 16.0);
    };
    std::vector<Found> all;
    ImageView<TerrainClass> left_over;
    std::vector<TerrainClass> copy;
    for (int v = 0; v < mask.height; ++v)
        copy.insert(copy.end(), mask.row(v), mask.row(v) + mask.width);
    left_over = {copy.data(), mask.width, mask.height, mask.width};
    for (int v = 0; v < mask.height; ++v)
        for (int u = 0; u < mask.width; ++u) {
            const TerrainClass kind = left_over.at(u, v);
            if (kind != TerrainClass::kObstacle && kind != TerrainClass::kDrop) continue;
            Found found;
            found.thing.kind = kind;
            found.pixels = {{u, v}};
            left_over.at(u, v) = TerrainClass::kUnknown;
            for (std::size_t next = 0; next < found.pixels.size(); ++next) {
                const auto [x, y] = found.pixels[next];
                for (int b = std::max(0, y - 1); b <= std::min(mask.height - 1, y + 1); ++b)
                    for (int a = std::max(0, x - 1); a <= std::min(mask.width - 1, x + 1); ++a) {
                        const int one = depth(x, y);
                        const int other = depth(a, b);
                        if (left_over.at(a, b) != kind ||
                            50 * std::abs(one - other) > 800 + std::max(one, other))
                            continue;
                        left_over.at(a, b) = TerrainClass::kUnknown;
                        found.pixels.emplace_back(a, b);
                    }
            }
            Thing& thing = found.thing;
            thing.left = thing.right = u;
            thing.top = thing.bottom = v;
            thing.ratio_high = -1e30;
            thing.ratio_low = 1e30;
            for (const auto& [x, y] : found.pixels) {
                ++thing.pixels;
                thing.left = std::min(thing.left, x);
                thing.right = std::max(thing.right, x);
                thing.bottom = std::max(thing.bottom, y);
                const int here = depth(x, y);
                found.depths.push_back(here - first_q4);
                found.sum_q4 += here;
                const double side = rules.unit_px * inverse_px(here);
                found.area += here < rules.far_q4
                                  ? std::min(side * side, rules.min_area / rules.min_pixels_far)
                                  : side * side;
                const double ratio =
                    1.0 - (rules.ground.du * x + (rules.ground.dv * y + rules.ground.d0)) * inverse_px(here);
                thing.ratio_high = std::max(thing.ratio_high, ratio);
                thing.ratio_low = std::min(thing.ratio_low, ratio);
            }
            thing.overhang = rules.clearance > 0.0 && !(thing.ratio_low < rules.clearance);
            std::sort(found.depths.rbegin(), found.depths.rend());
            const auto middle = [&](std::size_t rank) {
                return search.min_disparity + (found.depths[rank - 1] / 4 + 0.375) / 4.0;
            };
            thing.median_px = middle((found.depths.size() + 1) / 2);
            thing.near_px =
                middle(std::min<std::size_t>((found.depths.size() + 9) / 10, 100)) - rules.offset_px;
            const bool listed =
                thing.pixels >= rules.min_pixels && found.area >= rules.min_area * (1.0 - 1e-9);
            if (!listed || thing.overhang)
                for (const auto& [x, y] : found.pixels)
                    mask.at(x, y) = TerrainClass::kUnknown;
            if (listed) all.push_back(std::move(found));
        }
    std::stable_sort(all.begin(), all.end(), [](const Found& a, const Found& b) {
        if (a.thing.overhang != b.thing.overhang) return b.thing.overhang;
        return a.sum_q4 * b.thing.pixels > b.sum_q4 * a.thing.pixels;
    });
    all.resize(std::min(all.size(), kMaxObstacles));
    std::vector<Thing> things;
    for (const Found& found : all)
        things.push_back(found.thing);
    std::sort(things.begin(), things.end(), [](const Thing& one, const Thing& other) {
        if (one.overhang != other.overhang) return other.overhang;
        if (one.near_px != other.near_px) return one.near_px > other.near_px;
        return one.top != other.top ? one.top < other.top : one.left < other.left;
    });
    return things;
}

}  // namespace groundline::terrain::test
