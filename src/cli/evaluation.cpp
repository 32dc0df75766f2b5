#include "cli/evaluation.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>

#include "core/deterministic_math.hpp"

namespace groundline::cli {
namespace {

constexpr int kOnePx = 256;
constexpr int kHeightZero = 32768;  // stored height of the ground

TerrainClass label_of_height(double height_m) {
    if (height_m > kObstacleAbove) return TerrainClass::kObstacle;
    if (height_m < -kObstacleAbove) return TerrainClass::kDrop;
    return std::abs(height_m) < kGroundWithin ? TerrainClass::kTraversable : TerrainClass::kUnknown;
}

double metres(std::uint16_t stored_mm) {
    return (static_cast<int>(stored_mm) - kHeightZero) / 1000.0;
}

}  // namespace

void score_disparity(DisparityQ8 truth, DisparityQ8 result, ConstLuma occluded, DisparityScore& score) {
    assert(result.same_size(truth.width, truth.height));
    assert(occluded.empty() || occluded.same_size(truth.width, truth.height));
    for (int y = 0; y < truth.height; ++y) {
        for (int x = 0; x < truth.width; ++x) {
            const int wanted = truth.at(x, y);
            if (wanted == 0) continue;
            if (!occluded.empty() && occluded.at(x, y) != 0) {
                ++score.occluded;
                continue;
            }
            ++score.scored;
            const int got = result.at(x, y);
            if (got == 0) continue;
            ++score.answered;
            const int error = std::abs(got - wanted);
            score.error_q8 += error;
            if (error > kOnePx) ++score.bad1;
            if (error > 3 * kOnePx) ++score.bad3;
        }
    }
}

void mark_occluded(DisparityQ8 truth, Luma occluded) {
    assert(occluded.same_size(truth.width, truth.height));
    std::vector<int> nearest(static_cast<std::size_t>(truth.width));  // largest disparity on each right pixel
    for (int y = 0; y < truth.height; ++y) {
        std::fill(nearest.begin(), nearest.end(), 0);
        const auto take = [&](int column, int disparity) {
            if (column < 0 || column >= truth.width) return;
            int& there = nearest[static_cast<std::size_t>(column)];
            there = std::max(there, disparity);
        };
        for (int x = 0; x < truth.width; ++x) {
            const int disparity = truth.at(x, y);
            if (disparity == 0) continue;
            const int right = kOnePx * x - disparity;  // a point between two pixels covers part of both
            if (right < 0) continue;
            take(right / kOnePx, disparity);
            take((right + kOnePx - 1) / kOnePx, disparity);
        }
        for (int x = 0; x < truth.width; ++x) {
            const int disparity = truth.at(x, y);
            const int right = kOnePx * x - disparity;
            bool hidden = false;
            if (disparity != 0) {
                hidden = right < 0 || nearest[static_cast<std::size_t>((right + kOnePx / 2) / kOnePx)] >=
                                          disparity + kOnePx;
            }
            occluded.at(x, y) = hidden ? 255 : 0;
        }
    }
}

void label_by_class(ConstLuma classes, ConstImageView<std::uint16_t> height_mm, Mask labels) {
    assert(classes.same_size(labels.width, labels.height));
    assert(height_mm.empty() || height_mm.same_size(labels.width, labels.height));
    for (int y = 0; y < labels.height; ++y) {
        for (int x = 0; x < labels.width; ++x) {
            const std::uint8_t id = classes.at(x, y);
            auto label = id < kTerrainClasses ? static_cast<TerrainClass>(id) : TerrainClass::kUnknown;
            if (!height_mm.empty() && label != TerrainClass::kDrop &&
                label_of_height(metres(height_mm.at(x, y))) != label)
                label = TerrainClass::kUnknown;
            labels.at(x, y) = label;
        }
    }
}

void label_by_height(ConstImageView<std::uint16_t> height_mm, Mask labels) {
    assert(height_mm.same_size(labels.width, labels.height));
    for (int y = 0; y < labels.height; ++y)
        for (int x = 0; x < labels.width; ++x)
            labels.at(x, y) = label_of_height(metres(height_mm.at(x, y)));
}

void label_by_disparity(DisparityQ8 truth, const DisparityPlane& plane, const RectifiedRig& rig,
                        Mask labels) {
    assert(rig.calibrated && truth.same_size(labels.width, labels.height));
    const double height_m = pose_of(plane, rig).height_m;
    for (int y = 0; y < labels.height; ++y) {
        for (int x = 0; x < labels.width; ++x) {
            const double disparity = truth.at(x, y) / 256.0 - rig.offset_px();
            TerrainClass& label = labels.at(x, y);
            label = TerrainClass::kUnknown;
            if (truth.at(x, y) == 0 || disparity <= 0.0) continue;
            const double ground = plane.at(x, y) - rig.offset_px();
            const TerrainClass found = label_of_height(height_above_ground(height_m, ground, disparity));
            if (found != TerrainClass::kDrop) label = found;
        }
    }
    limit_range(truth, rig, labels);
}

void limit_range(DisparityQ8 truth, const RectifiedRig& rig, Mask labels) {
    assert(rig.calibrated && truth.same_size(labels.width, labels.height));
    const double least = rig.focal_px * rig.baseline_m / kJudgedRange + rig.offset_px();
    for (int y = 0; y < labels.height; ++y)
        for (int x = 0; x < labels.width; ++x)
            if (truth.at(x, y) == 0 || truth.at(x, y) / 256.0 < least)
                labels.at(x, y) = TerrainClass::kUnknown;
}

void score_terrain(ConstMask labels, ConstMask mask, TerrainScore& score) {
    assert(mask.same_size(labels.width, labels.height));
    for (int y = 0; y < labels.height; ++y) {
        for (int x = 0; x < labels.width; ++x) {
            const TerrainClass shown = mask.at(x, y);
            switch (labels.at(x, y)) {
                case TerrainClass::kObstacle:
                    ++score.obstacle;
                    score.obstacle_found += shown == TerrainClass::kObstacle ? 1 : 0;
                    score.obstacle_free += shown == TerrainClass::kTraversable ? 1 : 0;
                    break;
                case TerrainClass::kTraversable:
                    ++score.ground;
                    score.ground_known += shown != TerrainClass::kUnknown ? 1 : 0;
                    score.ground_alarmed +=
                        shown == TerrainClass::kObstacle || shown == TerrainClass::kDrop ? 1 : 0;
                    break;
                case TerrainClass::kDrop:
                    ++score.drop;
                    score.drop_found += shown == TerrainClass::kDrop ? 1 : 0;
                    score.drop_free += shown == TerrainClass::kTraversable ? 1 : 0;
                    break;
                case TerrainClass::kUnknown:
                    break;
            }
        }
    }
}

void score_pose(const GroundPose& found, const GroundPose& truth, PoseScore& score) {
    ++score.frames;
    const auto add = [](double difference, double& sum, double& most) {
        sum += std::abs(difference);
        most = std::max(most, std::abs(difference));
    };
    add(found.pitch_rad - truth.pitch_rad, score.sum.pitch_rad, score.most.pitch_rad);
    add(found.roll_rad - truth.roll_rad, score.sum.roll_rad, score.most.roll_rad);
    add(found.height_m / truth.height_m - 1.0, score.sum.height_m, score.most.height_m);
}

}  // namespace groundline::cli
