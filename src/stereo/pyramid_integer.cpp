#include "stereo/pyramid_integer.hpp"

#include <algorithm>
#include <bit>
#include <cstdlib>

#include "core/arena.hpp"
#include "stereo/census_integer.hpp"
#include "stereo/checks_integer.hpp"
#include "stereo/pyramid.hpp"
#include "stereo/subpixel.hpp"

namespace groundline::stereo {
namespace {

// Prediction of each pixel, 1/16 px, and the coarse level's reason against it.
struct Prediction {
    std::vector<int> q4;
    std::vector<Invalid> against;
};

class Pyramid {
  public:
    Pyramid(const MatcherConfig& config, ConstLuma left, ConstLuma right)
        : config_(config),
          left_(left),
          right_(right),
          last_(config.disparities - 1),
          left_words_(census_words(left)),
          right_words_(census_words(right)) {}

    void match(const DisparityMap& out) {
        predict();
        replace_by_thin();
        for (int y = 0; y < left_.height; ++y)
            answer_row(y, out);
        if (config_.checks) finish_map(out, left_, right_, config_.limits);
    }

  private:
    struct Thin {
        int x;
        int row;
        int index;
    };

    std::size_t index(int x, int y) const {
        return static_cast<std::size_t>(std::clamp(y, 0, left_.height - 1)) *
                   static_cast<std::size_t>(left_.width) +
               static_cast<std::size_t>(std::clamp(x, 0, left_.width - 1));
    }
    // Differing narrow pairs between left(x, y) and right(x - d, y), everything clamped to the image.
    int difference(int x, int y, int k) const {
        x = std::clamp(x, 0, left_.width - 1);
        const unsigned a = left_words_[index(x, y)];
        const unsigned b = right_words_[index(x - config_.min_disparity - k, y)];
        return std::popcount((a ^ b) & kNarrowPairs);
    }

    void predict() {
        const int width = halved(left_.width);
        const int height = halved(left_.height);
        Arena arena;
        const Luma half_left = arena.image<std::uint8_t>(width, height);
        const Luma half_right = arena.image<std::uint8_t>(width, height);
        halve(left_, half_left);
        halve(right_, half_right);
        const DisparityMap coarse = DisparityMap::make(arena, width, height);
        search_coarse_integer(config_, half_left, half_right, coarse);
        for (int y = 0; y < left_.height; ++y)
            for (int x = 0; x < left_.width; ++x) {
                prediction_.q4.push_back(std::clamp(2 * coarse.disparity_q4.at(x / 2, y / 2),
                                                    kDisparityOne * config_.min_disparity,
                                                    kDisparityOne * (config_.min_disparity + last_)));
                prediction_.against.push_back(coarse.invalid.at(x / 2, y / 2));
            }
    }

    int predicted_index(int x, int y) const {
        return whole_px(prediction_.q4[index(x, y)]) - config_.min_disparity;
    }

    // Cost of one column of the tall window at sampled row `row`.
    int column_cost(int x, int row, int k) const {
        const int rows = (left_.height + kThinStep - 1) / kThinStep;
        int sum = 0;
        for (int j = -kThinRows / 2; j < kThinRows / 2; ++j)
            sum += difference(x, kThinStep * std::clamp(row + j, 0, rows - 1), k);
        return sum;
    }
    int thin_cost(int x, int row, int k) const {
        return column_cost(x - 1, row, k) + column_cost(x, row, k) + column_cost(x + 1, row, k);
    }
    bool inside_right(int x, int k) const {
        const int match = x - config_.min_disparity - k;
        return match >= 0 && match < left_.width;
    }

    // Index of a nearer thing at x, 0 if none is found.
    int thin_at(int x, int row) const {
        const int predicted = predicted_index(x, kThinStep * row);
        int at_prediction = 255;
        int nearer = 255;
        int index = 0;
        for (int k = 0; k <= last_; ++k) {
            const int cost = thin_cost(x, row, k);
            if (std::abs(k - predicted) <= kThinPredictedWithin)
                at_prediction = std::min(at_prediction, cost);
            if (k - predicted >= kThinNearer && cost < nearer) {
                nearer = cost;
                index = k;
            }
        }
        const bool good = 2 * nearer < at_prediction && nearer <= kThinHighest && inside_right(x, index);
        return good ? index : 0;
    }

    // Whether x, which saw nothing itself, belongs to the thing found beside it.
    bool follows(int x, int row, int index) const {
        const int predicted = predicted_index(x, kThinStep * row);
        if (index == 0 || index - predicted < kThinNearer || !inside_right(x, index)) return false;
        int at_prediction = 255;
        for (int k = std::max(0, predicted - kThinPredictedWithin);
             k <= std::min(last_, predicted + kThinPredictedWithin); ++k)
            at_prediction = std::min(at_prediction, column_cost(x, row, k));
        return column_cost(x, row, index) < at_prediction;
    }

    void replace_by_thin() {
        const int rows = (left_.height + kThinStep - 1) / kThinStep;
        std::vector<Thin> thin;
        for (int row = 0; row < rows; ++row) {
            std::vector<int> found(static_cast<std::size_t>(left_.width) + 2, 0);  // x + 1
            for (int x = 0; x < left_.width; ++x)
                found[static_cast<std::size_t>(x + 1)] = thin_at(x, row);
            for (int x = 0; x < left_.width; ++x) {
                const auto at = static_cast<std::size_t>(x + 1);
                const int beside = std::max(found[at - 1], found[at + 1]);
                if (found[at] != 0)
                    thin.push_back({x, row, found[at]});
                else if (follows(x, row, beside))
                    thin.push_back({x, row, beside});
            }
        }
        for (const Thin& each : thin)
            for (int y = kThinStep * each.row; y < std::min(kThinStep * (each.row + 1), left_.height); ++y) {
                prediction_.q4[index(each.x, y)] = kDisparityOne * (config_.min_disparity + each.index);
                prediction_.against[index(each.x, y)] = Invalid::kNone;
            }
    }

    int window_cost(int x, int y, int k) const {
        const auto column = [&](int u) {
            int sum = 0;
            for (int j = -kFineWindowReach; j <= kFineWindowReach; ++j)
                sum += difference(u, y + j, k);
            return sum;
        };
        return mean_up(column(x - 3) + column(x + 3), column(x - 2) + column(x + 2)) +
               mean_up(column(x - 1) + column(x + 1), 2 * column(x));
    }
    int distance_q4(int x, int y, int k) const {
        return std::abs(kDisparityOne * (config_.min_disparity + k) - prediction_.q4[index(x, y)]);
    }
    int fine_cost(int x, int y, int k) const {
        return std::min(255, window_cost(x, y, k) + distance_q4(x, y, k));
    }

    void answer_row(int y, const DisparityMap& out) const {
        const CheckLimits& limits = config_.limits;
        std::vector<int> winner;
        std::vector<int> cost;
        for (int x = 0; x < left_.width; ++x) {
            int best = -1;
            int lowest = 256;
            for (int k = 0; k <= last_; ++k) {
                if (distance_q4(x, y, k) > kFineReachQ4) continue;
                const int here = fine_cost(x, y, k);
                if (here >= lowest) continue;
                best = k;
                lowest = here;
            }
            winner.push_back(best);
            cost.push_back(lowest);
        }
        // As in the census matcher, from the fine costs.
        const auto winner_at_right = [&](int match) {
            int best = -1;
            int lowest = 256;
            for (int k = last_; k >= 0; --k) {
                const int x = match + config_.min_disparity + k;
                if (x < 0 || x >= left_.width || prediction_.against[index(x, y)] != Invalid::kNone ||
                    winner[static_cast<std::size_t>(x)] != k || cost[static_cast<std::size_t>(x)] >= lowest)
                    continue;
                best = k;
                lowest = cost[static_cast<std::size_t>(x)];
            }
            return best;
        };
        const auto judge = [&](int x, int k) {
            const Invalid seen = window_reason(left_, left_, x, y, limits);
            if (seen != Invalid::kNone) return seen;
            const Invalid against = prediction_.against[index(x, y)];
            if (against != Invalid::kNone) return against;
            const int match = x - config_.min_disparity - k;
            if (match <= 0 || match >= left_.width) return Invalid::kBorder;
            if (k == last_) return Invalid::kRangeEdge;
            if (limits.left_right_px >= 0 && std::abs(winner_at_right(match) - k) > limits.left_right_px)
                return Invalid::kLeftRight;
            return Invalid::kNone;
        };
        for (int x = 0; x < left_.width; ++x) {
            const int k = winner[static_cast<std::size_t>(x)];
            int disparity_q4 = kDisparityOne * (config_.min_disparity + k);
            if (limits.subpixel && k > 0 && k < last_)
                disparity_q4 +=
                    equiangular_q4(fine_cost(x, y, k - 1), fine_cost(x, y, k), fine_cost(x, y, k + 1));
            const Invalid invalid = config_.checks ? judge(x, k) : Invalid::kNone;
            out.disparity_q4.at(x, y) =
                static_cast<std::int16_t>(invalid == Invalid::kNone ? disparity_q4 : 0);
            out.invalid.at(x, y) = invalid;
        }
    }

    MatcherConfig config_;
    ConstLuma left_;
    ConstLuma right_;
    int last_;
    std::vector<std::uint16_t> left_words_;
    std::vector<std::uint16_t> right_words_;
    Prediction prediction_;
};

}  // namespace

void halve(ConstLuma image, Luma half) {
    for (int y = 0; y < half.height; ++y)
        for (int x = 0; x < half.width; ++x) {
            const int right = std::min(2 * x + 1, image.width - 1);
            const int below = std::min(2 * y + 1, image.height - 1);
            half.at(x, y) = static_cast<std::uint8_t>((image.at(2 * x, 2 * y) + image.at(right, 2 * y) +
                                                       image.at(2 * x, below) + image.at(right, below) + 2) /
                                                      4);
        }
}

void match_pyramid_integer(const MatcherConfig& config, ConstLuma left, ConstLuma right,
                           const DisparityMap& out) {
    Pyramid(resolved(config), left, right).match(out);
}

}  // namespace groundline::stereo
