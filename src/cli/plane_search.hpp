// Planes among disparities: what a search for the ground by chance draws and least squares is made of.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/ground.hpp"
#include "core/rectified_rig.hpp"

namespace groundline::cli {

struct DisparityPoint {
    double u;
    double v;
    double disparity;  // measured
};

// A fixed pseudo-random choice, the same in every run.
class PointPicker {
  public:
    // Borrows `points`, which are not empty.
    explicit PointPicker(const std::vector<DisparityPoint>& points) : points_(points) {}
    const DisparityPoint& next();

  private:
    const std::vector<DisparityPoint>& points_;
    std::uint64_t state_ = 1;
};

// Nothing where the three lie on a line of the picture.
std::optional<DisparityPlane> plane_through(const DisparityPoint& a, const DisparityPoint& b,
                                            const DisparityPoint& c);

// Whether a camera can stand on it: height 0.2 .. 2.5 m, pitch -5 .. 40 deg, roll within 12 deg. The rig is
// calibrated.
bool possible_ground(const DisparityPlane& plane, const RectifiedRig& rig);

// How much a point counts whose residual is r limits, 0 <= r < 1.
enum class Weight : std::uint8_t {
    kEqual,  // 1
    kTukey,  // (1 - r^2)^2
};
// Least squares over the points less than `limit` px from `plane`; nothing where they do not make a plane.
std::optional<DisparityPlane> refined_plane(const DisparityPlane& plane, double limit, Weight weight,
                                            const std::vector<DisparityPoint>& points);

}  // namespace groundline::cli
