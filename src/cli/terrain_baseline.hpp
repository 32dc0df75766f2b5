// What a user would script instead: OpenCV's matcher, a plane by chance draws, a threshold on height.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/compared_matchers.hpp"
#include "cli/evaluation.hpp"
#include "core/ground.hpp"
#include "core/image.hpp"
#include "core/rectified_rig.hpp"
#include "core/terrain_class.hpp"

namespace groundline::cli {

// The ground among the disparities of the lower half of the picture (1/256 px, 0 none): the plane through
// three of them, of 500 fixed pseudo-random choices, that most lie within 1 px of, refined twice by least
// squares over those. Nothing where no plane is possible_ground() and holds at least a tenth of them. The rig
// is calibrated.
std::optional<DisparityPlane> ransac_ground(DisparityQ8 disparity, const RectifiedRig& rig);

// Obstacle above the tolerance, drop below it, else traversable; unknown where there is no disparity.
void classify_by_height(DisparityQ8 disparity, const DisparityPlane& plane, const RectifiedRig& rig,
                        double tolerance_m, Mask mask);

// Depth along the optical axis of each patch of obstacle pixels, 8-connected and of at least 100 px, as
// OpenCV labels them: that of its nearest tenth.
std::vector<double> obstacle_ranges(ConstMask mask, DisparityQ8 disparity, const RectifiedRig& rig);

// All of it for pictures of one size. Used by one thread.
class TerrainBaseline {
  public:
    struct Answer {
        std::optional<GroundPose> pose;  // none: no ground was found
        std::vector<double> obstacle_ranges_m;
        std::int64_t match_ns = 0;
        std::int64_t terrain_ns = 0;  // plane and threshold
    };

    TerrainBaseline(const RectifiedRig& rig, int min_disparity, int disparities, double tolerance_m);

    // One rectified pair. Without a ground the mask is all unknown.
    Answer run(ConstLuma left, ConstLuma right, Mask mask);

    static std::string parameters();

  private:
    RectifiedRig rig_;
    double tolerance_m_;
    std::unique_ptr<ComparedMatcher> matcher_;
    std::vector<std::uint16_t> disparity_;
};

}  // namespace groundline::cli
