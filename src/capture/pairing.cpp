#include "capture/pairing.hpp"

#include <algorithm>
#include <cstdlib>

namespace groundline::capture {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
// So many pictures of one eye without a pair end a row: more than a camera at a third of the other's rate
// leaves.
constexpr int kRowEnds = 5;

template <typename Vector>
auto median_of(Vector& values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace

Pairing::DroppedFrames Pairing::add(const StampedFrame& frame) {
    DroppedFrames dropped;
    const auto eye = static_cast<std::size_t>(frame.eye);
    Waiting& own = waiting_[eye];
    Waiting& other = waiting_[1 - eye];
    std::optional<std::int64_t>& last_ns = last_ns_[eye];
    since_pair_[eye] = std::min(since_pair_[eye] + 1, kOutOfStep);
    if (since_pair_[eye] >= kRowEnds) pairs_in_a_row_ = 0;
    if (since_pair_[0] >= kOutOfStep && since_pair_[1] >= kOutOfStep) out_of_step_ = true;
    if (last_ns && frame.stamp_ns <= *last_ns) {
        dropped.push_back({frame, Fate::kSingle});
        return dropped;
    }
    last_ns = frame.stamp_ns;

    const auto distance = [&](const StampedFrame& candidate) {
        return std::abs(candidate.stamp_ns - frame.stamp_ns);
    };
    const auto nearest = std::min_element(
        other.begin(), other.end(), [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
    const bool found = nearest != other.end() && distance(*nearest) <= config_.tolerance_ns;
    if (!found && out_of_step_ && last_ns_[1 - eye]) {
        const std::int64_t near_ns = nearest != other.end() ? nearest->stamp_ns : *last_ns_[1 - eye];
        skew_ns_ = frame.eye == 1 ? frame.stamp_ns - near_ns : near_ns - frame.stamp_ns;
    }
    // Later pictures of this eye are later than this one: what is too early for it is too early for them.
    const auto drop_front = [&](Waiting& waiting, auto end) {
        for (auto it = waiting.begin(); it != end; ++it)
            dropped.push_back({*it, Fate::kSingle});
        waiting.erase(waiting.begin(), end);
    };
    if (!found) {
        drop_front(other, std::find_if(other.begin(), other.end(), [&](const auto& candidate) {
                       return candidate.stamp_ns >= frame.stamp_ns - config_.tolerance_ns;
                   }));
        own.push_back(frame);
        if (static_cast<int>(own.size()) > config_.max_waiting) drop_front(own, own.begin() + 1);
        return dropped;
    }

    const FramePair pair = frame.eye == 0 ? FramePair{frame, *nearest} : FramePair{*nearest, frame};
    drop_front(own, own.end());
    drop_front(other, nearest);
    other.erase(other.begin());
    if (newest_) {
        dropped.push_back({newest_->left, Fate::kSuperseded});
        dropped.push_back({newest_->right, Fate::kSuperseded});
    }
    newest_ = pair;
    note_pair(pair);
    return dropped;
}

std::optional<FramePair> Pairing::take() {
    const std::optional<FramePair> pair = newest_;
    newest_.reset();
    return pair;
}

Pairing::DroppedFrames Pairing::reset() {
    DroppedFrames dropped;
    for (const Waiting& waiting : waiting_)
        for (const StampedFrame& frame : waiting)
            dropped.push_back({frame, Fate::kSingle});
    if (newest_) {
        dropped.push_back({newest_->left, Fate::kSingle});
        dropped.push_back({newest_->right, Fate::kSingle});
    }
    *this = Pairing(config_);
    return dropped;
}

void Pairing::note_pair(const FramePair& pair) {
    since_pair_ = {};
    pairs_in_a_row_ = std::min(pairs_in_a_row_ + 1, kOutOfStep);
    if (pairs_in_a_row_ == kOutOfStep) out_of_step_ = false;
    skew_ns_ = pair.skew_ns();
    const std::int64_t at_ns = pair.left.stamp_ns;
    if (second_.empty()) second_begins_ns_ = at_ns;
    if (at_ns - second_begins_ns_ >= kSecondNs) {
        add_drift_point({second_begins_ns_, median_of(second_)});
        second_.clear();
        second_begins_ns_ = at_ns;
    }
    if (second_.size() < second_.capacity()) second_.push_back(skew_ns_);
}

void Pairing::add_drift_point(DriftPoint point) {
    // Cameras that drift past each other pair anew at another phase, and a replaced one starts at any: no
    // drift.
    const bool jumped = !drift_points_.empty() &&
                        std::abs(point.skew_ns - drift_points_.back().skew_ns) > config_.tolerance_ns / 2 + 1;
    if (jumped) {
        drift_points_.clear();
        drift_ppm_ = std::numeric_limits<double>::quiet_NaN();
    }
    if (drift_points_.size() == drift_points_.capacity()) drift_points_.erase(drift_points_.begin());
    drift_points_.push_back(point);
    if (static_cast<int>(drift_points_.size()) < kLeastDriftPoints) return;

    FixedVector<double, static_cast<std::size_t>(kDriftPoints) * (kDriftPoints - 1) / 2> slopes;
    for (std::size_t i = 1; i < drift_points_.size(); ++i) {
        for (std::size_t j = 0; j < i; ++j) {
            const auto rise = static_cast<double>(drift_points_[i].skew_ns - drift_points_[j].skew_ns);
            const auto run = static_cast<double>(drift_points_[i].at_ns - drift_points_[j].at_ns);
            slopes.push_back(1e6 * rise / run);
        }
    }
    drift_ppm_ = median_of(slopes);
}

}  // namespace groundline::capture
