// Robust fit of the ground plane in disparity space, with an honest covariance.
#pragma once

#include <algorithm>
#include <array>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/ground.hpp"
#include "core/parallel.hpp"
#include "terrain/plane_kernels.hpp"

namespace groundline::terrain {

struct PlaneFitResult {
    bool found = false;
    DisparityPlane plane;                // of measured disparity
    std::array<double, 9> covariance{};  // of (du, dv, d0)
    double weight = 0.0;                 // sum of the weights, about the number of samples on the plane
    double beneath = 0.0;                // of converge(): samples that lie beneath it near the camera
};

// Iteratively reweighted least squares with Tukey weights, on three samples of the pixels, each thinner than
// the one before: approach() brings rough starts near to the plane next to each, converge() to it, fit()
// refines the best. Pixels within reach_px take part.
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

    // Takes the samples of a frame; `offset_px` is measured minus true disparity. Call first.
    void sample(ConstDisparityMap map, double offset_px);
    // Tolerances 5, 5, 4, 4, 3 px on about 1 000 pixels. found is false where too few pixels or a degenerate
    // spread remain; no covariance. These two may be called from several lanes at once.
    PlaneFitResult approach(const DisparityPlane& start) const;
    // Tolerances 3, 2, 1.5, 1.5 px on about 4 500 pixels, and what lies beneath.
    PlaneFitResult converge(const DisparityPlane& start) const;
    // Weight of the pixels of converge() on `plane` that are not on `other`: what this plane alone explains.
    double own_weight(const DisparityPlane& plane, const DisparityPlane& other) const;
    // On up to 60 000 pixels; sums are in a fixed order, whatever the lanes.
    PlaneFitResult fit(const DisparityPlane& start, Parallel& parallel);

  private:
    struct Set {
        std::span<float> u, v, d_px;
        std::size_t used = 0;
        void take(Arena& arena, std::size_t most);
        class Writer;
        kernels::Samples samples(std::size_t first, std::size_t count) const;
        kernels::Samples all() const { return samples(0, used); }
    };
    struct Score {
        double s, su, sv;
    };

    kernels::PlaneWeights weights_of(const DisparityPlane& plane, double tolerance_px) const;
    static bool improve(const kernels::PlaneMoments& moments, DisparityPlane& plane);
    DisparityPlane centred(const DisparityPlane& plane) const;
    DisparityPlane uncentred(const DisparityPlane& plane) const;
    PlaneFitResult descend(const Set& set, const DisparityPlane& start,
                           std::span<const double> tolerances_px) const;
    void finish(PlaneFitResult& result);

    int width_ = 0;
    int height_ = 0;
    int middle_u_ = 0;  // coordinates of samples are about it
    int middle_v_ = 0;
    int tile_columns_ = 0;
    int tile_rows_ = 0;
    int step_u_ = 4;  // of the pixels of fit()
    int step_v_ = 2;
    int thin_step_ = 1;
    double offset_px_ = 0.0;
    Set rough_;  // of approach()
    Set thin_;   // of converge()
    Set dense_;  // of fit()
    std::span<kernels::PlaneMoments> parts_;
    std::span<Score> tiles_;
};

}  // namespace groundline::terrain
