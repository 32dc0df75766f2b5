#include "stereo/matcher.hpp"

#include <algorithm>
#include <cstdlib>
#include <string>

#include "core/error.hpp"
#include "stereo/census_kernels.hpp"
#include "stereo/census_matcher.hpp"
#include "stereo/paper_matcher.hpp"
#include "stereo/pyramid_matcher.hpp"

namespace groundline::stereo {
namespace {

void refuse(const std::string& sentence) {
    throw Refusal(ExitStatus::kConfig, sentence);
}

void check(const MatcherConfig& config, int width, int height) {
    constexpr int kWindow = 2 * kWindowReach + 1;
    const std::string size = std::to_string(width) + "x" + std::to_string(height);
    if (width < kWindow || height < kWindow)
        refuse("images of " + size + " px are too small to match: at least 11x11 px are needed");
    if (config.disparities < 16 || config.disparities > 256 || config.disparities % 16 != 0)
        refuse("the number of disparities is " + std::to_string(config.disparities) +
               "; it must be a multiple of 16 from 16 to 256");
    const long first = config.min_disparity;
    const long last = first + config.disparities - 1;
    if (std::max(std::labs(first), last + 1) >= width)
        refuse("disparities " + std::to_string(first) + " to " + std::to_string(last) +
               " px cannot be searched in images of " + size +
               " px: the range must be smaller than the width; lower the number of disparities");
    if (last > 2046 || first < -2046)
        refuse("disparities " + std::to_string(first) + " to " + std::to_string(last) +
               " px do not fit the result: they must stay within -2046 to 2046");
    if (config.kind != MatcherKind::kPaper) {
        if (config.normalise_local_mean)
            refuse(
                "the local mean is taken out for the paper's matcher alone: census words do not depend on "
                "brightness; set stereo.normalise=off, or stereo.matcher=paper");
        if (width > kernels::kMostCensusWidth)
            refuse("images of " + size + " px are too wide for the census matchers: at most " +
                   std::to_string(kernels::kMostCensusWidth) + " px");
        return;
    }
    const int highest = config.paper.rule_one == RuleOne::kSum9 ? 14 : 28;
    if (config.paper.truncation < 1 || config.paper.truncation > highest)
        refuse("the truncation of the paper's cost is " + std::to_string(config.paper.truncation) +
               " grey levels; it must be 1 to " + std::to_string(highest));
}

}  // namespace

MatcherConfig resolved(const MatcherConfig& config) {
    MatcherConfig result = config;
    const bool paper = config.kind == MatcherKind::kPaper;
    CheckLimits& limits = result.limits;
    if (limits.saturated_percent == CheckLimits::kMatchersOwn) limits.saturated_percent = paper ? 25 : 75;
    if (limits.uniqueness_percent == CheckLimits::kMatchersOwn) limits.uniqueness_percent = paper ? 5 : -1;
    return result;
}

std::unique_ptr<Matcher> make_matcher(const MatcherConfig& config, int width, int height, int lanes,
                                      Arena& arena) {
    check(config, width, height);
    if (config.kind == MatcherKind::kCensus)
        return std::make_unique<CensusMatcher>(config, width, height, lanes, arena);
    if (config.kind == MatcherKind::kCensusPyramid)
        return std::make_unique<PyramidMatcher>(config, width, height, lanes, arena);
    return std::make_unique<PaperMatcher>(config, width, height, lanes, arena);
}

}  // namespace groundline::stereo
