// `groundline evaluate --matchers`: how well every matcher does on every set with truth, clean and disturbed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cli/evaluation.hpp"

namespace groundline::cli {

struct MatcherTableOptions {
    std::filesystem::path suite;
    std::vector<std::string> sets;        // patterns or beginnings of names; empty: all with truth
    std::vector<std::string> matchers;    // names as choose_matchers() takes them; empty: all
    std::vector<std::string> conditions;  // names; empty: all
    int disparities = 0;                  // 0: what a replay takes for each set by itself
    bool json = false;
};

// What one set gave.
struct SetScores {
    std::string name;
    int status = 0;       // an exit status
    std::string problem;  // empty: it was matched
    int frames = 0;       // scored; none of them where there was a problem
    int disparities = 0;
    bool sparse = false;                 // less than half of the pixels have truth
    std::vector<std::string> remarks;    // a sentence on each frame left out
    std::vector<DisparityScore> scores;  // condition by condition, in each matcher by matcher
};

// Shares of the scored pixels, or with `of answered` of those; none where there was nothing to measure.
struct MatcherFigures {
    std::optional<double> density;
    std::optional<double> bad1;  // of answered
    std::optional<double> bad3;  // of answered
    std::optional<double> bad1_with_absent;
    std::optional<double> bad3_with_absent;
};

// Sets whose names have the same beginning up to the first underscore. Where the truth of all is sparse they
// are pooled, each pixel weighs alike; else the figures are the mean over the sets that have them.
struct MatcherGroup {
    std::string name;
    std::vector<std::string> sets;  // those that were matched
    int frames = 0;
    int fewest_disparities = 0;
    int most_disparities = 0;
    bool pooled = false;
    std::int64_t scored = 0;              // pixels under one condition, all frames together
    std::vector<MatcherFigures> figures;  // in the order of the scores
};

// Of the noise: the same number for the same pair in every suite.
std::uint64_t pair_number(std::string_view set, std::int64_t frame);

MatcherFigures figures_of(const DisparityScore& score);
std::vector<MatcherGroup> grouped(const std::vector<SetScores>& sets);

// Runs every matcher under every condition on the rectified pairs of every set, one thread each, prints the
// table or JSON to stdout and what is missing to stderr. The same text on every run. Returns 0; 66 where a
// frame could not be read; the first status of a set that could not be matched (the others are); 130 when
// interrupted, with the sets finished until then printed. Throws Refusal: kUsage for an unknown matcher or
// condition, kInput as truth_sets() does.
int run_matcher_table(const MatcherTableOptions& options);

}  // namespace groundline::cli
