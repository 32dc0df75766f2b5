#include "stereo/paper_matcher.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdlib>

#include "stereo/local_mean.hpp"
#include "stereo/median.hpp"
#include "stereo/paper_kernels.hpp"
#include "stereo/subpixel.hpp"
#include "stereo/window_sums.hpp"

namespace groundline::stereo {
namespace {

using kernels::Cost;
using kernels::kNoCost;

// Elements in front of and behind each row, room for the repeated border that the windows read.
constexpr int kPad = 32;
// Rows that one normalising task writes; it reads 14 more.
constexpr int kNormaliseRows = 64;

Cost* row_of(ImageView<Cost> plane, int y) {
    return plane.row(y) + kPad;
}

void repeat_border(Cost* row, int width) {
    row[-1] = row[0];
    row[width] = row[width - 1];
}

}  // namespace

// Memory of one running task, B rows a band. About 33 bytes a pixel of the band: 16 rows of a 640 px picture
// take 0.37 MB and stay in the second cache.
struct PaperMatcher::Lane {
    Luma differences;                           // B + 14 rows: 5 for the window, 1 for each rule
    std::span<std::uint16_t> weighed;           // one row, padded
    std::array<ImageView<Cost>, 3> aggregated;  // B + 4 rows of three disparities, padded
    std::span<std::uint16_t> columns;           // one row
    std::array<ImageView<Cost>, 2> refined;     // after rule 1: B + 2 rows of two disparities, padded
    std::span<Cost> enhanced;                   // after rule 2: one row
    ImageView<Cost> best, before, second, lower, centre, upper, best_right;  // B rows each
    ImageView<std::int16_t> index, index_right;
    WindowColumns window_columns;

    Lane(const MatcherConfig& config, int width, int band_rows, Arena& arena) {
        const auto row_size = static_cast<std::size_t>(width + 2 * kPad);
        differences = arena.image<std::uint8_t>(width, band_rows + 14);
        weighed = arena.take<std::uint16_t>(row_size);
        for (auto& plane : aggregated)
            plane = arena.image<Cost>(width + 2 * kPad, band_rows + 4);
        columns = arena.take<std::uint16_t>(row_size);
        for (auto& plane : refined)
            plane = arena.image<Cost>(width + 2 * kPad, band_rows + 2);
        enhanced = arena.take<Cost>(row_size);
        best = arena.image<Cost>(width, band_rows);
        index = arena.image<std::int16_t>(width, band_rows);
        if (!config.checks) return;
        for (ImageView<Cost>* plane : {&before, &second, &lower, &centre, &upper, &best_right})
            *plane = arena.image<Cost>(width, band_rows);
        index_right = arena.image<std::int16_t>(width, band_rows);
        window_columns = WindowColumns(width, arena);
    }
};

// The views of one call: as given, and as matched.
struct PaperMatcher::Pair {
    ConstLuma given_left;
    ConstLuma left;
    ConstLuma right;
};

PaperMatcher::PaperMatcher(const MatcherConfig& config, int width, int height, int lanes, Arena& arena,
                           int band_rows)
    : config_(config),
      taps_(window_taps(config.paper.window)),
      width_(width),
      height_(height),
      band_rows_(std::min(band_rows, height)) {
    const std::size_t before = arena.bytes();
    lanes_.reserve(static_cast<std::size_t>(lanes));
    for (int lane = 0; lane < lanes; ++lane)
        lanes_.emplace_back(config, width, band_rows_, arena);
    if (config.normalise_local_mean) {
        plain_left_ = arena.image<std::uint8_t>(width, height);
        plain_right_ = arena.image<std::uint8_t>(width, height);
    }
    if (config.checks && config.limits.speckle_px > 0) speckles_ = SpeckleScratch(width, arena);
    if (config.checks && config.limits.median)
        median_rows_ = arena.take<std::int16_t>(2 * static_cast<std::size_t>(width));
    state_bytes_ = arena.bytes() - before;
}

PaperMatcher::~PaperMatcher() = default;

void PaperMatcher::match(ConstLuma left, ConstLuma right, const DisparityMap& out, Parallel& parallel) {
    assert(left.same_size(width_, height_) && right.same_size(width_, height_));
    assert(out.disparity_q4.same_size(width_, height_) && out.invalid.same_size(width_, height_));
    assert(static_cast<std::size_t>(parallel.lanes()) <= lanes_.size());
    Pair pair{left, left, right};
    if (config_.normalise_local_mean) {
        const int parts = (height_ + kNormaliseRows - 1) / kNormaliseRows;
        parallel.for_each(2 * parts, [&](int task, int lane) {
            const int first = task % parts * kNormaliseRows;
            const int last = std::min(first + kNormaliseRows, height_);
            const bool is_left = task < parts;
            subtract_local_mean(is_left ? left : right, is_left ? plain_left_ : plain_right_, first, last,
                                lanes_[static_cast<std::size_t>(lane)].columns);
        });
        pair.left = plain_left_;
        pair.right = plain_right_;
    }
    parallel.for_each((height_ + band_rows_ - 1) / band_rows_, [&](int band, int lane_number) {
        Lane& lane = lanes_[static_cast<std::size_t>(lane_number)];
        const int first = band * band_rows_;
        const int last = std::min(first + band_rows_, height_);
        search(pair, first, last, lane);
        for (int y = first; y < last; ++y) {
            if (config_.checks)
                judge_row(pair, y, y == first, y - first, lane, out);
            else
                answer_row(lane.index.row(y - first), y, out);
        }
    });
    if (!speckles_.patches.empty()) remove_speckles(out, config_.limits.speckle_px, speckles_);
    if (!median_rows_.empty()) median_3x3(out, median_rows_);
}

// Leaves the winners of rows first .. last - 1 in the lane. Disparities pass one at a time; rule 1 needs the
// next one, so it and what follows run one behind.
void PaperMatcher::search(const Pair& pair, int first, int last, Lane& lane) const {
    const int count = config_.disparities;
    fill_pixels(lane.best, kNoCost);
    if (config_.checks)
        for (const ImageView<Cost>& plane : {lane.before, lane.second, lane.best_right})
            fill_pixels(plane, kNoCost);
    aggregate(pair, 0, first, last, lane);
    for (int k = 0; k < count; ++k) {
        if (k + 1 < count) aggregate(pair, k + 1, first, last, lane);
        refine_and_select(k, first, last, lane);
    }
}

// Fills lane.aggregated[k % 3]; its row 0 is picture row max(0, first - 2).
void PaperMatcher::aggregate(const Pair& pair, int k, int first, int last, Lane& lane) const {
    const int top = std::max(0, first - 2);
    const int bottom = std::min(height_, last + 2);
    const int top_difference = std::max(0, top - kWindowReach);
    const int bottom_difference = std::min(height_, bottom + kWindowReach);
    for (int y = top_difference; y < bottom_difference; ++y)
        kernels::truncated_differences(pair.left.row(y), pair.right.row(y), width_, config_.min_disparity + k,
                                       config_.paper.truncation, lane.differences.row(y - top_difference));
    std::uint16_t* const weighed = lane.weighed.data() + kPad;
    for (int y = top; y < bottom; ++y) {
        std::array<const std::uint8_t*, 2 * kWindowReach + 1> rows;
        for (int j = 0; j < static_cast<int>(rows.size()); ++j)
            rows[static_cast<std::size_t>(j)] =
                lane.differences.row(std::clamp(y + j - kWindowReach, 0, height_ - 1) - top_difference);
        kernels::weigh_down(rows, taps_, width_, weighed);
        for (int i = 1; i <= kWindowReach; ++i) {
            weighed[-i] = weighed[0];
            weighed[width_ - 1 + i] = weighed[width_ - 1];
        }
        Cost* const out = row_of(lane.aggregated[static_cast<std::size_t>(k % 3)], y - top);
        kernels::weigh_across(weighed, taps_, width_, out);
        repeat_border(out, width_);
    }
}

void PaperMatcher::refine_and_select(int k, int first, int last, Lane& lane) const {
    const int top = std::max(0, first - 2);  // of the aggregated planes
    const int top_refined = std::max(0, first - 1);
    const int bottom_refined = std::min(height_, last + 1);
    const auto aggregated = [&](int disparity, int y) {
        return row_of(lane.aggregated[static_cast<std::size_t>(disparity % 3)],
                      std::clamp(y, 0, height_ - 1) - top);
    };
    const auto refined = [&](int disparity, int y) {
        return row_of(lane.refined[static_cast<std::size_t>(disparity % 2)],
                      std::clamp(y, 0, height_ - 1) - top_refined);
    };
    const PaperReading& reading = config_.paper;
    const int farther = k > 0 ? k - 1 : k + 1;
    const int nearer = k + 1 < config_.disparities ? k + 1 : k - 1;
    for (int y = top_refined; y < bottom_refined; ++y) {
        const kernels::Rows rows{aggregated(k, y - 1), aggregated(k, y), aggregated(k, y + 1)};
        Cost* const out = refined(k, y);
        kernels::rule_one(reading.rule_one, rows, aggregated(farther, y), aggregated(nearer, y), width_,
                          lane.columns.data(), out);
        repeat_border(out, width_);
    }
    const bool sums = reading.rule_one == RuleOne::kSum9;
    Cost* const enhanced = lane.enhanced.data();
    for (int y = first; y < last; ++y) {
        kernels::Rows looked_at{refined(k, y - 1), refined(k, y), refined(k, y + 1)};
        if (reading.rules_at_once) looked_at = {aggregated(k, y - 1), aggregated(k, y), aggregated(k, y + 1)};
        kernels::rule_two(reading.rule_two, sums, looked_at, refined(k, y), width_, enhanced);
        const int row = y - first;
        kernels::Winners winners{
            lane.best.row(row), lane.index.row(row), nullptr, nullptr, nullptr, nullptr, nullptr};
        if (!config_.checks) {
            kernels::select(enhanced, k, width_, winners);
            continue;
        }
        winners.before = lane.before.row(row);
        winners.second = lane.second.row(row);
        winners.lower = lane.lower.row(row);
        winners.centre = lane.centre.row(row);
        winners.upper = lane.upper.row(row);
        const Cost* const refined_before = k > 0 ? refined(k - 1, y) : refined(k, y);
        kernels::select_with_evidence(enhanced, refined(k, y), refined_before, k, width_, winners);
        if (config_.limits.left_right_px >= 0)
            kernels::select_right(enhanced, k, config_.min_disparity + k, width_, lane.best_right.row(row),
                                  lane.index_right.row(row));
    }
}

void PaperMatcher::answer_row(const std::int16_t* index, int y, const DisparityMap& out) const {
    std::int16_t* const disparity = out.disparity_q4.row(y);
    Invalid* const invalid = out.invalid.row(y);
    for (int x = 0; x < width_; ++x) {
        disparity[x] = static_cast<std::int16_t>(kDisparityOne * (config_.min_disparity + index[x]));
        invalid[x] = Invalid::kNone;
    }
}

void PaperMatcher::judge_row(const Pair& pair, int y, bool fresh, int row, Lane& lane,
                             const DisparityMap& out) const {
    const CheckLimits& limits = config_.limits;
    std::int16_t* const disparity = out.disparity_q4.row(y);
    Invalid* const invalid = out.invalid.row(y);
    judge_windows(pair.given_left, pair.left, y, fresh, limits, lane.window_columns, invalid);

    const int last = config_.disparities - 1;
    const int highest_cost = limits.cost_percent * 256 * config_.paper.truncation;
    const std::int16_t* const index = lane.index.row(row);
    const Cost* const best = lane.best.row(row);
    const Cost* const second = lane.second.row(row);
    const Cost* const centre = lane.centre.row(row);
    const std::int16_t* const index_right = lane.index_right.row(row);
    const auto judge = [&](int x) {
        const int k = index[x];
        const int match = x - config_.min_disparity - k;
        if (invalid[x] != Invalid::kNone) return invalid[x];
        if (match <= 0 || match >= width_) return Invalid::kBorder;
        if (k == last) return Invalid::kRangeEdge;
        if (limits.cost_percent < 100 && 100 * centre[x] > highest_cost) return Invalid::kCost;
        if (limits.uniqueness_percent >= 0 &&
            (second[x] == best[x] ||
             100 * (second[x] - limits.uniqueness_floor) < (100 + limits.uniqueness_percent) * best[x]))
            return Invalid::kUniqueness;
        if (limits.left_right_px >= 0 && std::abs(index_right[match] - k) > limits.left_right_px)
            return Invalid::kLeftRight;
        return Invalid::kNone;
    };
    const Cost* const lower = lane.lower.row(row);
    const Cost* const upper = lane.upper.row(row);
    for (int x = 0; x < width_; ++x) {
        invalid[x] = judge(x);
        disparity[x] = 0;
        if (invalid[x] != Invalid::kNone) continue;
        const int k = index[x];
        const bool refine = limits.subpixel && k > 0 && k < last;
        disparity[x] =
            static_cast<std::int16_t>(kDisparityOne * (config_.min_disparity + k) +
                                      (refine ? equiangular_q4(lower[x], centre[x], upper[x]) : 0));
    }
}

}  // namespace groundline::stereo
