// The matchers that the benchmark and the accuracy table set side by side: ours and OpenCV's, under one name.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/image.hpp"
#include "core/parallel.hpp"

namespace groundline::cli {

// Pictures, and the disparities searched in them: min_disparity .. min_disparity + disparities - 1 px.
struct MatchSize {
    int width = 0;
    int height = 0;
    int min_disparity = 0;
    int disparities = 0;  // multiple of 16
    // Give OpenCV's matchers both views with their first column repeated to the left, as often as the range
    // reaches: by themselves they answer nothing in so many columns.
    bool repeat_left = false;
};

// A matcher for pictures of one size, with its memory.
class ComparedMatcher {
  public:
    ComparedMatcher() = default;
    ComparedMatcher(const ComparedMatcher&) = delete;
    ComparedMatcher& operator=(const ComparedMatcher&) = delete;
    virtual ~ComparedMatcher() = default;

    // Matches one rectified pair and keeps the answers: the part worth timing.
    virtual void match(ConstLuma left, ConstLuma right) = 0;
    // The answers of the last match() as a replay writes them: 1/256 px, at least 1; 0 where there is none.
    virtual void answers(ImageView<std::uint16_t> disparity_q8) const = 0;
};

struct MatcherChoice {
    std::string name;        // METHOD/dense: nothing tested; METHOD/filtered: with its tests
    std::string parameters;  // fixed, for people
    bool ours = false;
    // The maker borrows `parallel`, whose lanes our matchers share; OpenCV's take what cv::setNumThreads()
    // says. Throws Refusal(kConfig) for a size that ours cannot match.
    std::function<std::unique_ptr<ComparedMatcher>(const MatchSize& size, Parallel& parallel)> make;
};

// All, in the order of the tables.
const std::vector<MatcherChoice>& compared_matchers();

// Those whose name is, or up to its slash is, one of `names`; all for no names. In the order of the tables.
// Throws Refusal(kUsage) for a name that fits none.
std::vector<MatcherChoice> choose_matchers(const std::vector<std::string>& names);

}  // namespace groundline::cli
