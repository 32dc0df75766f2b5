#include "pipeline/half_stages.hpp"

#include <algorithm>

#include "core/half_size.hpp"
#include "stereo/halve.hpp"
#include "stereo/pyramid.hpp"
#include "terrain/v_disparity.hpp"

namespace groundline::pipeline {

StagesConfig halved(const StagesConfig& config) {
    StagesConfig half = config;
    const stereo::CoarseRange range =
        stereo::coarse_range(config.matcher.min_disparity, config.matcher.disparities);
    if (config.matcher.kind == stereo::MatcherKind::kCensusPyramid)
        half.matcher.kind = stereo::MatcherKind::kCensus;
    half.matcher.min_disparity = range.min_disparity;
    half.matcher.disparities = range.disparities;
    terrain::TerrainConfig& terrain = half.terrain;
    terrain.min_pixels_far =
        std::min(terrain.min_pixels_far, std::max(terrain.min_pixels, (terrain.min_pixels_far + 3) / 4));
    return half;
}

namespace {

constexpr int kRowsPerTask = 16;

// Marked where any pixel that it stands for is.
ConstImageView<std::uint8_t> halved(ConstImageView<std::uint8_t> marked, Arena& arena) {
    if (marked.empty()) return {};
    const auto half =
        arena.image<std::uint8_t>(groundline::halved(marked.width), groundline::halved(marked.height));
    for (int y = 0; y < marked.height; ++y)
        for (int x = 0; x < marked.width; ++x)
            if (marked.at(x, y) != 0) half.at(x / 2, y / 2) = 1;
    return half;
}

Unusable halved(const Unusable& unusable, Arena& arena) {
    return {halved(unusable.outside_left, arena), halved(unusable.outside_right, arena),
            halved(unusable.body, arena)};
}

}  // namespace

HalfStages::HalfStages(const StagesConfig& config, const RectifiedRig& rig, const Unusable& unusable,
                       int lanes, Arena& arena)
    : stages(halved(config), groundline::halved(rig), rig, halved(unusable, arena), lanes, arena) {
    const int width = groundline::halved(rig.width);
    const int height = groundline::halved(rig.height);
    left = arena.image<std::uint8_t>(width, height);
    right = arena.image<std::uint8_t>(width, height);
    disparity = DisparityMap::make(arena, width, height);
    mask = arena.image<TerrainClass>(width, height);
    v_disparity = terrain::make_v_disparity(arena, height, stages.matcher->min_disparity(),
                                            stages.matcher->disparities());
}

void HalfStages::halve(ConstLuma whole_left, ConstLuma whole_right, Parallel& parallel) {
    const int tasks = (left.height + kRowsPerTask - 1) / kRowsPerTask;
    parallel.for_each(tasks, [&](int task, int) {
        const int last = std::min(left.height, (task + 1) * kRowsPerTask);
        stereo::halve_rows(whole_left, task * kRowsPerTask, last, left);
        stereo::halve_rows(whole_right, task * kRowsPerTask, last, right);
    });
}

void HalfStages::deliver(FrameResult& result, Parallel& parallel) const {
    const auto same = [](auto value) { return value; };
    double_pixels<std::int16_t>(disparity.disparity_q4, result.disparity.disparity_q4, parallel,
                                [](std::int16_t value) { return static_cast<std::int16_t>(2 * value); });
    double_pixels<Invalid>(disparity.invalid, result.disparity.invalid, parallel, same);
    double_pixels<TerrainClass>(mask, result.mask, parallel, same);
    terrain::build_v_disparity(result.disparity, result.v_disparity, parallel);
    for (Obstacle& obstacle : result.obstacles) {
        obstacle.left *= 2;
        obstacle.top *= 2;
        obstacle.right = std::min(2 * obstacle.right + 1, result.mask.width - 1);
        obstacle.bottom = std::min(2 * obstacle.bottom + 1, result.mask.height - 1);
        obstacle.pixels *= 4;
        obstacle.disparity_px *= 2.0;
    }
}

}  // namespace groundline::pipeline
