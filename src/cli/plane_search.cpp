#include "cli/plane_search.hpp"

#include <array>
#include <cmath>

#include "core/deterministic_math.hpp"

namespace groundline::cli {
namespace {

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

}  // namespace

// The constants of Numerical Recipes' 64-bit linear congruential generator; the high bits are taken.
const DisparityPoint& PointPicker::next() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return points_[(state_ >> 33U) % points_.size()];
}

std::optional<DisparityPlane> plane_through(const DisparityPoint& a, const DisparityPoint& b,
                                            const DisparityPoint& c) {
    return solve({{{a.u, a.v, 1.0}, {b.u, b.v, 1.0}, {c.u, c.v, 1.0}}},
                 {a.disparity, b.disparity, c.disparity});
}

bool possible_ground(const DisparityPlane& plane, const RectifiedRig& rig) {
    const GroundPose pose = pose_of(plane, rig);
    return pose.height_m >= 0.2 && pose.height_m <= 2.5 && pose.pitch_rad >= det::radians(-5.0) &&
           pose.pitch_rad <= det::radians(40.0) && std::abs(pose.roll_rad) <= det::radians(12.0);
}

std::optional<DisparityPlane> refined_plane(const DisparityPlane& plane, double limit, Weight weight,
                                            const std::vector<DisparityPoint>& points) {
    std::array<std::array<double, 3>, 3> a{};
    std::array<double, 3> b{};
    for (const DisparityPoint& point : points) {
        const double residual = (point.disparity - plane.at(point.u, point.v)) / limit;
        if (std::abs(residual) >= 1.0) continue;
        const double root = weight == Weight::kTukey ? 1.0 - residual * residual : 1.0;
        const double counts = root * root;
        const std::array<double, 3> row = {point.u, point.v, 1.0};
        for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t j = 0; j < 3; ++j)
                a[i][j] += counts * row[i] * row[j];
            b[i] += counts * row[i] * point.disparity;
        }
    }
    return solve(a, b);
}

}  // namespace groundline::cli
