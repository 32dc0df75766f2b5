// From disparities to the ground: v-disparity, Hough line, robust line, robust plane with roll.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/evidence.hpp"
#include "core/ground.hpp"
#include "core/parallel.hpp"
#include "core/rectified_rig.hpp"
#include "core/result.hpp"
#include "terrain/config.hpp"
#include "terrain/ground_surface.hpp"
#include "terrain/hough.hpp"
#include "terrain/plane_fit.hpp"

namespace groundline::terrain {

// Used by one thread, which may lend it lanes. All memory is taken at construction.
class GroundFinder {
  public:
    // `rig` has the size of the maps. Disparities searched are min_disparity .. min_disparity + disparities
    // - 1 px. Throws Refusal for a size, a range or a gate that cannot be.
    GroundFinder(const TerrainConfig& config, const RectifiedRig& rig, int min_disparity, int disparities,
                 Arena& arena);

    // Fills the histogram, the evidence and the ground. `prior` (calibrated rigs only, else ignored) narrows
    // the gate to 8 deg and 30 % about a pose that was trusted a moment ago; pass nullptr when there is none
    // or when frames with it were not believed. Ground::found only if a line was found that enough rows and
    // pixels lie on, its pose is inside the gate and the view is not filled by something upright.
    // Where the rig is not calibrated only the plane is given and metric is false.
    // Evidence: second_peak_ratio is the most that a rival plane inside the gate alone explains, over what
    // the ground does; residual_rms_px is of the pixels within 1.5 px, 0.87 where they are spread evenly;
    // wall is set where 2 px of disparity hold more pixels below the horizon than the ground does, or the
    // plane found leans more than 60 deg. Deterministic for any number of lanes; no allocation.
    void find(ConstDisparityMap map, VDisparity& v_disparity, Parallel& parallel, const GroundPose* prior,
              GroundEvidence& evidence, Ground& ground);

    // The last frame's ground about that plane; flat and supported nowhere where none was found.
    const GroundSurface& surface() const { return surface_; }

    // From the next frame on; see TerrainConfig::tune().
    void tune(const TerrainConfig& config) { config_.tune(config); }

  private:
    struct RowTally {
        std::int32_t below = 0;     // sampled pixels below the horizon
        std::int32_t valid = 0;     // of these, with a disparity
        std::int32_t near = 0;      // of these, within 1 px of the ground
        std::int32_t standing = 0;  // too far above the ground to take part
        std::int32_t inliers = 0;   // within 1.5 px
        std::int32_t blocked = 0;   // invalid pixels of the whole row
        double square = 0.0;        // of the inliers' residuals
        double weight = 0.0;        // Tukey weights at 3 px
        double residual = 0.0;      // weighted sum
    };

    Gate gate_for(const GroundPose* prior) const;
    void set_line_gate(const Gate& gate);
    bool fit(ConstDisparityMap map, const VDisparity& v_disparity, const Gate& gate, Parallel& parallel,
             PlaneFitResult& best, double& second_ratio);
    void shape(ConstDisparityMap map, DisparityPlane& plane, Parallel& parallel);
    double tolerance_share(const DisparityPlane& plane) const;
    void tally(ConstDisparityMap map, const DisparityPlane& plane, Parallel& parallel);
    int supported_run(const DisparityPlane& plane) const;
    bool nearly_same(const DisparityPlane& a, const DisparityPlane& b) const;
    bool inside(const DisparityPlane& plane, const Gate& gate) const;
    bool leans(const DisparityPlane& plane) const;
    double upright_mass(const VDisparity& v_disparity, int first_row);
    double chance(double within_px) const;

    TerrainConfig config_;
    RectifiedRig rig_;
    int last_disparity_;
    int disparities_;
    double offset_px_;  // measured minus true disparity
    double centre_u_;   // where a line's horizon row is meant
    double centre_v_;
    int row_step_ = 2;  // of the rows that vote
    LineGate line_gate_;
    Hough hough_;
    PlaneFit plane_fit_;
    GroundSurface surface_;
    std::span<RowTally> tally_;
    std::span<std::uint32_t> column_mass_;
};

}  // namespace groundline::terrain
