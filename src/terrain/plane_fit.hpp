// Robust fit of the ground plane in disparity space, with an honest covariance.
#pragma once

#include <algorithm>
#include <array>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/ground.hpp"
#include "core/parallel.hpp"

namespace groundline::terrain {

struct PlaneFitResult {
    bool found = false;
    DisparityPlane plane;                // of measured disparity
    std::array<double, 9> covariance{};  // of (du, dv, d0)
    double weight = 0.0;                 // sum of the weights, about the number of samples on the plane
    double beneath = 0.0;                // of converge(): samples that lie beneath it near the camera
};

// How far from the ground a pixel may lie to take part, where the ground's true disparity is ground_px: the
// tolerance, but never more than half a pixel and a quarter of that disparity, so that far away a thing of a
// few decimetres is not taken for ground.
inline double reach_px(double tolerance_px, double ground_px) {
    return std::min(std::max(tolerance_px, std::min(4.0, 0.08 * ground_px)), 0.5 + 0.25 * ground_px);
}

// Iteratively reweighted least squares with Tukey weights, in two steps: converge() brings any number of
// rough starts on a thin sample of pixels to the plane next to each, tolerance 5, 4, 3, 2, 1.5 px; fit()
// refines the best on every second pixel of every second row. Each within
// reach_px.
//
// Covariance: neighbouring pixels share their matching errors, so counting them as independent would
// understate it by a factor of 5 to 30. Residuals are summed over tiles of 32 x 32 px, which do not share
// them, and the covariance is the sandwich A^-1 (sum of score score') A^-1 of those sums, plus the same with
// strips of 32 whole rows for errors that run along rows (rounding to whole disparities), plus what no
// statistic of one frame can see: 0.09 px common to all pixels, and growing evenly from the middle of the
// picture to its border 0.08 px along v and 0.02 px along u.
class PlaneFit {
  public:
    void take(Arena& arena, int width, int height);

    // Takes the thin sample of a frame; `offset_px` is measured minus true disparity. Call first.
    void sample(ConstDisparityMap map, double offset_px);
    // Leaves out the tolerances above first_tolerance_px. found is false where too few pixels or a degenerate
    // spread remain; no covariance. May be called from several lanes at once.
    PlaneFitResult converge(const DisparityPlane& start, double first_tolerance_px) const;
    // Weight of the thin sample on `plane` that is not on `other`: what this plane alone explains.
    double own_weight(const DisparityPlane& plane, const DisparityPlane& other) const;
    // Sums are in a fixed order, whatever the lanes.
    PlaneFitResult fit(ConstDisparityMap map, const DisparityPlane& start, Parallel& parallel);

  private:
    struct Sample {
        float u, v, d_px;
    };
    struct RowSums {
        double w, wu, wuu, wd, wud;
    };
    struct Score {
        double s, su, sv;
    };
    struct Moments;

    void sum_rows(ConstDisparityMap map, const DisparityPlane& plane, double tolerance_px,
                  Parallel& parallel);
    Moments moments_of_rows() const;
    bool improve(const Moments& moments, DisparityPlane& plane) const;
    void covariance(ConstDisparityMap map, Parallel& parallel, PlaneFitResult& result);

    int width_ = 0;
    int height_ = 0;
    int tile_columns_ = 0;
    int tile_rows_ = 0;
    int sample_step_ = 1;
    std::size_t samples_used_ = 0;
    double offset_px_ = 0.0;
    std::span<Sample> samples_;
    std::span<RowSums> rows_;
    std::span<Score> tiles_;
    std::span<double> slopes_;   // per tile row, sum of the derivative of the score
    std::span<double> weights_;  // per tile row
};

}  // namespace groundline::terrain
