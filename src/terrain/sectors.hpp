// What is known per bearing about the robot: nearest thing, and how far ground was really seen.
#pragma once

#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/fixed_vector.hpp"
#include "core/ground.hpp"
#include "core/rectified_rig.hpp"
#include "core/result.hpp"
#include "core/terrain_class.hpp"
#include "terrain/config.hpp"

namespace groundline::terrain {

// Used by one thread. All memory is taken at construction.
class SectorFinder {
  public:
    // Sectors of equal width share the left camera's field of view, turned by the mount's yaw, from left to
    // right; a pixel that falls outside (a camera beside the body's middle) counts in the outermost one.
    SectorFinder(const TerrainConfig& config, const RectifiedRig& rig, int min_disparity, int disparities,
                 Arena& arena);

    // Fills `sectors` from a classified frame; leaves it empty where the ground was not found or has no
    // metres, or the rig is not calibrated. Ranges are along the ground from the body's origin. nearest_m is
    // to the 4th-nearest sampled pixel of class 2 or 3, so that no single pixel decides; range-edge pixels
    // count at the nearest range searched. free_range_m ends at the first stretch of ground of which less
    // than half was seen as class 1, and never beyond nearest_m: it is 0 where the nearest stretch is not.
    void find(ConstDisparityMap map, const Ground& ground, ConstMask mask,
              FixedVector<Sector, kMaxSectors>& sectors);

  private:
    struct View;
    int sector_of(double x, double y, int guess) const;
    void count_things(ConstDisparityMap map, const View& view, ConstMask mask);
    void count_ground(const View& view, ConstMask mask);
    double nearest(std::span<const std::uint16_t> bins, double scale, double& width_m) const;

    TerrainConfig config_;
    RectifiedRig rig_;
    int last_disparity_;
    int count_;
    int thing_bins_;
    int ground_bins_;
    double first_bearing_rad_ = 0.0;  // left edge of the leftmost sector
    double width_rad_ = 0.0;
    double cos_yaw_ = 1.0;
    double sin_yaw_ = 0.0;
    std::span<double> edge_cos_;  // direction of each right edge
    std::span<double> edge_sin_;
    std::span<std::uint16_t> things_;         // [class 2, 3][sector][inverse range bin]
    std::span<std::uint32_t> ground_seen_;    // [sector][inverse range bin]
    std::span<std::uint32_t> ground_likely_;  // the same, whatever the class
    std::span<std::uint32_t> known_;          // [sector]
    std::span<std::uint32_t> below_;          // [sector]
};

}  // namespace groundline::terrain
