#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "cli/evaluation.hpp"
#include "cli/plane_search.hpp"

namespace groundline::cli {
namespace {

constexpr std::size_t kSearchPoints = 4000;  // of all, evenly, while searching
constexpr int kTrials = 1500;                // 0.2^3 of them hit three ground points where a fifth is ground
constexpr double kNearPlane = 1.0;           // px: on the plane while searching
constexpr double kLeastShare = 0.2;          // of the points under the horizon

// Only what will be judged: far away, every disparity is within a pixel of any ground.
std::vector<DisparityPoint> points_of(DisparityQ8 truth, const RectifiedRig& rig) {
    const double least = rig.focal_px * rig.baseline_m / kJudgedRange + rig.offset_px();
    std::vector<DisparityPoint> points;
    for (int y = 0; y < truth.height; ++y)
        for (int x = 0; x < truth.width; ++x)
            if (truth.at(x, y) != 0 && truth.at(x, y) / 256.0 >= least)
                points.push_back({static_cast<double>(x), static_cast<double>(y), truth.at(x, y) / 256.0});
    return points;
}

std::vector<DisparityPoint> thinned(const std::vector<DisparityPoint>& points) {
    const std::size_t step = std::max<std::size_t>(1, points.size() / kSearchPoints);
    std::vector<DisparityPoint> few;
    for (std::size_t i = 0; i < points.size(); i += step)
        few.push_back(points[i]);
    return few;
}

// Points on the plane, less those clearly under it: nothing is seen through the ground.
std::int64_t support(const DisparityPlane& plane, const std::vector<DisparityPoint>& points) {
    std::int64_t votes = 0;
    for (const DisparityPoint& point : points) {
        const double above = point.disparity - plane.at(point.u, point.v);
        if (std::abs(above) <= kNearPlane)
            ++votes;
        else if (above < -3.0 * kNearPlane)
            --votes;
    }
    return votes;
}

}  // namespace

std::optional<DisparityPlane> fit_ground(DisparityQ8 truth, const RectifiedRig& rig) {
    const std::vector<DisparityPoint> points = points_of(truth, rig);
    const std::vector<DisparityPoint> few = thinned(points);
    if (few.size() < 50) return std::nullopt;

    PointPicker picker(few);
    std::optional<DisparityPlane> best;
    std::int64_t most = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
        const DisparityPoint& a = picker.next();
        const DisparityPoint& b = picker.next();
        const DisparityPoint& c = picker.next();
        const std::optional<DisparityPlane> plane = plane_through(a, b, c);
        if (!plane || !possible_ground(*plane, rig)) continue;
        const std::int64_t votes = support(*plane, few);
        if (votes > most) {
            most = votes;
            best = plane;
        }
    }
    for (const double limit : {3.0, 2.0, 1.5, 1.5, 1.5}) {
        if (best) best = refined_plane(*best, limit, Weight::kTukey, points);
    }
    if (!best || !possible_ground(*best, rig)) return std::nullopt;

    std::int64_t below_horizon = 0;
    std::int64_t on = 0;
    for (const DisparityPoint& point : points) {
        const double ground = best->at(point.u, point.v);
        if (ground <= rig.offset_px()) continue;
        ++below_horizon;
        on += std::abs(point.disparity - ground) <= 1.5 ? 1 : 0;
    }
    if (static_cast<double>(on) < kLeastShare * static_cast<double>(below_horizon)) return std::nullopt;
    return best;
}

}  // namespace groundline::cli
