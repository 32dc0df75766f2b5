// Connected things among the obstacle and drop pixels of a mask, in fixed memory and bounded time.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/fixed_vector.hpp"
#include "core/ground.hpp"
#include "core/result.hpp"
#include "core/terrain_class.hpp"

namespace groundline::terrain {

// What the filter needs to know of the frame.
struct ThingRules {
    DisparityPlane ground;    // of true disparity
    double offset_px = 0.0;   // measured minus true disparity
    double unit_px = 1.0;     // a pixel at true disparity d is unit_px / d wide: the baseline in metres
    double min_area = 0.003;  // sum over a thing's pixels of (unit_px / d)^2, at least
    double clearance = 0.0;   // H/h of the clearance; 0 where there is none
    // The area is the size filter; this is a floor against chance: at long range few pixels already have the
    // area, and outliers of the matching that touch each other would do.
    int min_pixels = 12;
    // The same for what is measured below far_q4: such a pixel counts for at most 1/min_pixels_far of the
    // least area.
    int min_pixels_far = 12;
    int far_q4 = std::numeric_limits<int>::min();
    int range_edge_q4 = 0;  // what a range-edge pixel counts as, measured
};

// The smallest patch that the matching believes in. Of a wall of 60000 pixels as many lie 3 deviations
// nearer.
inline constexpr std::int64_t kNearPixels = 100;

struct Thing {
    TerrainClass kind = TerrainClass::kObstacle;
    bool overhang = false;
    std::int32_t left = 0, top = 0, right = 0, bottom = 0;
    std::int32_t pixels = 0;
    double median_px = 0.0;  // measured disparity
    // True disparity that the nearest tenth of its pixels reach, at most kNearPixels of them: a post that the
    // matching joins to the wall behind it still sets the range of both.
    double near_px = 0.0;
    double ratio_high = 0.0;  // H/h of its highest and its lowest pixel
    double ratio_low = 0.0;
};

// Used by one thread. Time is near-linear in the pixels for any mask; memory is 18 bytes a pixel and some.
class Components {
  public:
    // min_pixels is the least that ThingRules will ever name.
    void take(Arena& arena, int width, int height, int min_disparity, int disparities, int min_pixels);

    // Labels the pixels of class 2 and of class 3, 8-connected where |delta d| <= 1 + 0.02 d. What is too
    // small or wholly above the clearance becomes class 0. Lists what stays and the overhangs, nearest
    // first, overhangs last; beyond kMaxObstacles the farthest stay in the mask unlisted. Each rule is
    // monotone: adding pixels to a thing never makes it vanish.
    void find(ConstDisparityMap map, const ThingRules& rules, Mask mask,
              FixedVector<Thing, kMaxObstacles>& things);

  private:
    struct Run {
        std::int32_t parent;
        std::int32_t pixels;  // of the whole thing, at its root; after numbering, the thing's number or kNone
        std::int32_t left, right;
    };
    struct Stats {
        std::uint64_t area_q32;
        std::int64_t sum_q4;
        double least, most;  // 1 - H/h of its highest and its lowest pixel
        std::int32_t left, top, right, bottom, pixels, listed;
        TerrainClass kind;
        bool low;    // reaches below the clearance
        bool large;  // has the area
    };
    // What a pixel of one measured disparity counts for. Areas are integers, so that no order of summing
    // matters: with the nearest 1/16 px still 2^40, 2^20 of them fit.
    struct Weight {
        double inverse_px;       // 1 / true disparity
        std::uint64_t area_q32;  // its square
    };
    static constexpr std::int32_t kNone = -1;
    static constexpr int kBinsPerPx = 4;
    // Counters of one bin, of which neighbouring pixels take turns: adding to one twice in a row would wait.
    static constexpr std::size_t kWays = 4;
    static constexpr double kAreaOne = 4294967296.0;

    Run& at(std::int32_t run) { return runs_[static_cast<std::size_t>(run)]; }
    std::int32_t root_of(std::int32_t run);
    void join(std::int32_t a, std::int32_t b);
    void find_runs(ConstDisparityMap map, int range_edge_q4, ConstMask mask, int v);
    bool touch(const Run& one, const Run& above, int v) const;
    void join_rows(ConstMask mask, int v);
    void number_things(int least);
    void measure(const ThingRules& rules, Mask mask);
    void choose(const ThingRules& rules);
    void list(const ThingRules& rules, Mask mask, FixedVector<Thing, kMaxObstacles>& things);
    template <typename Use>
    void for_each_run(int v, Use use) {
        const auto row = static_cast<std::size_t>(v);
        for (std::int32_t i = first_run_[row]; i < first_run_[row + 1]; ++i)
            use(at(i));
    }
    // Index into the tables by disparity.
    std::size_t index_of(int measured_q4) const { return static_cast<std::size_t>(measured_q4 - first_q4_); }

    int first_q4_ = 0;
    ImageView<std::int16_t>
        depths_;  // measured, range-edge pixels in their place; only of blocks with things
    std::span<Run> runs_;
    std::span<std::int32_t> first_run_;  // of each row
    std::span<Stats> stats_;
    int thing_count_ = 0;
    std::span<std::int32_t> chosen_;  // numbers of the things to list
    int chosen_count_ = 0;
    std::span<double> across_;   // the ground's disparity along a row, by column
    std::span<Weight> weights_;  // by measured disparity in 1/16 px
    std::span<std::uint32_t> histograms_;
    int bins_ = 0;
};

}  // namespace groundline::terrain
