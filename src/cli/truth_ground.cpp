#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "cli/evaluation.hpp"
#include "core/deterministic_math.hpp"

namespace groundline::cli {
namespace {

struct Point {
    double u;
    double v;
    double disparity;  // measured
};

constexpr std::size_t kSearchPoints = 4000;  // of all, evenly, while searching
constexpr int kTrials = 1500;                // 0.2^3 of them hit three ground points where a fifth is ground
constexpr double kNearPlane = 1.0;           // px: on the plane while searching
constexpr double kLeastShare = 0.2;          // of the points under the horizon

// Only what will be judged: far away, every disparity is within a pixel of any ground.
std::vector<Point> points_of(DisparityQ8 truth, const RectifiedRig& rig) {
    const double least = rig.focal_px * rig.baseline_m / kJudgedRange + rig.offset_px();
    std::vector<Point> points;
    for (int y = 0; y < truth.height; ++y)
        for (int x = 0; x < truth.width; ++x)
            if (truth.at(x, y) != 0 && truth.at(x, y) / 256.0 >= least)
                points.push_back({static_cast<double>(x), static_cast<double>(y), truth.at(x, y) / 256.0});
    return points;
}

std::vector<Point> thinned(const std::vector<Point>& points) {
    const std::size_t step = std::max<std::size_t>(1, points.size() / kSearchPoints);
    std::vector<Point> few;
    for (std::size_t i = 0; i < points.size(); i += step)
        few.push_back(points[i]);
    return few;
}

// x of the symmetric 3x3 system A x = b by Cramer's rule; nothing where A is singular.
std::optional<DisparityPlane> solve(const std::array<std::array<double, 3>, 3>& a,
                                    const std::array<double, 3>& b) {
    const auto minor = [&](int r, int c) {
        const auto at = [&](int i, int j) {
            return a[static_cast<std::size_t>((r + i) % 3)][static_cast<std::size_t>((c + j) % 3)];
        };
        return at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1);
    };
    const double determinant = a[0][0] * minor(0, 0) + a[0][1] * minor(0, 1) + a[0][2] * minor(0, 2);
    if (!(std::abs(determinant) > 1e-9)) return std::nullopt;
    std::array<double, 3> x{};
    for (int column = 0; column < 3; ++column) {
        for (int row = 0; row < 3; ++row)
            x[static_cast<std::size_t>(column)] += minor(row, column) * b[static_cast<std::size_t>(row)];
        x[static_cast<std::size_t>(column)] /= determinant;
    }
    return DisparityPlane{x[0], x[1], x[2]};
}

std::optional<DisparityPlane> through(const Point& a, const Point& b, const Point& c) {
    return solve({{{a.u, a.v, 1.0}, {b.u, b.v, 1.0}, {c.u, c.v, 1.0}}},
                 {a.disparity, b.disparity, c.disparity});
}

bool possible(const DisparityPlane& plane, const RectifiedRig& rig) {
    const GroundPose pose = pose_of(plane, rig);
    return pose.height_m >= 0.2 && pose.height_m <= 2.5 && pose.pitch_rad >= det::radians(-5.0) &&
           pose.pitch_rad <= det::radians(40.0) && std::abs(pose.roll_rad) <= det::radians(12.0);
}

// Points on the plane, less those clearly under it: nothing is seen through the ground.
std::int64_t support(const DisparityPlane& plane, const std::vector<Point>& points) {
    std::int64_t votes = 0;
    for (const Point& point : points) {
        const double above = point.disparity - plane.at(point.u, point.v);
        if (std::abs(above) <= kNearPlane)
            ++votes;
        else if (above < -3.0 * kNearPlane)
            --votes;
    }
    return votes;
}

// Least squares with Tukey's weights (1 - (r/limit)^2)^2.
std::optional<DisparityPlane> refined(const DisparityPlane& plane, double limit,
                                      const std::vector<Point>& points) {
    std::array<std::array<double, 3>, 3> a{};
    std::array<double, 3> b{};
    for (const Point& point : points) {
        const double residual = (point.disparity - plane.at(point.u, point.v)) / limit;
        if (std::abs(residual) >= 1.0) continue;
        const double root = 1.0 - residual * residual;
        const double weight = root * root;
        const std::array<double, 3> row = {point.u, point.v, 1.0};
        for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t j = 0; j < 3; ++j)
                a[i][j] += weight * row[i] * row[j];
            b[i] += weight * row[i] * point.disparity;
        }
    }
    return solve(a, b);
}

}  // namespace

std::optional<DisparityPlane> fit_ground(DisparityQ8 truth, const RectifiedRig& rig) {
    const std::vector<Point> points = points_of(truth, rig);
    const std::vector<Point> few = thinned(points);
    if (few.size() < 50) return std::nullopt;

    // The constants of Numerical Recipes' 64-bit linear congruential generator; the high bits are taken.
    std::uint64_t state = 1;
    const auto pick = [&]() -> const Point& {
        state = state * 6364136223846793005ULL + 1442695040888963407ULL;
        return few[(state >> 33U) % few.size()];
    };
    std::optional<DisparityPlane> best;
    std::int64_t most = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
        const Point& a = pick();
        const Point& b = pick();
        const Point& c = pick();
        const std::optional<DisparityPlane> plane = through(a, b, c);
        if (!plane || !possible(*plane, rig)) continue;
        const std::int64_t votes = support(*plane, few);
        if (votes > most) {
            most = votes;
            best = plane;
        }
    }
    for (const double limit : {3.0, 2.0, 1.5, 1.5, 1.5}) {
        if (best) best = refined(*best, limit, points);
    }
    if (!best || !possible(*best, rig)) return std::nullopt;

    std::int64_t below_horizon = 0;
    std::int64_t on = 0;
    for (const Point& point : points) {
        const double ground = best->at(point.u, point.v);
        if (ground <= rig.offset_px()) continue;
        ++below_horizon;
        on += std::abs(point.disparity - ground) <= 1.5 ? 1 : 0;
    }
    if (static_cast<double>(on) < kLeastShare * static_cast<double>(below_horizon)) return std::nullopt;
    return best;
}

}  // namespace groundline::cli
