#include "stereo/pyramid_matcher.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstring>

#include "stereo/census_rows.hpp"
#include "stereo/halve.hpp"
#include "stereo/median.hpp"
#include "stereo/pyramid.hpp"
#include "stereo/pyramid_kernels.hpp"
#include "stereo/window_sums.hpp"

namespace groundline::stereo {
namespace {

using kernels::CensusPair;
using kernels::kBlock;
using kernels::kBlockMargin;
using kernels::kFineRows;
using kernels::kWidestVector;

constexpr int kThinRowsBefore = kThinRows / 2;
constexpr int kPartRows = 128;  // rows that one task finishes; a multiple of kFineRows and of kThinStep
constexpr int kPartThinRows = kPartRows / kThinStep;
static_assert(kPartRows % kFineRows == 0 && kPartThinRows <= kernels::kMostThinRows);
// Rows of census words that a task holds: all it looks at in the thin search, or a strip and its windows.
constexpr int kHeldRows = kPartThinRows + kThinRows - 1;
static_assert(kHeldRows >= kFineRows + 2 * kFineWindowReach);

int whole_blocks(int width) {
    return (width + kBlock - 1) / kBlock * kBlock;
}

CoarseRange range_of(const MatcherConfig& config) {
    return coarse_range(config.min_disparity, config.disparities);
}

MatcherConfig coarse_config(const MatcherConfig& config) {
    MatcherConfig coarse = config;
    coarse.kind = MatcherKind::kCensus;
    coarse.min_disparity = range_of(config).min_disparity;
    coarse.disparities = range_of(config).disparities;
    coarse.limits.subpixel = true;
    return coarse;
}

}  // namespace

// The rows that one task works on.
struct PyramidMatcher::Part {
    int first;
    int last;
};

// Memory of one running task.
struct PyramidMatcher::Lane {
    CensusRows left_rows, right_rows;
    std::array<CensusPair, kHeldRows> held;  // right words at column 0
    std::ptrdiff_t before = 0;               // columns of a right row in front of column 0
    std::size_t behind = 0;                  // ... and behind the last
    ImageView<std::uint8_t> low, index;      // predictions, a row each
    ImageView<Invalid> against;
    std::array<kernels::CensusWinners, kFineRows> winners{};
    std::span<std::uint16_t> at_right, keys;
    std::span<std::uint8_t> right_index;
    WindowColumns window_columns;

    Lane(const MatcherConfig& config, int width, Arena& arena)
        : left_rows(width, false, arena), right_rows(width, false, arena) {
        const int blocks = whole_blocks(width);
        const int shift = config.min_disparity + config.disparities;
        const int margin = kBlockMargin + kWidestVector;
        before = margin + std::max(0, shift);
        behind = static_cast<std::size_t>(margin + blocks - width + std::max(0, -config.min_disparity));
        const auto plane = [&](std::ptrdiff_t in_front, std::size_t rest) {
            const auto bytes = static_cast<std::size_t>(in_front + width) + rest;
            return arena.take<std::uint8_t>(bytes).data() + in_front;
        };
        const auto rest = static_cast<std::size_t>(margin + blocks - width);
        for (CensusPair& row : held)
            row = {plane(margin, rest), plane(before, behind)};
        low = arena.image<std::uint8_t>(blocks, kPartThinRows);
        index = arena.image<std::uint8_t>(blocks, kPartThinRows);
        against = arena.image<Invalid>(blocks, kPartThinRows);
        for (kernels::CensusWinners& row : winners)
            for (std::uint8_t** part : {&row.index, &row.best, &row.lower, &row.upper})
                *part = arena.take<std::uint8_t>(static_cast<std::size_t>(blocks)).data();
        at_right = arena.take<std::uint16_t>(static_cast<std::size_t>(width + config.disparities));
        keys = arena.take<std::uint16_t>(static_cast<std::size_t>(blocks));
        right_index = arena.take<std::uint8_t>(static_cast<std::size_t>(blocks));
        if (config.checks) window_columns = WindowColumns(width, arena);
    }

    kernels::Prediction prediction(int row) const { return {low.row(row), index.row(row), against.row(row)}; }
    void take_census(ConstLuma left, ConstLuma right, int y, const CensusPair& row) {
        left_rows.take(left, y, {row.left, nullptr});
        right_rows.take(right, y, {row.right, nullptr});
        const int width = left.width;
        std::memset(row.right - before, row.right[0], static_cast<std::size_t>(before));
        std::memset(row.right + width, row.right[width - 1], behind);
    }
};

PyramidMatcher::PyramidMatcher(const MatcherConfig& config, int width, int height, int lanes, Arena& arena)
    : config_(resolved(config)), width_(width), height_(height) {
    const std::size_t before = arena.bytes();
    half_left_ = arena.image<std::uint8_t>(halved(width), halved(height));
    half_right_ = arena.image<std::uint8_t>(halved(width), halved(height));
    coarse_map_ = DisparityMap::make(arena, halved(width), halved(height));
    thin_ = arena.image<std::uint8_t>(whole_blocks(width), (height + kThinStep - 1) / kThinStep);
    coarse_ = std::make_unique<CensusMatcher>(coarse_config(config_), halved(width), halved(height), lanes,
                                              arena, CensusMatcher::Use::kCoarse);
    lanes_.reserve(static_cast<std::size_t>(lanes));
    for (int lane = 0; lane < lanes; ++lane)
        lanes_.emplace_back(config_, width, arena);
    if (config_.checks && judges_patches(config_.limits)) speckles_ = SpeckleScratch(width, arena);
    if (config_.checks && config_.limits.median)
        median_rows_ = arena.take<std::int16_t>(2 * static_cast<std::size_t>(width));
    state_bytes_ = arena.bytes() - before;
}

PyramidMatcher::~PyramidMatcher() = default;

void PyramidMatcher::match(ConstLuma left, ConstLuma right, const DisparityMap& out, Parallel& parallel) {
    assert(left.same_size(width_, height_) && right.same_size(width_, height_));
    assert(out.disparity_q4.same_size(width_, height_) && out.invalid.same_size(width_, height_));
    assert(static_cast<std::size_t>(parallel.lanes()) <= lanes_.size());
    const int parts = (height_ + kPartRows - 1) / kPartRows;
    const auto part_of = [&](int number) {
        return Part{number * kPartRows, std::min((number + 1) * kPartRows, height_)};
    };
    parallel.for_each(parts, [&](int number, int /*lane*/) {
        const Part part = part_of(number);
        halve_rows(left, part.first / 2, halved(part.last), half_left_);
        halve_rows(right, part.first / 2, halved(part.last), half_right_);
    });
    coarse_->match(half_left_, half_right_, coarse_map_, parallel);
    parallel.for_each(parts, [&](int number, int lane_number) {
        Lane& lane = lanes_[static_cast<std::size_t>(lane_number)];
        find_thin(left, right, part_of(number), lane);
        refine(left, right, part_of(number), lane, out);
    });
    if (!speckles_.patches.empty())
        remove_speckles(out, left, right, {config_.limits.speckle_px, config_.limits.alike_percent},
                        speckles_);
    if (!median_rows_.empty()) median_3x3(out, median_rows_);
}

void PyramidMatcher::find_thin(ConstLuma left, ConstLuma right, const Part& part, Lane& lane) const {
    const int rows = thin_.height;
    const int first = part.first / kThinStep;
    const int count = std::min(first + kPartThinRows, rows) - first;
    lane.left_rows.restart();
    lane.right_rows.restart();
    std::array<CensusPair, kHeldRows> looked_at;
    int taken = -1;  // the last row whose words are held
    std::size_t held = 0;
    for (int j = 0; j < count + kThinRows - 1; ++j) {
        const int row = std::clamp(first - kThinRowsBefore + j, 0, rows - 1);
        if (row != taken) {
            held = static_cast<std::size_t>(j);
            lane.take_census(left, right, kThinStep * row, lane.held[held]);
            taken = row;
        }
        looked_at[static_cast<std::size_t>(j)] = lane.held[held];
    }
    for (int r = 0; r < count; ++r)
        predict(kThinStep * (first + r), false, lane.prediction(r));
    for (int x = 0; x < width_; x += kBlock)
        kernels::thin_block({.rows = looked_at.data(),
                             .count = count,
                             .first_x = x,
                             .width = width_,
                             .min_disparity = config_.min_disparity,
                             .disparities = config_.disparities,
                             .predicted = lane.index.data + x,
                             .predicted_stride = lane.index.stride,
                             .nearer = thin_.row(first) + x,
                             .nearer_stride = thin_.stride});
    for (int r = 0; r < count; ++r)
        widen_thin(looked_at.data() + r, lane.index.row(r), thin_.row(first + r));
}

// Adds the edges of what was found in one sampled row; `rows` are the kThinRows rows of its window.
void PyramidMatcher::widen_thin(const kernels::CensusPair* rows, const std::uint8_t* predicted,
                                std::uint8_t* thin) const {
    const auto column_cost = [&](int x, int k) {
        int sum = 0;
        for (int j = 0; j < kThinRows; ++j)
            sum += std::popcount(
                static_cast<std::uint8_t>(rows[j].left[x] ^ rows[j].right[x - config_.min_disparity - k]));
        return sum;
    };
    const auto follows = [&](int x, int index) {
        const int match = x - config_.min_disparity - index;
        if (index - predicted[x] < kThinNearer || match < 0 || match >= width_) return false;
        const int last = std::min(config_.disparities - 1, predicted[x] + kThinPredictedWithin);
        int at_prediction = 255;
        for (int k = std::max(0, predicted[x] - kThinPredictedWithin); k <= last; ++k)
            at_prediction = std::min(at_prediction, column_cost(x, k));
        return column_cost(x, index) < at_prediction;
    };
    int before = 0;  // what was found at x - 1, not what was added there
    for (int x = 0; x < width_; ++x) {
        const int here = thin[x];
        const int beside = std::max<int>(before, x + 1 < width_ ? thin[x + 1] : 0);
        before = here;
        if (here == 0 && beside != 0 && follows(x, beside)) thin[x] = static_cast<std::uint8_t>(beside);
    }
}

void PyramidMatcher::refine(ConstLuma left, ConstLuma right, const Part& part, Lane& lane,
                            const DisparityMap& out) const {
    lane.left_rows.restart();
    lane.right_rows.restart();
    const auto held = [&](int y) {
        return lane.held[static_cast<std::size_t>(std::clamp(y, 0, height_ - 1) % kHeldRows)];
    };
    int next = std::max(0, part.first - kFineWindowReach);
    for (int y = part.first; y < part.last; y += kFineRows) {
        for (; next <= std::min(y + kFineRows - 1 + kFineWindowReach, height_ - 1); ++next)
            lane.take_census(left, right, next, held(next));
        for (int j = 0; j < kFineRows / 2; ++j)
            predict(std::min(y + 2 * j, height_ - 1), true, lane.prediction(j));
        kernels::FineBlock block{};
        block.width = width_;
        block.min_disparity = config_.min_disparity;
        block.disparities = config_.disparities;
        block.checks = config_.checks;
        for (int j = 0; j < static_cast<int>(block.rows.size()); ++j)
            block.rows[static_cast<std::size_t>(j)] = held(y + j - kFineWindowReach);
        for (int x = 0; x < width_; x += kBlock) {
            block.first_x = x;
            for (std::size_t j = 0; j < block.predictions.size(); ++j) {
                const kernels::Prediction row = lane.prediction(static_cast<int>(j));
                block.predictions[j] = {row.low + x, row.index + x, row.against + x};
            }
            for (std::size_t j = 0; j < block.winners.size(); ++j) {
                const kernels::CensusWinners& row = lane.winners[j];
                block.winners[j] = {row.index + x, row.best + x, row.lower + x,
                                    row.upper + x, nullptr,      nullptr};
            }
            kernels::fine_block(block);
        }
        for (int r = 0; r < std::min(kFineRows, part.last - y); ++r) {
            if (config_.checks)
                judge_windows(left, left, y + r, y + r == part.first, config_.limits, lane.window_columns,
                              out.invalid.row(y + r));
            answer(y + r, lane, out);
        }
    }
}

void PyramidMatcher::predict(int y, bool with_thin, const kernels::Prediction& out) const {
    kernels::predict_row({.disparity_q4 = coarse_map_.disparity_q4.row(y / 2),
                          .invalid = coarse_map_.invalid.row(y / 2),
                          .thin = with_thin ? thin_.row(y / kThinStep) : nullptr,
                          .width = width_,
                          .min_disparity = config_.min_disparity,
                          .disparities = config_.disparities},
                         out);
}

void PyramidMatcher::answer(int y, Lane& lane, const DisparityMap& out) const {
    kernels::CensusWinners winners = lane.winners[static_cast<std::size_t>(y % kFineRows)];
    winners.at_right = lane.at_right.data();
    const CheckLimits& limits = config_.limits;
    Invalid* const invalid = out.invalid.row(y);
    if (config_.checks)
        kernels::vote_row(width_, config_.disparities, lane.against.row(y % kFineRows / 2), winners,
                          lane.keys.data(), invalid);
    kernels::census_answer_row({.width = width_,
                                .min_disparity = config_.min_disparity,
                                .disparities = config_.disparities,
                                .subpixel = limits.subpixel,
                                .checks = config_.checks,
                                .keep = false,
                                .uniqueness_percent = -1,
                                .left_right_px = limits.left_right_px,
                                .at_right = lane.right_index.data()},
                               winners, out.disparity_q4.row(y), invalid);
}

}  // namespace groundline::stereo
