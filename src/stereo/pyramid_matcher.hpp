// The coarse-to-fine census matcher: half the resolution first, then a narrow band around its answer. Equal
// to pyramid_integer.hpp bit for bit.
#pragma once

#include <vector>

#include "stereo/census_matcher.hpp"
#include "stereo/matcher.hpp"
#include "stereo/speckle.hpp"

namespace groundline::stereo {

namespace kernels {
struct Prediction;
struct CensusPair;
}  // namespace kernels

class PyramidMatcher final : public Matcher {
  public:
    // Configuration as checked by make_matcher.
    PyramidMatcher(const MatcherConfig& config, int width, int height, int lanes, Arena& arena);
    ~PyramidMatcher() override;

    void match(ConstLuma left, ConstLuma right, const DisparityMap& out, Parallel& parallel) override;
    std::size_t state_bytes() const override { return state_bytes_; }
    int min_disparity() const override { return config_.min_disparity; }
    int disparities() const override { return config_.disparities; }

  private:
    struct Lane;
    struct Part;

    void find_thin(ConstLuma left, ConstLuma right, const Part& part, Lane& lane) const;
    void widen_thin(const kernels::CensusPair* rows, const std::uint8_t* predicted, std::uint8_t* thin) const;
    void refine(ConstLuma left, ConstLuma right, const Part& part, Lane& lane, const DisparityMap& out) const;
    void predict(int y, bool with_thin, const kernels::Prediction& out) const;
    void answer(int y, Lane& lane, const DisparityMap& out) const;

    MatcherConfig config_;
    int width_ = 0;
    int height_ = 0;
    Luma half_left_;
    Luma half_right_;
    DisparityMap coarse_map_;
    ImageView<std::uint8_t> thin_;  // for every kThinStep-th row: index that replaces the prediction, 0: none
    std::unique_ptr<CensusMatcher> coarse_;
    std::vector<Lane> lanes_;
    SpeckleScratch speckles_;
    std::span<std::int16_t> median_rows_;  // two rows, for the median
    std::size_t state_bytes_ = 0;
};

}  // namespace groundline::stereo
