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
#include "terrain/body_frame.hpp"
#include "terrain/config.hpp"

namespace groundline::terrain {

// Used by one thread. All memory is taken at construction.
class SectorFinder {
  public:
    // Sectors of equal width share the left camera's field of view, turned by the mount's yaw, from left to
    // right; a pixel that falls outside (a camera beside the body's middle) counts in the outermost one.
    // `shared` is the rig whose field of view that is: of a picture at half its size the whole one's, so that
    // both have the same sectors.
    SectorFinder(const TerrainConfig& config, const RectifiedRig& rig, int min_disparity, int disparities,
                 Arena& arena, const RectifiedRig& shared);
    SectorFinder(const TerrainConfig& config, const RectifiedRig& rig, int min_disparity, int disparities,
                 Arena& arena)
        : SectorFinder(config, rig, min_disparity, disparities, arena, rig) {}

    // Fills `sectors` from a classified frame; leaves it empty where the ground was not found or has no
    // metres, or the rig is not calibrated. `range_limit_m` is the classifier's. Ranges are along the ground
    // from the body's origin.
    //
    // Things: nearest_m is to where a quarter of the least visible area of a thing, and 4 sampled pixels, lie
    // within a fifth of one range; so a few pixels matched wrongly within a thing decide nothing. Where
    // nothing is that large, to where most samples are. Pixels of class 2 or 3 that have a disparity count,
    // every second of every second row; range-edge pixels at the nearest range searched.
    //
    // Ground: the rows that show it are taken in stretches of 3, from the near edge of the view on. That edge
    // is where the picture begins that is not the robot itself; ground nearer than the search range is left
    // out too. free_range_m ends at the near edge of the first 0.1 m or more of which less than 3/4 was seen
    // as class 1, or where nearly no disparity of class 1 lies although rows of it do (the ground falls away
    // behind a lip), less 3 rows and one sigma of disparity: windows that match across a lip see the ground
    // beyond it. Where the certified range ends what is seen, nothing is taken off. It is never beyond
    // nearest_m, and 0 where nothing is seen at the near edge.
    //
    // Gap: ground seen nearer, and then 0.1 m or more less than half seen, or a lip. Where it begins within
    // the stopping distance and no thing stands right behind it, the sector is blocked by it: kind unknown,
    // nearest_m its near edge. Robot's own parts are no gap.
    void find(ConstDisparityMap map, const Ground& ground, ConstMask mask, double range_limit_m,
              FixedVector<Sector, kMaxSectors>& sectors);

    // From the next frame on; see TerrainConfig::tune().
    void tune(const TerrainConfig& config) { config_.tune(config); }

  private:
    // Samples of a thing by disparity, 32 bins an octave.
    struct Depth {
        std::uint32_t count;
        float nearest_square;  // squared range, m2
    };
    struct Stretch {
        std::uint16_t likely;   // samples where the ground would be seen
        std::uint16_t seen;     // of those, class 1
        std::uint16_t reached;  // samples of class 1 whose disparity lies here, wherever their row does
    };
    // Linear over the picture.
    struct Linear {
        double u, v, c;
        double at(double column, double row) const { return u * column + v * row + c; }
    };
    struct View;
    struct Edge {
        Linear beyond;  // negative to the right of it
        double cosine, sine;
    };

    View view_of(const Ground& ground) const;
    int sector_of(double x, double y, int guess) const;
    std::span<Depth> things_of(TerrainClass kind, int sector) const;
    bool nearest(TerrainClass kind, int sector, const View& view, double& range_m, double& sigma_m) const;
    void collect_things(ConstDisparityMap map, const View& view, ConstMask mask);
    void count_ground(ConstDisparityMap map, const View& view, ConstMask mask);
    int first_gap(std::span<const Stretch> stretches, double rows, int from, double least_seen,
                  double least_jump) const;
    void judge_ground(const View& view, int index, double range_limit_m, Sector& sector) const;

    TerrainConfig config_;
    RectifiedRig rig_;
    int last_disparity_;
    int count_;
    int stretches_;
    int bins_;
    double first_bearing_rad_ = 0.0;  // left edge of the leftmost sector
    double width_rad_ = 0.0;
    std::span<Edge> edges_;  // right edges
    std::span<Edge> middles_;
    std::span<Depth> things_;         // [class 2, 3][sector][bin]
    std::span<Stretch> ground_;       // [sector][stretch], rows below the horizon
    std::span<std::uint32_t> known_;  // [sector]
    std::span<std::uint32_t> below_;  // [sector]
};

}  // namespace groundline::terrain
