#include "terrain/components.hpp"

#include <algorithm>
#include <cassert>
#include <cstdlib>

namespace groundline::terrain {
namespace {

// |delta d| <= 1 px + 0.02 d, in sixteenths and without division.
bool connected(int a_q4, int b_q4) {
    return 50 * std::abs(a_q4 - b_q4) <= 50 * kDisparityOne + std::max(a_q4, b_q4);
}

bool is_thing(TerrainClass kind) {
    return kind == TerrainClass::kObstacle || kind == TerrainClass::kDrop;
}

// A row's disparities with range-edge pixels in their place.
struct RowOfDisparity {
    const std::int16_t* disparity;
    const Invalid* invalid;
    int range_edge_q4;
    int operator[](int u) const { return invalid[u] == Invalid::kRangeEdge ? range_edge_q4 : disparity[u]; }
};

RowOfDisparity row_of(ConstDisparityMap map, int v, int range_edge_q4) {
    return {map.disparity_q4.row(v), map.invalid.row(v), range_edge_q4};
}

}  // namespace

void Components::take(Arena& arena, int width, int height, int min_disparity, int disparities,
                      int min_pixels) {
    const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    first_q4_ = min_disparity * kDisparityOne;
    labels_ = arena.image<std::int32_t>(width, height);
    runs_ = arena.take<Run>(pixels);
    stats_ = arena.take<Stats>(pixels / static_cast<std::size_t>(std::max(1, min_pixels)) + 1);
    chosen_ = arena.take<std::int32_t>(stats_.size());
    inverse_px_ = arena.take<double>(static_cast<std::size_t>(disparities) * kDisparityOne + 1);
    bins_ = disparities * kBinsPerPx + 1;
    histograms_ = arena.take<std::uint32_t>(kMaxObstacles * static_cast<std::size_t>(bins_));
}

std::int32_t Components::root_of(std::int32_t run) {
    while (runs_[static_cast<std::size_t>(run)].parent != run) {
        Run& here = runs_[static_cast<std::size_t>(run)];
        here.parent = runs_[static_cast<std::size_t>(here.parent)].parent;
        run = here.parent;
    }
    return run;
}

void Components::join(std::int32_t a, std::int32_t b) {
    a = root_of(a);
    b = root_of(b);
    if (a == b) return;
    if (runs_[static_cast<std::size_t>(a)].pixels < runs_[static_cast<std::size_t>(b)].pixels)
        std::swap(a, b);
    runs_[static_cast<std::size_t>(b)].parent = a;
    runs_[static_cast<std::size_t>(a)].pixels += runs_[static_cast<std::size_t>(b)].pixels;
}

std::size_t Components::index_of(int measured_q4) const {
    const int last = static_cast<int>(inverse_px_.size()) - 1;
    return static_cast<std::size_t>(std::clamp(measured_q4 - first_q4_, 0, last));
}

int Components::label(ConstDisparityMap map, int range_edge_q4, ConstMask mask) {
    const int width = map.width();
    std::int32_t count = 0;
    for (int v = 0; v < map.height(); ++v) {
        const TerrainClass* kinds = mask.row(v);
        const RowOfDisparity d = row_of(map, v, range_edge_q4);
        std::int32_t* labels = labels_.row(v);
        for (int u = 0; u < width; ++u) {
            if (!is_thing(kinds[u])) {
                labels[u] = kNone;
                continue;
            }
            const bool continues =
                u > 0 && labels[u - 1] != kNone && kinds[u - 1] == kinds[u] && connected(d[u - 1], d[u]);
            if (!continues) {
                runs_[static_cast<std::size_t>(count)] = {count, 0};
                ++count;
            }
            labels[u] = count - 1;
            ++runs_[static_cast<std::size_t>(count - 1)].pixels;
        }
        if (v == 0) continue;
        const TerrainClass* kinds_above = mask.row(v - 1);
        const RowOfDisparity d_above = row_of(map, v - 1, range_edge_q4);
        const std::int32_t* labels_above = labels_.row(v - 1);
        std::int32_t joined = kNone;  // run above that this run was joined to last
        std::int32_t run = kNone;
        for (int u = 0; u < width; ++u) {
            if (labels[u] == kNone) continue;
            if (labels[u] != run) joined = kNone;
            run = labels[u];
            for (int w = std::max(0, u - 1); w <= std::min(width - 1, u + 1); ++w) {
                if (labels_above[w] == kNone || labels_above[w] == joined) continue;
                if (kinds_above[w] != kinds[u] || !connected(d_above[w], d[u])) continue;
                joined = labels_above[w];
                join(joined, run);
            }
        }
    }
    return count;
}

void Components::measure(ConstDisparityMap map, const ThingRules& rules, ConstMask mask) {
    for (int v = 0; v < map.height(); ++v) {
        const RowOfDisparity d = row_of(map, v, rules.range_edge_q4);
        const std::int32_t* labels = labels_.row(v);
        const double at_row = rules.ground.dv * v + rules.ground.d0;
        for (int u = 0; u < map.width(); ++u) {
            if (labels[u] == kNone) continue;
            const Run& run = runs_[static_cast<std::size_t>(labels[u])];
            const std::int32_t number = runs_[static_cast<std::size_t>(run.parent)].pixels;
            if (number == kNone) continue;
            Stats& stats = stats_[static_cast<std::size_t>(number)];
            if (stats.pixels == 0) {
                stats.left = stats.right = u;
                stats.top = v;
                stats.kind = mask.at(u, v);
            }
            stats.left = std::min(stats.left, u);
            stats.right = std::max(stats.right, u);
            stats.bottom = v;
            ++stats.pixels;
            stats.sum_q4 += d[u];
            const double inverse_px = inverse_px_[index_of(d[u])];
            stats.area += rules.unit_px * inverse_px * rules.unit_px * inverse_px;
            // H/h < clearance
            if (1.0 - (rules.ground.du * u + at_row) * inverse_px < rules.clearance) stats.low = true;
        }
    }
}

// The things to list, in the order of their mean disparity: what cannot be listed is the farthest.
void Components::choose(const ThingRules& rules) {
    chosen_count_ = 0;
    for (std::int32_t i = 0; i < thing_count_; ++i) {
        Stats& stats = stats_[static_cast<std::size_t>(i)];
        stats.listed = kNone;
        if (stats.area >= rules.min_area) chosen_[static_cast<std::size_t>(chosen_count_++)] = i;
    }
    const auto comes_first = [&](std::int32_t a, std::int32_t b) {
        const Stats& one = stats_[static_cast<std::size_t>(a)];
        const Stats& other = stats_[static_cast<std::size_t>(b)];
        if (one.low != other.low) return one.low;
        const std::int64_t left = one.sum_q4 * other.pixels;
        const std::int64_t right = other.sum_q4 * one.pixels;
        return left != right ? left > right : a < b;
    };
    const int listed = std::min(chosen_count_, static_cast<int>(kMaxObstacles));
    std::partial_sort(chosen_.begin(), chosen_.begin() + listed, chosen_.begin() + chosen_count_,
                      comes_first);
    chosen_count_ = listed;
    for (int i = 0; i < listed; ++i)
        stats_[static_cast<std::size_t>(chosen_[static_cast<std::size_t>(i)])].listed = i;
}

void Components::list(ConstDisparityMap map, const ThingRules& rules, Mask mask,
                      FixedVector<Thing, kMaxObstacles>& things) {
    std::fill_n(histograms_.begin(),
                static_cast<std::size_t>(chosen_count_) * static_cast<std::size_t>(bins_), 0U);
    for (int i = 0; i < chosen_count_; ++i) {
        const Stats& stats = stats_[static_cast<std::size_t>(chosen_[static_cast<std::size_t>(i)])];
        Thing thing;
        thing.kind = stats.kind;
        thing.overhang = !stats.low;
        thing.left = stats.left;
        thing.top = stats.top;
        thing.right = stats.right;
        thing.bottom = stats.bottom;
        thing.pixels = stats.pixels;
        thing.ratio_high = -1e30;
        thing.ratio_low = 1e30;
        things.push_back(thing);
    }
    for (int v = 0; v < map.height(); ++v) {
        const RowOfDisparity d = row_of(map, v, rules.range_edge_q4);
        const std::int32_t* labels = labels_.row(v);
        TerrainClass* kinds = mask.row(v);
        const double at_row = rules.ground.dv * v + rules.ground.d0;
        for (int u = 0; u < map.width(); ++u) {
            if (labels[u] == kNone) continue;
            const Run& run = runs_[static_cast<std::size_t>(labels[u])];
            const std::int32_t number = runs_[static_cast<std::size_t>(run.parent)].pixels;
            if (number == kNone) {
                kinds[u] = TerrainClass::kUnknown;
                continue;
            }
            const Stats& stats = stats_[static_cast<std::size_t>(number)];
            if (stats.area < rules.min_area || !stats.low) kinds[u] = TerrainClass::kUnknown;
            if (stats.listed == kNone) continue;
            const std::size_t index = index_of(d[u]);
            Thing& thing = things[static_cast<std::size_t>(stats.listed)];
            const double ratio = 1.0 - (rules.ground.du * u + at_row) * inverse_px_[index];
            thing.ratio_high = std::max(thing.ratio_high, ratio);
            thing.ratio_low = std::min(thing.ratio_low, ratio);
            const std::size_t bin = index / (kDisparityOne / kBinsPerPx);
            ++histograms_[static_cast<std::size_t>(stats.listed) * static_cast<std::size_t>(bins_) + bin];
        }
    }
    const double first_px = static_cast<double>(first_q4_) / kDisparityOne;
    for (std::size_t i = 0; i < things.size(); ++i) {
        const std::uint32_t* bins = &histograms_[i * static_cast<std::size_t>(bins_)];
        // Middle of the bin that holds the pixel of this rank, counted from the nearest.
        const auto disparity_at = [&](std::int64_t rank) {
            std::int64_t seen = 0;
            int bin = bins_ - 1;
            for (; bin > 0; --bin) {
                seen += bins[bin];
                if (seen >= rank) break;
            }
            constexpr int kStepsPerBin = kDisparityOne / kBinsPerPx;
            return first_px + (bin + 0.5 - 0.5 / kStepsPerBin) / kBinsPerPx;
        };
        const std::int64_t pixels = things[i].pixels;
        things[i].median_px = disparity_at((pixels + 1) / 2);
        things[i].near_px = disparity_at((pixels + 9) / 10) - rules.offset_px;
    }
    // A total order, so that sorting needs no stability (std::stable_sort allocates).
    std::sort(things.begin(), things.end(), [](const Thing& one, const Thing& other) {
        if (one.overhang != other.overhang) return other.overhang;
        if (one.near_px != other.near_px) return one.near_px > other.near_px;
        return one.top != other.top ? one.top < other.top : one.left < other.left;
    });
}

void Components::find(ConstDisparityMap map, const ThingRules& rules, Mask mask,
                      FixedVector<Thing, kMaxObstacles>& things) {
    assert(map.width() == labels_.width && map.height() == labels_.height);
    things.clear();
    for (std::size_t i = 0; i < inverse_px_.size(); ++i) {
        const double true_px = (first_q4_ + static_cast<double>(i)) * (1.0 / kDisparityOne) - rules.offset_px;
        inverse_px_[i] = 1.0 / std::max(true_px, 1.0 / kDisparityOne);
    }
    const int runs = label(map, rules.range_edge_q4, mask);
    // Roots with enough pixels get a number; every run then points at its root.
    thing_count_ = 0;
    for (std::int32_t i = 0; i < runs; ++i)
        runs_[static_cast<std::size_t>(i)].parent = root_of(i);
    const int least = std::max(1, rules.min_pixels);
    for (std::int32_t i = 0; i < runs; ++i) {
        Run& run = runs_[static_cast<std::size_t>(i)];
        if (run.parent != i) continue;
        const bool enough = run.pixels >= least && thing_count_ < static_cast<int>(stats_.size());
        run.pixels = enough ? thing_count_++ : kNone;
        if (enough) {
            stats_[static_cast<std::size_t>(run.pixels)] = {};
            stats_[static_cast<std::size_t>(run.pixels)].low = !(rules.clearance > 0.0);
        }
    }
    measure(map, rules, mask);
    choose(rules);
    list(map, rules, mask, things);
}

}  // namespace groundline::terrain
