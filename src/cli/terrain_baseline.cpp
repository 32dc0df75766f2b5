#include "cli/terrain_baseline.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "cli/plane_search.hpp"
#include "core/clock.hpp"
#include "core/parallel.hpp"
#include "rig/range.hpp"

namespace groundline::cli {
namespace {

constexpr const char* kMatcher = "sgbm_3way/filtered";
constexpr int kTrials = 500;
constexpr int kStep = 4;             // px between the points searched, both ways
constexpr double kOnPlane = 1.0;     // px
constexpr double kLeastShare = 0.1;  // of the points
constexpr int kLeastPatch = 100;     // px, as the matcher's own speckle test

const MatcherChoice& semi_global() {
    static const MatcherChoice choice = choose_matchers({kMatcher}).front();
    return choice;
}

std::vector<DisparityPoint> lower_half(DisparityQ8 disparity) {
    std::vector<DisparityPoint> points;
    for (int y = disparity.height / 2; y < disparity.height; y += kStep)
        for (int x = 0; x < disparity.width; x += kStep)
            if (disparity.at(x, y) != 0)
                points.push_back(
                    {static_cast<double>(x), static_cast<double>(y), disparity.at(x, y) / 256.0});
    return points;
}

std::size_t count_on(const DisparityPlane& plane, const std::vector<DisparityPoint>& points) {
    std::size_t on = 0;
    for (const DisparityPoint& point : points)
        on += std::abs(point.disparity - plane.at(point.u, point.v)) < kOnPlane ? 1U : 0U;
    return on;
}

}  // namespace

std::optional<DisparityPlane> ransac_ground(DisparityQ8 disparity, const RectifiedRig& rig) {
    assert(rig.calibrated);
    const std::vector<DisparityPoint> points = lower_half(disparity);
    if (points.size() < 50) return std::nullopt;
    PointPicker picker(points);
    std::optional<DisparityPlane> best;
    std::size_t most = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
        const DisparityPoint& a = picker.next();
        const DisparityPoint& b = picker.next();
        const DisparityPoint& c = picker.next();
        const std::optional<DisparityPlane> plane = plane_through(a, b, c);
        if (!plane || !possible_ground(*plane, rig)) continue;
        const std::size_t on = count_on(*plane, points);
        if (on > most) {
            most = on;
            best = plane;
        }
    }
    if (static_cast<double>(most) < kLeastShare * static_cast<double>(points.size())) return std::nullopt;
    for (int round = 0; round < 2 && best; ++round)
        best = refined_plane(*best, kOnPlane, Weight::kEqual, points);
    if (!best || !possible_ground(*best, rig)) return std::nullopt;
    return best;
}

void classify_by_height(DisparityQ8 disparity, const DisparityPlane& plane, const RectifiedRig& rig,
                        double tolerance_m, Mask mask) {
    assert(rig.calibrated && disparity.same_size(mask.width, mask.height));
    const double height_m = pose_of(plane, rig).height_m;
    for (int y = 0; y < mask.height; ++y)
        for (int x = 0; x < mask.width; ++x) {
            const double found = disparity.at(x, y) / 256.0 - rig.offset_px();
            mask.at(x, y) = TerrainClass::kUnknown;
            if (disparity.at(x, y) == 0 || found <= 0.0) continue;
            const double above = height_above_ground(height_m, plane.at(x, y) - rig.offset_px(), found);
            mask.at(x, y) = above > tolerance_m    ? TerrainClass::kObstacle
                            : above < -tolerance_m ? TerrainClass::kDrop
                                                   : TerrainClass::kTraversable;
        }
}

std::vector<double> obstacle_ranges(ConstMask mask, DisparityQ8 disparity, const RectifiedRig& rig) {
    cv::Mat1b obstacle(mask.height, mask.width);
    for (int y = 0; y < mask.height; ++y)
        for (int x = 0; x < mask.width; ++x)
            obstacle(y, x) = mask.at(x, y) == TerrainClass::kObstacle ? 255 : 0;
    cv::Mat1i labels;
    const int patches = cv::connectedComponents(obstacle, labels, 8, CV_32S);
    std::vector<std::vector<std::uint16_t>> found(static_cast<std::size_t>(patches));
    for (int y = 0; y < mask.height; ++y)
        for (int x = 0; x < mask.width; ++x)
            if (labels(y, x) > 0) found[static_cast<std::size_t>(labels(y, x))].push_back(disparity.at(x, y));
    std::vector<double> ranges;
    for (std::vector<std::uint16_t>& patch : found) {
        if (patch.size() < kLeastPatch) continue;
        const auto tenth = patch.begin() + static_cast<std::ptrdiff_t>(patch.size() / 10);
        std::nth_element(patch.begin(), tenth, patch.end(), std::greater<>());
        ranges.push_back(rig::depth_m(rig, *tenth / 256.0));
    }
    return ranges;
}

TerrainBaseline::TerrainBaseline(const RectifiedRig& rig, int min_disparity, int disparities,
                                 double tolerance_m)
    : rig_(rig),
      tolerance_m_(tolerance_m),
      disparity_(static_cast<std::size_t>(rig.width) * static_cast<std::size_t>(rig.height)) {
    Serial serial;  // OpenCV's matchers take no lanes
    matcher_ = semi_global().make({rig.width, rig.height, min_disparity, disparities, true}, serial);
}

TerrainBaseline::Answer TerrainBaseline::run(ConstLuma left, ConstLuma right, Mask mask) {
    const ImageView<std::uint16_t> disparity(disparity_.data(), rig_.width, rig_.height, rig_.width);
    Answer answer;
    const std::int64_t begin_ns = now_mono_ns();
    matcher_->match(left, right);
    const std::int64_t matched_ns = now_mono_ns();
    matcher_->answers(disparity);
    const std::int64_t ready_ns = now_mono_ns();
    const std::optional<DisparityPlane> plane = ransac_ground(disparity, rig_);
    if (plane)
        classify_by_height(disparity, *plane, rig_, tolerance_m_, mask);
    else
        fill_pixels(mask, TerrainClass::kUnknown);
    const std::int64_t end_ns = now_mono_ns();
    answer.match_ns = matched_ns - begin_ns;
    answer.terrain_ns = end_ns - ready_ns;
    if (plane) answer.pose = pose_of(*plane, rig_);
    answer.obstacle_ranges_m = obstacle_ranges(mask, disparity, rig_);
    return answer;
}

std::string TerrainBaseline::parameters() {
    return fmt::format(
        "{}; plane of {} draws from the lower half, within {} px, twice refined by least squares; height "
        "against the tolerance",
        semi_global().parameters, kTrials, kOnPlane);
}

}  // namespace groundline::cli
