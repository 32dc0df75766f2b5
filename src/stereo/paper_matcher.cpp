#include "stereo/paper_matcher.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdlib>

#include "stereo/local_mean.hpp"
#include "stereo/median.hpp"
#include "stereo/paper_judge.hpp"
#include "stereo/paper_kernels.hpp"
#include "stereo/window_sums.hpp"

namespace groundline::stereo {
namespace {

using kernels::ConstCostRows;
using kernels::Cost;
using kernels::CostRows;
using kernels::kGroup;
using kernels::kNoCost;
using kernels::row_range;

// Rows that one normalising task writes; it reads 14 more.
constexpr int kNormaliseRows = 64;
// Rows above and below that one rule reads, and both.
constexpr int kRuleRows = 1;
constexpr int kRulesRows = 2 * kRuleRows;
constexpr int kHaloRows = kWindowReach + kRulesRows;

// What lies above the picture's first row and below its last is a copy of that row, its border included.
// Row `top` of `rows` is the picture's row 0, row `bottom` its last; negative: not among `rows`.
void repeat_edges(CostRows rows, int top, int bottom) {
    const auto copy = [&](int from, int to) {
        std::copy_n(rows.row(from) - 1, rows.width + 2, rows.row(to) - 1);
    };
    if (top >= 0) copy(top, top - 1);
    if (bottom >= 0) copy(bottom, bottom + 1);
}

}  // namespace

// Memory of one running task, B rows a band. About 45 bytes a pixel of the band, 60 with checks: 24 rows of
// a 640 px picture take 0.9 MB and stay in a second cache of 1 MB.
struct PaperMatcher::Lane {
    Luma left, right;                          // B + 14 rows: 5 for the window, 1 for each rule
    std::span<std::uint8_t> outside;           // 255 outside the right image, columns like a row of `right`
    CostRows weighed;                          // B + 4 rows
    std::array<CostRows, 3> aggregated;        // B + 4 rows of three disparities
    std::array<CostRows, kGroup + 1> refined;  // after rule 1: B + 2 rows of a group and the one before
    std::array<CostRows, kGroup> enhanced;     // after rule 2: B rows of a group
    kernels::Winners winners;                  // B rows
    CostRows best_right;
    ImageView<std::int16_t> index_right;
    std::span<std::uint16_t> columns;    // for the local mean
    std::span<std::int16_t> seen_right;  // one row
    WindowColumns window_columns;

    CostRows aggregated_at(int k) const { return aggregated[static_cast<std::size_t>(k % 3)]; }
    CostRows refined_at(int k) const { return refined[static_cast<std::size_t>(k % (kGroup + 1))]; }
    CostRows enhanced_at(int k) const { return enhanced[static_cast<std::size_t>(k % kGroup)]; }

    Lane(const MatcherConfig& config, int width, int band_rows, Arena& arena) {
        const int nearest = std::max(0, config.min_disparity + config.disparities - 1);
        const int beyond = std::max(0, -config.min_disparity);
        const int front = (nearest + 63) / 64 * 64;
        left = arena.image<std::uint8_t>(width, band_rows + 2 * kHaloRows);
        const Luma whole = arena.image<std::uint8_t>(front + width + beyond, band_rows + 2 * kHaloRows);
        right = {whole.data + front, width, whole.height, whole.stride};
        const std::span<std::uint8_t> all = arena.take<std::uint8_t>(static_cast<std::size_t>(whole.stride));
        std::fill(all.begin(), all.end(), std::uint8_t{255});
        outside = all.subspan(static_cast<std::size_t>(front));
        std::fill_n(outside.begin(), width, std::uint8_t{0});

        if (config.normalise_local_mean)
            columns = arena.take<std::uint16_t>(static_cast<std::size_t>(local_mean_scratch(width)));
        weighed = kernels::cost_rows(arena, width, band_rows + 2 * kRulesRows);
        for (CostRows& rows : aggregated)
            rows = kernels::cost_rows(arena, width, band_rows + 2 * kRulesRows);
        for (CostRows& rows : refined)
            rows = kernels::cost_rows(arena, width, band_rows + 2 * kRuleRows);
        for (CostRows& rows : enhanced) {
            rows = kernels::cost_rows(arena, width, band_rows, beyond, nearest);
            fill_pixels(ImageView<Cost>(rows.data - beyond, beyond + width + nearest + kernels::kMargin,
                                        band_rows, rows.stride),
                        kNoCost);
        }
        winners.best = arena.image<Cost>(width, band_rows);
        winners.index = arena.image<std::int16_t>(width, band_rows);
        if (!config.checks) return;
        for (CostRows* rows :
             {&winners.before, &winners.second, &winners.lower, &winners.centre, &winners.upper, &best_right})
            *rows = arena.image<Cost>(width, band_rows);
        index_right = arena.image<std::int16_t>(width, band_rows);
        seen_right = arena.take<std::int16_t>(static_cast<std::size_t>(width));
        window_columns = WindowColumns(width, arena);
    }

    // The views' rows that the band first .. last - 1 needs, those outside the picture repeated.
    void take_rows(ConstLuma from_left, ConstLuma from_right, int first, int last) {
        for (int y = first - kHaloRows; y < last + kHaloRows; ++y) {
            const int from = std::clamp(y, 0, from_left.height - 1);
            std::copy_n(from_left.row(from), left.width, left.row(y - first + kHaloRows));
            std::copy_n(from_right.row(from), right.width, right.row(y - first + kHaloRows));
        }
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
    : config_(resolved(config)),
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
    if (config.checks && judges_patches(config.limits)) speckles_ = SpeckleScratch(width, arena);
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
                answer_row(lane.winners.index.row(y - first), y, out);
        }
    });
    if (!speckles_.patches.empty())
        remove_speckles(out, left, right, {config_.limits.speckle_px, config_.limits.alike_percent},
                        speckles_);
    if (!median_rows_.empty()) median_3x3(out, median_rows_);
}

// Leaves the winners of rows first .. last - 1 in the lane. Disparities pass one at a time; rule 1 needs the
// next one, so it and what follows run one behind. The winners are kept group by group.
void PaperMatcher::search(const Pair& pair, int first, int last, Lane& lane) const {
    const int count = config_.disparities;
    const int rows = last - first;
    fill_pixels(lane.winners.best, kNoCost);
    if (config_.checks)
        for (const CostRows& plane : {lane.winners.before, lane.winners.second, lane.best_right})
            fill_pixels(plane, kNoCost);
    lane.take_rows(pair.left, pair.right, first, last);
    aggregate(0, first, last, lane);
    for (int k = 0; k < count; ++k) {
        if (k + 1 < count) aggregate(k + 1, first, last, lane);
        refine(k, first, last, lane);
        if ((k + 1) % kGroup == 0) select(k + 1 - kGroup, rows, lane);
    }
}

// Fills lane.aggregated_at(k); its row 0 is picture row first - 2.
void PaperMatcher::aggregate(int k, int first, int last, Lane& lane) const {
    const int rows = last - first + 2 * kRulesRows;
    const int disparity = config_.min_disparity + k;
    ConstLuma right = row_range(lane.right, 0, rows + 2 * kWindowReach);
    right.data -= disparity;
    const CostRows weighed = row_range(lane.weighed, 0, rows);
    const CostRows out = row_range(lane.aggregated_at(k), 0, rows);
    kernels::weigh_down(
        {row_range(lane.left, 0, rows + 2 * kWindowReach), right, lane.outside.data() - disparity},
        config_.paper.truncation, taps_, weighed);
    kernels::weigh_across(weighed, taps_, out);
    repeat_edges(out, first == 0 ? kRulesRows : -1, last == height_ ? rows - 1 - kRulesRows : -1);
}

// Fills lane.refined_at(k), its row 0 being picture row first - 1, and lane.enhanced_at(k).
void PaperMatcher::refine(int k, int first, int last, Lane& lane) const {
    const PaperReading& reading = config_.paper;
    const int rows = last - first;
    const int farther = k > 0 ? k - 1 : k + 1;
    const int nearer = k + 1 < config_.disparities ? k + 1 : k - 1;
    const auto aggregated = [&](int disparity) {
        return row_range(lane.aggregated_at(disparity), 0, rows + 2 * kRulesRows);
    };
    const CostRows refined = row_range(lane.refined_at(k), 0, rows + 2 * kRuleRows);
    kernels::rule_one(reading.rule_one, aggregated(k), aggregated(farther), aggregated(nearer), refined);
    repeat_edges(refined, first == 0 ? kRuleRows : -1, last == height_ ? rows : -1);

    const CostRows looked_at =
        reading.rules_at_once ? row_range(aggregated(k), kRuleRows, rows + 2 * kRuleRows) : refined;
    kernels::rule_two(reading.rule_two, reading.rule_one == RuleOne::kSum9, looked_at,
                      row_range(refined, kRuleRows, rows), row_range(lane.enhanced_at(k), 0, rows));
}

// Takes disparities k .. k + 3 into the winners.
void PaperMatcher::select(int k, int rows, Lane& lane) const {
    const auto refined_at = [&](int disparity) {
        return row_range(lane.refined_at(disparity), kRuleRows, rows);
    };
    kernels::Group enhanced;
    kernels::Group refined;
    for (int i = 0; i < kGroup; ++i) {
        enhanced[static_cast<std::size_t>(i)] = row_range(lane.enhanced_at(k + i), 0, rows);
        refined[static_cast<std::size_t>(i)] = refined_at(k + i);
    }
    const kernels::Winners winners = lane.winners.first_rows(rows);
    if (!config_.checks) {
        kernels::select(enhanced, k, winners);
        return;
    }
    kernels::select_with_evidence(enhanced, refined_at(std::max(0, k - 1)), refined, k, winners);
    if (config_.limits.left_right_px >= 0)
        kernels::select_right(enhanced, k, config_.min_disparity + k, row_range(lane.best_right, 0, rows),
                              row_range(lane.index_right, 0, rows));
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

    const kernels::Winners& winners = lane.winners;
    const WinnerRow kept{winners.index.row(row),   winners.best.row(row),   winners.second.row(row),
                         winners.lower.row(row),   winners.centre.row(row), winners.upper.row(row),
                         lane.index_right.row(row)};
    const SearchRange range{width_, config_.min_disparity, config_.disparities, config_.paper.truncation};
    judge_winners(kept, range, limits, lane.seen_right.data(), invalid, disparity);
}

}  // namespace groundline::stereo
