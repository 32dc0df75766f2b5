// How easily the ground about the robot is driven, cell by cell: elevation, slope, roughness, step and an
// index.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/ground.hpp"
#include "core/rectified_rig.hpp"
#include "core/result.hpp"
#include "core/terrain_class.hpp"
#include "terrain/config.hpp"

namespace groundline::terrain {

struct GridConfig {
    bool on = false;
    double cell_m = 0.1;
    double forward_m = 8.0;   // cells from the body's origin to here,
    double side_m = 4.0;      // and so far to either side
    double steep_deg = 25.0;  // a slope from which on the index is 0
};

// The traversability index: 1 as easy as it gets, 0 not to be driven. Rules over linguistic sets, after
// Seraji
// ("Traversability index: a new concept for planetary rovers", 1999): each of slope, roughness and step is
// easy, medium or hard to a degree; easy fully up to `easy`, hard fully from `hard` on, medium fully in the
// middle, linear between. Any hard one: 0. Else each medium one costs a third. Degrees multiply and sum to 1,
// so no input, growing, ever raises the index.
struct IndexRules {
    struct Limits {
        double easy, hard;
    };
    Limits slope_rad;
    Limits roughness_m;
    Limits step_m;

    // Hard: a slope of steep_deg, a roughness of half and a step of the whole tolerance.
    static IndexRules of(const GridConfig& grid, const TerrainConfig& config);
    // All three at least 0.
    double index(double slope_rad, double roughness_m, double step_m) const;
};

// Cells along x (forward) from the body's origin, along y from the right to the left: memory for one result.
// Empty where `config` is off. Throws Refusal where there would be more cells than kMaxGridCells.
TerrainGrid make_terrain_grid(const GridConfig& config, Arena& arena);

// Used by one thread. All memory is taken at construction. No allocation, time bounded by pixels and cells.
class ElevationGrid {
  public:
    // `rig` has the size of the maps. Disparities searched as in GroundFinder. Throws as make_terrain_grid.
    ElevationGrid(const GridConfig& grid, const TerrainConfig& config, const RectifiedRig& rig,
                  int min_disparity, int disparities, Arena& arena);

    // Fills `grid`, made with the same GridConfig, from a classified frame; all of it is unknown where the
    // ground was not found or has no metres, or the rig is not calibrated. A pixel belongs to the cell of its
    // foot point on the ground plane; heights are H = h (1 - d_g/d), slopes against that plane too (the
    // robot's own tilt is not in them).
    //
    // Class. Every pixel of class 2 and 3 counts (in rows wholly above the horizon, every fourth row's): its
    // cell is obstacle, else drop, never traversable. A cell without such is traversable with at least 3 of
    // its points sampled as class 1, else unknown; pixels of class 0 are never looked at. Range-edge pixels
    // count at the nearest range searched. Ground is sampled 4 times or more across and 3 times along a cell,
    // at every pixel where a cell has fewer.
    // Elevation: mean of the points, of ground or of things, that made the class (Langer's statistics).
    // highest_m: the second-highest of all points, so that no single one decides.
    // Slope: of the plane through the ground points of the 5x5 cells about a traversable cell, least squares.
    // Roughness: their RMS about that plane, less what the slope itself makes of points spread evenly in a
    // cell. Step: along x and y, the rise over a cell and its two neighbours beyond what the slopes on both
    // sides explain, and the height over the middle of the two; an obstacle stands there with its highest
    // point. Noise: one pixel's height has the deviation sigma_H = h sigma_d / d. Roughness and step are what
    // their square exceeds sigma_H^2 by. Where sigma_H is more than a quarter of the tolerance none of the
    // three is measured. Index: IndexRules where all three are measured; 0 for obstacles and drops.
    void find(ConstDisparityMap map, const Ground& ground, ConstMask mask, TerrainGrid& grid);

    // From the next frame on; see TerrainConfig::tune().
    void tune(const TerrainConfig& config) {
        terrain_.tune(config);
        rules_ = IndexRules::of(config_, terrain_);
    }

  private:
    // What fell into a cell; integers, so that no order matters. Ground's x and y are from the cell's corner
    // in 1/256 of a cell, heights in 0.1 mm.
    struct Points {
        std::int32_t n, x, y, z;  // sums over ground points
        std::int64_t zz;
        std::int64_t thing_z;
        std::int32_t obstacles, drops;
        std::int32_t highest, second;  // of all points; kLowest where there is none
    };
    // Sums over the ground points of several cells, x and y from the grid's corner, each cell's points taken
    // at their middle.
    struct Moments {
        std::int64_t n, x, y, xx, xy, yy, z, xz, yz, zz;
        void add(const Moments& other);
        void subtract(const Moments& other);
    };
    struct View;

    View view_of(const Ground& ground) const;
    void add_ground(ConstDisparityMap map, const View& view, ConstMask mask);
    void add_things(ConstDisparityMap map, const View& view, ConstMask mask);
    void classify_cells(TerrainGrid& grid);
    Moments moments_of(int row, int column) const;
    void advance_strip(int row);
    void measure_cell(const View& view, const Moments& window, int row, int column, GridCell& cell) const;
    double step_along(std::size_t at, int position, int length, std::ptrdiff_t stride) const;

    GridConfig config_;
    TerrainConfig terrain_;
    RectifiedRig rig_;
    IndexRules rules_;
    int last_disparity_;
    int rows_ = 0;
    int columns_ = 0;
    std::span<Points> points_;
    std::span<double> levels_;   // elevation that a step is measured from; NaN where unknown
    std::span<Moments> strip_;   // per column, of the five rows about one, with empty columns at either end
    std::span<Moments> recent_;  // of these five rows, row r at r % 5
};

}  // namespace groundline::terrain
