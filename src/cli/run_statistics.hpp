// What a run found, added up for the table and the summary at its end.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/sink.hpp"

namespace groundline::cli {

class RunStatistics final : public Sink {
  public:
    bool consume(const FrameResult& result) override {
        ++frames_;
        ++verdicts_[static_cast<std::size_t>(result.verdict)];
        for (int reason = 0; reason < kReasons; ++reason)
            if (result.reasons.has(static_cast<Reason>(reason))) ++reasons_[static_cast<std::size_t>(reason)];
        for (std::size_t kind = 0; kind < share_sum_.size(); ++kind)
            share_sum_[kind] += result.share[kind];
        if (result.ground.found && result.ground.metric) {
            heights_m_.push_back(result.ground.pose.height_m);
            pitches_rad_.push_back(result.ground.pose.pitch_rad);
        }
        return true;
    }
    const std::string& error() const override { return error_; }

    std::int64_t frames() const { return frames_; }
    std::int64_t verdicts(Verdict verdict) const { return verdicts_[static_cast<std::size_t>(verdict)]; }
    std::int64_t reasons(Reason reason) const { return reasons_[static_cast<std::size_t>(reason)]; }
    // Mean share of the mask's pixels in a class.
    double share(TerrainClass kind) const {
        return frames_ > 0 ? share_sum_[static_cast<std::size_t>(kind)] / static_cast<double>(frames_) : 0.0;
    }
    // Of the frames whose ground was found in metres, in order.
    const std::vector<double>& heights_m() const { return heights_m_; }
    const std::vector<double>& pitches_rad() const { return pitches_rad_; }

  private:
    std::int64_t frames_ = 0;
    std::array<std::int64_t, kVerdictNames.size()> verdicts_{};
    std::array<std::int64_t, static_cast<std::size_t>(kReasons)> reasons_{};
    std::array<double, kTerrainClasses> share_sum_{};
    std::vector<double> heights_m_;
    std::vector<double> pitches_rad_;
    std::string error_;
};

}  // namespace groundline::cli
