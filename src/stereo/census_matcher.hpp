// The census matcher: semi-global matching of census words in one pass from top to bottom, without a cost
// volume. Equal to census_integer.hpp bit for bit.
#pragma once

#include <span>
#include <vector>

#include "stereo/matcher.hpp"
#include "stereo/speckle.hpp"

namespace groundline::stereo {

class CensusMatcher final : public Matcher {
  public:
    enum class Use : std::uint8_t {
        kWhole,
        kCoarse,  // of a pyramid: answers stay beside reasons, windows and speckles are not judged
    };
    // Configuration as checked by make_matcher.
    CensusMatcher(const MatcherConfig& config, int width, int height, int lanes, Arena& arena,
                  Use use = Use::kWhole);
    ~CensusMatcher() override;

    void match(ConstLuma left, ConstLuma right, const DisparityMap& out, Parallel& parallel) override;
    std::size_t state_bytes() const override { return state_bytes_; }
    int min_disparity() const override { return config_.min_disparity; }
    int disparities() const override { return config_.disparities; }

  private:
    struct Lane;

    void match_band(ConstLuma left, ConstLuma right, int number, Lane& lane, const DisparityMap& out) const;

    MatcherConfig config_;
    bool coarse_ = false;
    int width_ = 0;
    int height_ = 0;
    std::vector<Lane> lanes_;
    SpeckleScratch speckles_;
    std::span<std::int16_t> median_rows_;  // two rows, for the median
    std::size_t state_bytes_ = 0;
};

}  // namespace groundline::stereo
