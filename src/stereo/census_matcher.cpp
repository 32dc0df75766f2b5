#include "stereo/census_matcher.hpp"

#include <algorithm>
#include <cassert>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "stereo/census_kernels.hpp"
#include "stereo/census_rows.hpp"
#include "stereo/median.hpp"
#include "stereo/window_sums.hpp"

namespace groundline::stereo {
namespace {

using kernels::CensusRow;
using kernels::cost_bytes;
using kernels::kWidestVector;

}  // namespace

// Memory of one running task: 5 cost rows of width x disparities bytes, and some rows.
struct CensusMatcher::Lane {
    CensusRows left_rows;
    CensusRows right_rows;
    CensusRow left;
    CensusRow right;  // byte `right_margin` + j: column width - 1 - j
    std::ptrdiff_t right_margin = 0;
    std::span<std::uint8_t> above, here, down, smoothed, sums, down_best;
    kernels::CensusWinners winners{};
    std::uint8_t* at_right = nullptr;  // one row
    WindowColumns window_columns;

    Lane(const MatcherConfig& config, int width, Arena& arena) {
        left_rows = CensusRows(width, false, arena);
        right_rows = CensusRows(width, true, arena);
        const auto row = [&](int bytes) {
            return arena.take<std::uint8_t>(static_cast<std::size_t>(bytes + kWidestVector)).data();
        };
        left = {row(width), row(width)};
        right_margin = std::max(0, -config.min_disparity);
        const int reach = width + std::abs(config.min_disparity) + cost_bytes(config.disparities);
        right = {row(reach), row(reach)};
        const std::size_t costs =
            static_cast<std::size_t>(width) * static_cast<std::size_t>(cost_bytes(config.disparities));
        for (auto* plane : {&above, &here, &down, &smoothed, &sums})
            *plane = arena.take<std::uint8_t>(costs);
        down_best = arena.take<std::uint8_t>(static_cast<std::size_t>(width));
        winners.index = row(width);
        winners.best = row(width);
        winners.lower = row(width);
        winners.upper = row(width);
        if (config.checks && config.limits.uniqueness_percent >= 0) winners.second = row(width);
        at_right = row(width);
        winners.at_right =
            arena.take<std::uint16_t>(static_cast<std::size_t>(width + config.disparities)).data();
        if (config.checks) window_columns = WindowColumns(width, arena);
    }
};

CensusMatcher::CensusMatcher(const MatcherConfig& config, int width, int height, int lanes, Arena& arena,
                             Use use)
    : config_(resolved(config)), coarse_(use == Use::kCoarse), width_(width), height_(height) {
    if (coarse_) {
        config_.limits.speckle_px = 0;
        config_.limits.alike_percent = 0;
        config_.limits.median = false;
    }
    const std::size_t before = arena.bytes();
    lanes_.reserve(static_cast<std::size_t>(lanes));
    for (int lane = 0; lane < lanes; ++lane)
        lanes_.emplace_back(config_, width, arena);
    if (config_.checks && judges_patches(config_.limits)) speckles_ = SpeckleScratch(width, arena);
    if (config_.checks && config_.limits.median)
        median_rows_ = arena.take<std::int16_t>(2 * static_cast<std::size_t>(width));
    state_bytes_ = arena.bytes() - before;
}

CensusMatcher::~CensusMatcher() = default;

void CensusMatcher::match(ConstLuma left, ConstLuma right, const DisparityMap& out, Parallel& parallel) {
    assert(left.same_size(width_, height_) && right.same_size(width_, height_));
    assert(out.disparity_q4.same_size(width_, height_) && out.invalid.same_size(width_, height_));
    assert(static_cast<std::size_t>(parallel.lanes()) <= lanes_.size());
    parallel.for_each(band_count(height_), [&](int number, int lane) {
        match_band(left, right, number, lanes_[static_cast<std::size_t>(lane)], out);
    });
    if (!speckles_.patches.empty())
        remove_speckles(out, left, right, {config_.limits.speckle_px, config_.limits.alike_percent},
                        speckles_);
    if (!median_rows_.empty()) median_3x3(out, median_rows_);
}

void CensusMatcher::match_band(ConstLuma left, ConstLuma right, int number, Lane& lane,
                               const DisparityMap& out) const {
    const Band band = band_of(height_, number);
    lane.left_rows.restart();
    lane.right_rows.restart();
    // Leaves the census of row y (clamped to the image) in lane.left and lane.right.
    const auto take_census = [&](int y) {
        y = std::clamp(y, 0, height_ - 1);
        lane.left_rows.take(left, y, lane.left);
        const CensusRow words{lane.right.low + lane.right_margin, lane.right.high + lane.right_margin};
        lane.right_rows.take(right, y, words);
        const auto behind =
            static_cast<std::size_t>(std::max(0, config_.min_disparity) + cost_bytes(config_.disparities));
        for (std::uint8_t* plane : {words.low, words.high}) {
            std::memset(plane - lane.right_margin, plane[0], static_cast<std::size_t>(lane.right_margin));
            std::memset(plane + width_, plane[width_ - 1], behind);
        }
    };
    const std::ptrdiff_t shift = lane.right_margin + config_.min_disparity;
    std::uint8_t* above = lane.above.data();
    std::uint8_t* here = lane.here.data();
    kernels::CensusStep step{.width = width_,
                             .disparities = config_.disparities,
                             .left = lane.left,
                             .right = {lane.right.low + shift, lane.right.high + shift},
                             .above = above,
                             .here = here,
                             .down = lane.down.data(),
                             .down_best = lane.down_best.data(),
                             .smoothed = lane.smoothed.data(),
                             .sums = lane.sums.data(),
                             .start = true,
                             .answer = false};
    const CheckLimits& limits = config_.limits;
    const kernels::CensusAnswer answer{.width = width_,
                                       .min_disparity = config_.min_disparity,
                                       .disparities = config_.disparities,
                                       .subpixel = limits.subpixel,
                                       .checks = config_.checks,
                                       .keep = coarse_,
                                       .uniqueness_percent = limits.uniqueness_percent,
                                       .left_right_px = limits.left_right_px,
                                       .at_right = lane.at_right};
    take_census(band.start - 1);
    kernels::census_costs_row(step, above);
    take_census(band.start);
    kernels::census_costs_row(step, here);
    for (int y = band.start; y < band.last; ++y) {
        take_census(y + 1);
        step.above = above;
        step.here = here;
        step.start = y == band.start;
        step.answer = y >= band.first;
        kernels::census_step(step, lane.winners);
        std::swap(above, here);
        if (!step.answer) continue;
        Invalid* const invalid = out.invalid.row(y);
        if (coarse_)
            std::fill_n(invalid, width_, Invalid::kNone);
        else if (config_.checks)
            judge_windows(left, left, y, y == band.first, limits, lane.window_columns, invalid);
        kernels::census_answer_row(answer, lane.winners, out.disparity_q4.row(y), invalid);
    }
}

}  // namespace groundline::stereo
