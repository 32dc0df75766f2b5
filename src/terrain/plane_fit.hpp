// Robust fit of the ground plane in disparity space, with an honest covariance.
#pragma once

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
    double weight = 0.0;                 // sum of the weights, about the number of pixels on the plane
};

// Iteratively reweighted least squares on every second pixel of every second row: Tukey weights, tolerance
// 5, 4, 3, 2, 1.5 px, and never more than 0.5 px + a quarter of the ground's own disparity, so that far away
// a thing of a few decimetres is not taken for ground.
//
// Covariance: neighbouring pixels share their matching errors, so counting them as independent would
// understate it by a factor of 5 to 30. Residuals are summed over tiles of 32 x 32 px, which do not share
// them, and the covariance is the sandwich A^-1 (sum of score score') A^-1 of those sums, plus the same with
// strips of 32 whole rows for errors that run along rows (rounding to whole disparities), plus 0.05 px common
// to all pixels that no statistic of one frame can see.
class PlaneFit {
  public:
    void take(Arena& arena, int width, int height);

    // `offset_px` is measured minus true disparity. found is false where too few pixels or a degenerate
    // spread remain. Sums are in a fixed order, whatever the lanes.
    PlaneFitResult fit(ConstDisparityMap map, const DisparityPlane& start, double offset_px,
                       Parallel& parallel);

  private:
    struct RowSums {
        double w, wu, wuu, wd, wud;
    };
    struct Score {
        double s, su, sv;
    };

    void sum_rows(ConstDisparityMap map, const DisparityPlane& plane, double offset_px, double tolerance_px,
                  Parallel& parallel);
    void covariance(ConstDisparityMap map, double offset_px, Parallel& parallel, PlaneFitResult& result);

    int width_ = 0;
    int height_ = 0;
    int tile_columns_ = 0;
    int tile_rows_ = 0;
    std::span<RowSums> rows_;
    std::span<Score> tiles_;
    std::span<double> slopes_;  // per tile row, sum of the derivative of the score
};

}  // namespace groundline::terrain
