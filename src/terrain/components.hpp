// Connected things among the obstacle and drop pixels of a mask, in fixed memory and bounded time.
#pragma once

#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/fixed_vector.hpp"
#include "core/image.hpp"
#include "core/result.hpp"
#include "core/terrain_class.hpp"

namespace groundline::terrain {

// What the filter needs to know of the frame. Disparities are in 1/16 px, measured.
struct ThingRules {
    double offset_px = 0.0;    // measured minus true disparity
    double px_per_unit = 1.0;  // image px per metre, or per camera height, at 1 px of true disparity: 1/b
    double min_area = 0.003;   // in those units squared
    int min_pixels = 12;
    int range_edge_q4 = 0;  // what a range-edge pixel counts as
    // H <= clearance  <=>  clearance_factor d <= d_g with d_g = du u + dv v + d0, all true disparities.
    bool has_clearance = false;
    double clearance_factor = 0.0;
    DisparityPlane plane;  // true disparity
};

// Used by one thread.
class Components {
  public:
    void take(Arena& arena, int width, int height, int min_disparity, int disparities);

    // Labels the pixels of class 2 and 3, 8-connected within a class where |delta d| <= 1 + 0.02 d, takes
    // what is too small or wholly above the clearance out of the mask (class 0), and lists the rest, nearest
    // first, and the overhangs; what exceeds kMaxObstacles stays in the mask unlisted, the farthest first.
    // Fills pixels, box, disparity (median), and disparity_px_near, heights left to the caller as below.
    struct Thing {
        TerrainClass kind = TerrainClass::kObstacle;
        bool overhang = false;
        std::int32_t left = 0, top = 0, right = 0, bottom = 0;
        std::int32_t pixels = 0;
        double median_px = 0.0;   // measured disparity
        double near_px = 0.0;     // true disparity of the nearest tenth
        double ratio_high = 0.0;  // H/h of the highest and the lowest pixel
        double ratio_low = 0.0;
    };
    void find(ConstDisparityMap map, const ThingRules& rules, Mask mask,
              FixedVector<Thing, kMaxObstacles>& things);

  private:
    struct Stats;
};

}  // namespace groundline::terrain
