#include "stereo/paper_reference.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>

#include "core/deterministic_math.hpp"

namespace groundline::stereo {
namespace {

// One plane of costs at constant disparity.
struct Plane {
    int width;
    int height;
    std::vector<double> values;

    Plane(int w, int h)
        : width(w), height(h), values(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}
    double& at(int x, int y) { return values[static_cast<std::size_t>(y * width + x)]; }
    double clamped(int x, int y) const {
        return values[static_cast<std::size_t>(std::clamp(y, 0, height - 1) * width +
                                               std::clamp(x, 0, width - 1))];
    }
};

std::vector<double> weights(Window window) {
    constexpr double kReach = kWindowReach;
    const double sigma = (window == Window::kGauss55 ? kReach + 0.5 : kReach) / 3.0;
    std::vector<double> axis;
    double sum = 0.0;
    for (int i = -kWindowReach; i <= kWindowReach; ++i) {
        axis.push_back(window == Window::kBox ? 1.0 : det::exp(-i * i / (2.0 * sigma * sigma)));
        sum += axis.back();
    }
    for (double& weight : axis)
        weight /= sum;
    return axis;
}

// A Gaussian of the Euclidean distance is the product of one along x and one along y.
Plane aggregate(const Plane& costs, const std::vector<double>& axis) {
    const auto pass = [&](const Plane& from, int dx, int dy) {
        Plane to(from.width, from.height);
        for (int y = 0; y < from.height; ++y)
            for (int x = 0; x < from.width; ++x)
                for (int i = -kWindowReach; i <= kWindowReach; ++i)
                    to.at(x, y) += axis[static_cast<std::size_t>(i + kWindowReach)] *
                                   from.clamped(x + i * dx, y + i * dy);
        return to;
    };
    return pass(pass(costs, 1, 0), 0, 1);
}

bool near(double other, double cost) {
    return std::fabs(other - cost) < cost / 2.0;
}

Plane rule_one(const std::vector<Plane>& volume, std::size_t k, RuleOne rule) {
    const Plane& here = volume[k];
    Plane result = here;
    if (rule == RuleOne::kOff) return result;
    for (int y = 0; y < here.height; ++y)
        for (int x = 0; x < here.width; ++x) {
            const double cost = here.clamped(x, y);
            const bool consistent = (k > 0 && near(volume[k - 1].clamped(x, y), cost)) ||
                                    (k + 1 < volume.size() && near(volume[k + 1].clamped(x, y), cost));
            if (!consistent) continue;
            double sum = 0.0;
            for (int j = -1; j <= 1; ++j)
                for (int i = -1; i <= 1; ++i)
                    sum += here.clamped(x + i, y + j);
            result.at(x, y) = rule == RuleOne::kMean9 ? sum / 9.0 : sum;
        }
    return result;
}

Plane rule_two(const Plane& costs, const Plane& looked_at, RuleTwo rule) {
    Plane result = costs;
    if (rule == RuleTwo::kOff) return result;
    for (int y = 0; y < costs.height; ++y)
        for (int x = 0; x < costs.width; ++x) {
            const double cost = looked_at.clamped(x, y);
            int supporters = 0;
            for (int j = -1; j <= 1; ++j)
                for (int i = -1; i <= 1; ++i) {
                    if (i == 0 && j == 0 && rule == RuleTwo::kSevenOfEight) continue;
                    if (near(looked_at.clamped(x + i, y + j), cost)) ++supporters;
                }
            if (supporters >= 7) result.at(x, y) = costs.clamped(x, y) / 1.3;
        }
    return result;
}

}  // namespace

std::vector<int> match_paper_reference(ConstLuma left, ConstLuma right, int min_disparity, int disparities,
                                       const PaperReading& reading, double truncation) {
    const int width = left.width;
    const int height = left.height;
    const std::vector<double> axis = weights(reading.window);
    std::vector<Plane> volume;
    for (int k = 0; k < disparities; ++k) {
        Plane costs(width, height);
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const int match = x - min_disparity - k;
                const bool outside = match < 0 || match >= width;
                costs.at(x, y) =
                    outside ? truncation
                            : std::min<double>(truncation, std::abs(left.at(x, y) - right.at(match, y)));
            }
        volume.push_back(aggregate(costs, axis));
    }
    std::vector<int> best(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), min_disparity);
    std::vector<double> lowest;
    for (std::size_t k = 0; k < volume.size(); ++k) {
        const Plane after_one = rule_one(volume, k, reading.rule_one);
        const Plane enhanced =
            rule_two(after_one, reading.rules_at_once ? volume[k] : after_one, reading.rule_two);
        if (k == 0) lowest = enhanced.values;
        for (std::size_t i = 0; i < best.size(); ++i) {
            if (!(enhanced.values[i] < lowest[i])) continue;
            lowest[i] = enhanced.values[i];
            best[i] = min_disparity + static_cast<int>(k);
        }
    }
    return best;
}

}  // namespace groundline::stereo
