#include "stereo/census_matcher.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "stereo/census_kernels.hpp"
#include "stereo/median.hpp"
#include "stereo/window_sums.hpp"

namespace groundline::stereo {
namespace {

using kernels::CensusRow;
using kernels::cost_bytes;
using kernels::kWidestVector;

// Rows of an image kept with their borders repeated.
constexpr int kKeptRows = 8;
static_assert(kKeptRows > 2 * kCensusReachY);

// Copies a row and repeats its ends as far as a census reads.
void keep_row(const std::uint8_t* row, int width, bool mirrored, std::uint8_t* kept) {
    if (mirrored)
        kernels::mirror_row(row, width, kept);
    else
        std::memcpy(kept, row, static_cast<std::size_t>(width));
    std::memset(kept - kCensusReachX, kept[0], kCensusReachX);
    std::memset(kept + width, kept[width - 1], kCensusReachX);
}

}  // namespace

// Memory of one running task: 5 cost rows of width x disparities bytes, and some rows.
struct CensusMatcher::Lane {
    std::array<Luma, 2> kept;  // kKeptRows of the left view; of the right one, mirrored
    CensusRow left;
    CensusRow right;  // byte `right_margin` + j: column width - 1 - j
    std::ptrdiff_t right_margin = 0;
    std::span<std::uint8_t> above, here, down, smoothed, sums, down_best;
    kernels::CensusWinners winners{};
    std::uint8_t* at_right = nullptr;  // one row
    WindowColumns window_columns;

    Lane(const MatcherConfig& config, int width, Arena& arena) {
        for (Luma& rows : kept)
            rows = arena.image<std::uint8_t>(2 * kWidestVector + width, kKeptRows);
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

CensusMatcher::CensusMatcher(const MatcherConfig& config, int width, int height, int lanes, Arena& arena)
    : config_(config), width_(width), height_(height) {
    const std::size_t before = arena.bytes();
    lanes_.reserve(static_cast<std::size_t>(lanes));
    for (int lane = 0; lane < std::min(lanes, band_count(height)); ++lane)
        lanes_.emplace_back(config, width, arena);
    if (config.checks && config.limits.speckle_px > 0) speckles_ = SpeckleScratch(width, arena);
    if (config.checks && config.limits.median)
        median_rows_ = arena.take<std::int16_t>(2 * static_cast<std::size_t>(width));
    state_bytes_ = arena.bytes() - before;
}

CensusMatcher::~CensusMatcher() = default;

void CensusMatcher::match(ConstLuma left, ConstLuma right, const DisparityMap& out, Parallel& parallel) {
    assert(left.same_size(width_, height_) && right.same_size(width_, height_));
    assert(out.disparity_q4.same_size(width_, height_) && out.invalid.same_size(width_, height_));
    parallel.for_each(band_count(height_), [&](int number, int lane) {
        match_band(left, right, number, lanes_[static_cast<std::size_t>(lane)], out);
    });
    if (!speckles_.patches.empty()) remove_speckles(out, config_.limits.speckle_px, speckles_);
    if (!median_rows_.empty()) median_3x3(out, median_rows_);
}

void CensusMatcher::match_band(ConstLuma left, ConstLuma right, int number, Lane& lane,
                               const DisparityMap& out) const {
    const Band band = band_of(height_, number);
    int kept_to = std::max(0, band.start - 1 - kCensusReachY);  // first row not yet kept
    // Leaves the census of row y (clamped to the image) in lane.left and lane.right.
    const auto take_census = [&](int y) {
        y = std::clamp(y, 0, height_ - 1);
        for (; kept_to <= std::min(y + kCensusReachY, height_ - 1); ++kept_to) {
            keep_row(left.row(kept_to), width_, false, lane.kept[0].row(kept_to % kKeptRows) + kWidestVector);
            keep_row(right.row(kept_to), width_, true, lane.kept[1].row(kept_to % kKeptRows) + kWidestVector);
        }
        for (const bool mirrored : {false, true}) {
            std::array<const std::uint8_t*, 2 * kCensusReachY + 1> rows;
            for (int j = 0; j < static_cast<int>(rows.size()); ++j)
                rows[static_cast<std::size_t>(j)] =
                    lane.kept[mirrored ? 1 : 0].row(std::clamp(y + j - kCensusReachY, 0, height_ - 1) %
                                                    kKeptRows) +
                    kWidestVector;
            if (!mirrored) {
                kernels::census_row(rows, width_, false, lane.left);
                continue;
            }
            const CensusRow words{lane.right.low + lane.right_margin, lane.right.high + lane.right_margin};
            kernels::census_row(rows, width_, true, words);
            const auto behind = static_cast<std::size_t>(std::max(0, config_.min_disparity) +
                                                         cost_bytes(config_.disparities));
            for (std::uint8_t* plane : {words.low, words.high}) {
                std::memset(plane - lane.right_margin, plane[0], static_cast<std::size_t>(lane.right_margin));
                std::memset(plane + width_, plane[width_ - 1], behind);
            }
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
        if (config_.checks)
            judge_windows(left, left, y, y == band.first, limits, lane.window_columns, invalid);
        kernels::census_answer_row(answer, lane.winners, out.disparity_q4.row(y), invalid);
    }
}

}  // namespace groundline::stereo
