// From disparities and ground to classes, obstacles and the range up to which the ground can be certified.
#pragma once

#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/fixed_vector.hpp"
#include "core/ground.hpp"
#include "core/parallel.hpp"
#include "core/rectified_rig.hpp"
#include "core/result.hpp"
#include "core/terrain_class.hpp"
#include "terrain/classify_kernels.hpp"
#include "terrain/components.hpp"
#include "terrain/config.hpp"
#include "terrain/ground_surface.hpp"
#include "terrain/outline.hpp"

namespace groundline::terrain {

// What the ground handed to the classifier is worth.
enum class GroundUse : std::uint8_t {
    kNone,  // nothing: the whole mask is unknown
    kHeld,  // an earlier frame's: obstacles and drops only, never class 1
    kWeak,  // this frame's, degraded: class 1 only in rows that this frame's own evidence supports
    kOwn,   // this frame's, trusted: class 1 in all rows but those it contradicts
};

// Used by one thread, which may lend it lanes. All memory is taken at construction; time is bounded by the
// number of pixels whatever the disparities are.
class Classifier {
  public:
    // `rig` has the size of the maps. Disparities searched as in GroundFinder.
    Classifier(const TerrainConfig& config, const RectifiedRig& rig, int min_disparity, int disparities,
               Arena& arena);

    // Per pixel, with H = h (1 - d_g/d) and r the certified range of its column (the largest at which
    // `sigmas` deviations of H on the ground, disparity noise and the fit's full covariance, are within the
    // tolerance): obstacle where H > tolerance, drop where H < -tolerance, else traversable; beyond r
    // obstacle where H exceeds both the tolerance and `sigmas` deviations, else unknown. Range-edge pixels
    // are obstacles, except where the ground itself is nearer than the search range; other invalid pixels
    // unknown. Then things, 8-connected with |delta d| <= 1 + 0.02 d: too small ones become unknown, those
    // wholly above the clearance become unknown and are listed as overhang, the rest is listed nearest first.
    // A ground with found == false counts as kNone. Heights are above `surface`, except above a held ground;
    // its contradicted cells are never class 1, others in kWeak only where supported.
    // range_limit_m is the farthest r where class 1 is possible, 0 where it is not or without metres.
    void classify(ConstDisparityMap map, const Ground& ground, GroundUse use, const GroundSurface& surface,
                  Mask out, FixedVector<Obstacle, kMaxObstacles>& obstacles, double& range_limit_m,
                  Parallel& parallel);

    // From the next frame on; see TerrainConfig::tune().
    void tune(const TerrainConfig& config) { config_.tune(config); }

  private:
    struct Wedge;

    Wedge wedge_of(const Ground& ground) const;
    double certify_columns(const Wedge& wedge);
    int far_q4() const;
    bool even_limits(const Wedge& wedge, GroundUse use, const GroundSurface& surface, int band,
                     double uncertain_px, kernels::EvenLimits& limits) const;
    void make_within(const Wedge& wedge, GroundUse use, const GroundSurface& surface);
    void make_limits(const Wedge& wedge, GroundUse use, const GroundSurface& surface);
    void classify_row(ConstDisparityMap map, const Wedge& wedge, int v, Mask out) const;

    TerrainConfig config_;
    RectifiedRig rig_;
    int last_disparity_;
    int disparities_;
    int first_q4_;
    int bands_;
    std::size_t table_;                     // entries of one table of limits
    std::span<std::int32_t> certified_q4_;  // per column, the least measured disparity within its range
    std::span<kernels::Limit> limits_;      // [band][within, beyond][disparity]
    std::span<kernels::Limit> within_;      // [disparity], of every band but for the level bit
    std::span<kernels::EvenLimits> even_;   // [band]
    std::span<bool> is_even_;               // [band]
    Components components_;
    Outline outline_;
    FixedVector<Thing, kMaxObstacles> things_;
};

}  // namespace groundline::terrain
