// The paper's matcher for use: equal to paper_integer.hpp bit for bit, streaming, without a cost volume.
#pragma once

#include <span>
#include <vector>

#include "stereo/matcher.hpp"
#include "stereo/paper_integer.hpp"
#include "stereo/speckle.hpp"

namespace groundline::stereo {

class PaperMatcher final : public Matcher {
  public:
    // Rows that one task matches. Fixed, so that the split into tasks follows from the image height alone.
    static constexpr int kBandRows = 24;

    // Configuration as checked by make_matcher. `band_rows` >= 1 never changes the result.
    PaperMatcher(const MatcherConfig& config, int width, int height, int lanes, Arena& arena,
                 int band_rows = kBandRows);
    ~PaperMatcher() override;

    void match(ConstLuma left, ConstLuma right, const DisparityMap& out, Parallel& parallel) override;
    std::size_t state_bytes() const override { return state_bytes_; }
    int min_disparity() const override { return config_.min_disparity; }
    int disparities() const override { return config_.disparities; }

  private:
    struct Lane;
    struct Pair;

    void search(const Pair& pair, int first, int last, Lane& lane) const;
    void aggregate(int k, int first, int last, Lane& lane) const;
    void refine(int k, int first, int last, Lane& lane) const;
    void select(int k, int rows, Lane& lane) const;
    void answer_row(const std::int16_t* index, int y, const DisparityMap& out) const;
    void judge_row(const Pair& pair, int y, bool fresh, int row, Lane& lane, const DisparityMap& out) const;

    MatcherConfig config_;
    WindowTaps taps_;
    int width_ = 0;
    int height_ = 0;
    int band_rows_ = 0;
    std::vector<Lane> lanes_;
    Luma plain_left_;  // without local mean; empty when not asked for
    Luma plain_right_;
    SpeckleScratch speckles_;
    std::span<std::int16_t> median_rows_;  // two rows, for the median
    std::size_t state_bytes_ = 0;
};

}  // namespace groundline::stereo
