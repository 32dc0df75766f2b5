#include "terrain/components.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>

namespace groundline::terrain {
namespace {

constexpr int kBlock = 64;  // pixels of a row that are looked at together: a bit each in a word

// |delta d| <= 1 px + 0.02 d, in sixteenths and without division.
bool connected(int a_q4, int b_q4) {
    return 50 * std::abs(a_q4 - b_q4) <= 50 * kDisparityOne + std::max(a_q4, b_q4);
}

// 1 where they are not connected; 16 bits throughout, for the compiler's vectors. Beyond 700 sixteenths only
// disparities of 2000 px would connect.
std::uint16_t are_apart(std::int16_t a, std::int16_t b) {
    const std::int16_t nearer = a > b ? a : b;
    const std::int16_t farther = a > b ? b : a;
    std::uint16_t step = static_cast<std::uint16_t>(nearer - farther);
    step = step < 700 ? step : std::uint16_t{700};
    const std::int16_t low = nearer > -801 ? nearer : std::int16_t{-801};
    const auto reach = static_cast<std::uint16_t>(low + 801);
    return static_cast<std::uint16_t>(step * 50) >= reach ? 1 : 0;
}

bool is_thing(TerrainClass kind) {
    return kind == TerrainClass::kObstacle || kind == TerrainClass::kDrop;
}

// The first in the lowest byte.
std::uint64_t eight_bytes(const std::uint8_t* bytes) {
    static_assert(std::endian::native == std::endian::little);
    std::uint64_t word;
    std::memcpy(&word, bytes, sizeof word);
    return word;
}

// kBlock pixels of a row, and at [0] the pixel before them. Loops of fixed length in memory of its own, for
// the compiler's vectors.
class Block {
  public:
    // Goes on to the next pixels. Returns whether one of them is of class 2 or 3.
    bool next(const TerrainClass* kinds, int pixels) {
        static_assert(static_cast<int>(TerrainClass::kObstacle) == 2 &&
                      static_cast<int>(TerrainClass::kDrop) == 3);
        kind_[0] = kind_[kBlock];
        depth_[0] = depth_[kBlock];
        kind_[kBlock] = 0;
        std::uint64_t any = 0;
        if (pixels == kBlock) {
            const auto* bytes = reinterpret_cast<const std::uint8_t*>(kinds);
            for (int i = 0; i < kBlock; i += 8)
                any |= eight_bytes(bytes + i);
            if ((any & 0x0202020202020202U) == 0) return false;
        } else {
            std::fill(kind_.begin() + 1, kind_.end(), std::uint8_t{0});
        }
        std::memcpy(&kind_[1], kinds, static_cast<std::size_t>(pixels));
        return true;
    }

    // Their disparities, range-edge pixels in their place, into `depths`.
    void take_depths(const std::int16_t* measured_q4, const Invalid* invalid, int range_edge_q4, int first_q4,
                     int last_q4, int pixels, std::int16_t* depths) {
        std::array<std::uint8_t, kBlock> reason{};
        std::memcpy(reason.data(), invalid, static_cast<std::size_t>(pixels));
        std::copy_n(measured_q4, pixels, &depth_[1]);
        const auto edge = static_cast<std::int16_t>(range_edge_q4);
        const auto least = static_cast<std::int16_t>(first_q4);
        const auto most = static_cast<std::int16_t>(last_q4);
        for (std::size_t i = 0; i < kBlock; ++i) {
            std::int16_t depth = depth_[i + 1];
            depth = reason[i] == static_cast<std::uint8_t>(Invalid::kRangeEdge) ? edge : depth;
            depth = depth > least ? depth : least;
            depth_[i + 1] = depth < most ? depth : most;
        }
        std::copy_n(&depth_[1], pixels, depths);
    }

    // A bit for each pixel, set where it or the pixel before it is of class 2 or 3 and the two do not belong
    // to one run.
    std::uint64_t breaks() const {
        std::array<std::uint16_t, kBlock> apart;
        for (std::size_t i = 0; i < kBlock; ++i)
            apart[i] = are_apart(depth_[i], depth_[i + 1]);
        std::array<std::uint8_t, kBlock> bytes;
        for (std::size_t i = 0; i < kBlock; ++i) {
            const auto differ = static_cast<std::uint8_t>(kind_[i] != kind_[i + 1] ? 1 : 0);
            const auto things = static_cast<std::uint8_t>((kind_[i] | kind_[i + 1]) >> 1U);
            bytes[i] = static_cast<std::uint8_t>((apart[i] | differ) & things);
        }
        std::uint64_t bits = 0;
        // Byte k is moved to bit 56 + k; no two partial products meet.
        for (std::size_t i = 0; i < kBlock; i += 8)
            bits |= (eight_bytes(&bytes[i]) * 0x0102040810204080U >> 56U) << i;
        return bits;
    }

  private:
    std::array<std::uint8_t, kBlock + 1> kind_{};
    std::array<std::int16_t, kBlock + 1> depth_{};
};

}  // namespace

void Components::take(Arena& arena, int width, int height, int min_disparity, int disparities,
                      int min_pixels) {
    const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    first_q4_ = min_disparity * kDisparityOne;
    depths_ = arena.image<std::int16_t>(width, height);
    runs_ = arena.take<Run>(pixels);
    first_run_ = arena.take<std::int32_t>(static_cast<std::size_t>(height) + 1);
    stats_ = arena.take<Stats>(pixels / static_cast<std::size_t>(std::max(1, min_pixels)) + 1);
    chosen_ = arena.take<std::int32_t>(stats_.size());
    across_ = arena.take<double>(static_cast<std::size_t>(width));
    weights_ = arena.take<Weight>(static_cast<std::size_t>(disparities) * kDisparityOne + 1);
    bins_ = disparities * kBinsPerPx + 1;
    histograms_ = arena.take<std::uint32_t>(kMaxObstacles * static_cast<std::size_t>(bins_) * kWays);
}

std::int32_t Components::root_of(std::int32_t run) {
    while (at(run).parent != run) {
        Run& here = at(run);
        here.parent = at(here.parent).parent;
        run = here.parent;
    }
    return run;
}

// The root of a thing is its first run, so that things are numbered as the rows meet them.
void Components::join(std::int32_t a, std::int32_t b) {
    a = root_of(a);
    b = root_of(b);
    at(std::max(a, b)).parent = std::min(a, b);
}

// Appends the runs of row v: pixels of one class, each connected to the next.
void Components::find_runs(ConstDisparityMap map, int range_edge_q4, ConstMask mask, int v) {
    const int width = map.width();
    const TerrainClass* kinds = mask.row(v);
    std::int16_t* depths = depths_.row(v);
    std::int32_t count = first_run_[static_cast<std::size_t>(v)];
    bool open = false;  // whether pixel u - 1 lies in a run
    Block block;
    for (int first = 0; first < width; first += kBlock) {
        const int pixels = std::min(kBlock, width - first);
        std::uint64_t breaks = open ? 1U : 0U;
        if (block.next(kinds + first, pixels)) {
            block.take_depths(map.disparity_q4.row(v) + first, map.invalid.row(v) + first, range_edge_q4,
                              first_q4_, first_q4_ + static_cast<int>(weights_.size()) - 1, pixels,
                              depths + first);
            breaks = block.breaks();
        }
        for (; breaks != 0; breaks &= breaks - 1) {
            const int u = first + std::countr_zero(breaks);
            if (open) at(count - 1).right = u - 1;
            open = u < width && is_thing(kinds[u]);
            if (open) {
                at(count) = {count, 0, u, u};
                ++count;
            }
        }
    }
    if (open) at(count - 1).right = width - 1;
    first_run_[static_cast<std::size_t>(v) + 1] = count;
}

// Whether a pixel of `one` and a neighbour of it in `above` are connected.
bool Components::touch(const Run& one, const Run& above, int v) const {
    const std::int16_t* d = depths_.row(v);
    const std::int16_t* d_above = depths_.row(v - 1);
    for (int u = std::max(one.left, above.left - 1); u <= std::min(one.right, above.right + 1); ++u)
        for (int w = std::max(above.left, u - 1); w <= std::min(above.right, u + 1); ++w)
            if (connected(d[u], d_above[w])) return true;
    return false;
}

// Joins the runs of row v to those of the row above.
void Components::join_rows(ConstMask mask, int v) {
    const TerrainClass* kinds = mask.row(v);
    const TerrainClass* kinds_above = mask.row(v - 1);
    std::int32_t above = first_run_[static_cast<std::size_t>(v) - 1];
    const std::int32_t begin = first_run_[static_cast<std::size_t>(v)];
    const std::int32_t end = first_run_[static_cast<std::size_t>(v) + 1];
    for (std::int32_t i = begin; i < end; ++i) {
        const Run run = at(i);
        while (above < begin && at(above).right < run.left - 1)
            ++above;
        for (std::int32_t j = above; j < begin && at(j).left <= run.right + 1; ++j) {
            const Run& other = at(j);
            if (kinds[run.left] == kinds_above[other.left] && touch(run, other, v)) join(i, j);
        }
    }
}

// Roots with enough pixels get a number; every run gets that of its thing, kNone where it is too small.
void Components::number_things(int least) {
    const std::int32_t runs = first_run_[first_run_.size() - 1];
    for (std::int32_t i = 0; i < runs; ++i) {
        at(i).parent = root_of(i);
        at(at(i).parent).pixels += at(i).right - at(i).left + 1;
    }
    thing_count_ = 0;
    for (std::int32_t i = 0; i < runs; ++i) {
        Run& run = at(i);
        // A root stands before its other runs, and its number takes the place of its pixels.
        if (run.parent == i)
            run.pixels = run.pixels >= least && thing_count_ < static_cast<int>(stats_.size())
                             ? thing_count_++
                             : kNone;
        else
            run.pixels = at(run.parent).pixels;
    }
}

void Components::measure(const ThingRules& rules, Mask mask) {
    for (int i = 0; i < thing_count_; ++i)
        stats_[static_cast<std::size_t>(i)] = {};
    for (int u = 0; u < depths_.width; ++u)
        across_[static_cast<std::size_t>(u)] = rules.ground.du * u;
    for (int v = 0; v < depths_.height; ++v) {
        const double at_row = rules.ground.dv * v + rules.ground.d0;
        const std::int16_t* d = depths_.row(v);
        TerrainClass* kinds = mask.row(v);
        for_each_run(v, [&](const Run& run) {
            if (run.pixels == kNone) {
                std::fill(kinds + run.left, kinds + run.right + 1, TerrainClass::kUnknown);
                return;
            }
            std::int64_t sum_q4 = 0;
            std::uint64_t area = 0;
            double least = std::numeric_limits<double>::infinity();
            double most = -least;
            for (int u = run.left; u <= run.right; ++u) {
                const Weight& weight = weights_[index_of(d[u])];
                sum_q4 += d[u];
                area += weight.area_q32;
                const double below = (across_[static_cast<std::size_t>(u)] + at_row) * weight.inverse_px;
                least = std::min(least, below);
                most = std::max(most, below);
            }
            Stats& stats = stats_[static_cast<std::size_t>(run.pixels)];
            if (stats.pixels == 0) {
                stats.kind = kinds[run.left];
                stats.left = run.left;
                stats.right = run.right;
                stats.top = v;
                stats.least = least;
                stats.most = most;
            }
            stats.left = std::min(stats.left, run.left);
            stats.right = std::max(stats.right, run.right);
            stats.bottom = v;
            stats.pixels += run.right - run.left + 1;
            stats.sum_q4 += sum_q4;
            stats.area_q32 += area;
            stats.least = std::min(stats.least, least);
            stats.most = std::max(stats.most, most);
        });
    }
}

// The things to list, in the order of their mean disparity: what cannot be listed is the farthest.
void Components::choose(const ThingRules& rules) {
    chosen_count_ = 0;
    for (std::int32_t i = 0; i < thing_count_; ++i) {
        Stats& stats = stats_[static_cast<std::size_t>(i)];
        stats.listed = kNone;
        // H/h < clearance in its lowest pixel
        stats.low = !(rules.clearance > 0.0) || 1.0 - stats.most < rules.clearance;
        stats.large = rules.unit_px * rules.unit_px * (static_cast<double>(stats.area_q32) / kAreaOne) >=
                      rules.min_area;
        if (stats.large) chosen_[static_cast<std::size_t>(chosen_count_++)] = i;
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

void Components::list(const ThingRules& rules, Mask mask, FixedVector<Thing, kMaxObstacles>& things) {
    std::fill_n(histograms_.begin(),
                static_cast<std::size_t>(chosen_count_) * static_cast<std::size_t>(bins_) * kWays, 0U);
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
        thing.ratio_high = 1.0 - stats.least;
        thing.ratio_low = 1.0 - stats.most;
        things.push_back(thing);
    }
    for (int v = 0; v < depths_.height; ++v) {
        const std::int16_t* d = depths_.row(v);
        TerrainClass* kinds = mask.row(v);
        for_each_run(v, [&](const Run& run) {
            if (run.pixels == kNone) return;
            const Stats& stats = stats_[static_cast<std::size_t>(run.pixels)];
            if (!stats.large || !stats.low)
                std::fill(kinds + run.left, kinds + run.right + 1, TerrainClass::kUnknown);
            if (stats.listed == kNone) return;
            std::uint32_t* bins = &histograms_[static_cast<std::size_t>(stats.listed) *
                                               static_cast<std::size_t>(bins_) * kWays];
            const int right = run.right;
            for (int u = run.left; u <= right; ++u)
                ++bins[index_of(d[u]) / (kDisparityOne / kBinsPerPx) * kWays +
                       static_cast<std::size_t>(u) % kWays];
        });
    }
    const double first_px = static_cast<double>(first_q4_) / kDisparityOne;
    for (std::size_t i = 0; i < things.size(); ++i) {
        const std::uint32_t* bins = &histograms_[i * static_cast<std::size_t>(bins_) * kWays];
        // Middle of the bin that holds the pixel of this rank, counted from the nearest; ranks rise.
        std::int64_t seen = 0;
        int bin = bins_;
        const auto disparity_at = [&](std::int64_t rank) {
            while (seen < rank && bin > 0) {
                --bin;
                for (std::size_t way = 0; way < kWays; ++way)
                    seen += bins[static_cast<std::size_t>(bin) * kWays + way];
            }
            constexpr int kStepsPerBin = kDisparityOne / kBinsPerPx;
            return first_px + (bin + 0.5 - 0.5 / kStepsPerBin) / kBinsPerPx;
        };
        const std::int64_t pixels = things[i].pixels;
        things[i].near_px = disparity_at(std::min((pixels + 9) / 10, kNearPixels)) - rules.offset_px;
        things[i].median_px = disparity_at((pixels + 1) / 2);
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
    assert(map.width() == depths_.width && map.height() == depths_.height);
    things.clear();
    const double most_far = rules.min_area / (rules.unit_px * rules.unit_px * rules.min_pixels_far);
    for (std::size_t i = 0; i < weights_.size(); ++i) {
        const double true_px = (first_q4_ + static_cast<double>(i)) * (1.0 / kDisparityOne) - rules.offset_px;
        const double inverse_px = 1.0 / std::max(true_px, 1.0 / kDisparityOne);
        double area = inverse_px * inverse_px;
        if (first_q4_ + static_cast<int>(i) < rules.far_q4) area = std::min(area, most_far);
        weights_[i] = {inverse_px, static_cast<std::uint64_t>(std::ceil(area * kAreaOne))};
    }
    first_run_[0] = 0;
    for (int v = 0; v < map.height(); ++v) {
        find_runs(map, rules.range_edge_q4, mask, v);
        if (v > 0) join_rows(mask, v);
    }
    number_things(std::max(1, rules.min_pixels));
    measure(rules, mask);
    choose(rules);
    list(rules, mask, things);
}

}  // namespace groundline::terrain
