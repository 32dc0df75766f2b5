// Shared by the stereo tests: running a matcher once, comparing results, lanes in disorder.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <numeric>
#include <random>
#include <thread>
#include <vector>

#include "core/arena.hpp"
#include "core/parallel.hpp"
#include "stereo/census_integer.hpp"
#include "stereo/matcher.hpp"
#include "stereo/paper_integer.hpp"
#include "stereo/paper_matcher.hpp"
#include "stereo/pyramid_integer.hpp"
#include "support/random_images.hpp"

namespace groundline::stereo {

// A result with the memory it lies in.
struct OwnedResult {
    std::unique_ptr<Arena> arena = std::make_unique<Arena>();
    DisparityMap map;

    OwnedResult(int width, int height) : map(DisparityMap::make(*arena, width, height)) {
        // What a match must overwrite.
        fill_pixels(map.disparity_q4, std::int16_t{-12345});
        fill_pixels(map.invalid, Invalid::kCount);
    }
    int whole(int x, int y) const { return map.disparity_q4.at(x, y) / kDisparityOne; }
    Invalid reason(int x, int y) const { return map.invalid.at(x, y); }
};

inline OwnedResult match_fast(const MatcherConfig& config, ConstLuma left, ConstLuma right) {
    OwnedResult result(left.width, left.height);
    Arena arena;
    Serial serial;
    make_matcher(config, left.width, left.height, 1, arena)->match(left, right, result.map, serial);
    return result;
}

inline OwnedResult match_plain(const MatcherConfig& config, ConstLuma left, ConstLuma right) {
    OwnedResult result(left.width, left.height);
    if (config.kind == MatcherKind::kCensus)
        match_census_integer(config, left, right, result.map);
    else if (config.kind == MatcherKind::kCensusPyramid)
        match_pyramid_integer(config, left, right, result.map);
    else
        match_paper_integer(config, left, right, result.map);
    return result;
}

inline int differing_pixels(const OwnedResult& a, const OwnedResult& b) {
    int count = 0;
    for (int y = 0; y < a.map.height(); ++y)
        for (int x = 0; x < a.map.width(); ++x)
            if (a.map.disparity_q4.at(x, y) != b.map.disparity_q4.at(x, y) ||
                a.reason(x, y) != b.reason(x, y))
                ++count;
    return count;
}

inline int count_reason(const OwnedResult& result, Invalid reason) {
    int count = 0;
    for (int y = 0; y < result.map.height(); ++y)
        for (int x = 0; x < result.map.width(); ++x)
            count += result.reason(x, y) == reason ? 1 : 0;
    return count;
}

// The paper's matcher with everything else at its default.
inline MatcherConfig paper() {
    MatcherConfig config;
    config.kind = MatcherKind::kPaper;
    return config;
}

// The paper and nothing else.
inline MatcherConfig pure(int disparities) {
    MatcherConfig config = paper();
    config.disparities = disparities;
    config.checks = false;
    return config;
}

// Tasks in a shuffled order on lanes drawn at random, on one thread.
class ShuffledLanes final : public Parallel {
  public:
    ShuffledLanes(int lanes, std::uint32_t seed) : lanes_(lanes), random_(seed) {}
    int lanes() const override { return lanes_; }
    void for_each(int count, FunctionRef<void(int, int)> task) override {
        std::vector<int> order(static_cast<std::size_t>(count));
        std::iota(order.begin(), order.end(), 0);
        for (std::size_t i = order.size(); i > 1; --i)
            std::swap(order[i - 1], order[random_() % i]);
        for (const int index : order)
            task(index, static_cast<int>(random_() % static_cast<std::uint32_t>(lanes_)));
    }

  private:
    int lanes_;
    std::mt19937 random_;
};

// One thread per lane; lane l takes tasks l, l + lanes, ...
class ThreadedLanes final : public Parallel {
  public:
    explicit ThreadedLanes(int lanes) : lanes_(lanes) {}
    int lanes() const override { return lanes_; }
    void for_each(int count, FunctionRef<void(int, int)> task) override {
        std::vector<std::thread> threads;
        for (int lane = 0; lane < lanes_; ++lane)
            threads.emplace_back([=, this] {
                for (int index = lane; index < count; index += lanes_)
                    task(index, lane);
            });
        for (std::thread& thread : threads)
            thread.join();
    }

  private:
    int lanes_;
};

// Every reading of the paper that can be switched.
inline std::vector<PaperReading> all_readings() {
    std::vector<PaperReading> readings;
    for (const RuleOne one : {RuleOne::kOff, RuleOne::kMean9, RuleOne::kSum9})
        for (const RuleTwo two : {RuleTwo::kOff, RuleTwo::kSevenOfEight, RuleTwo::kSevenOfNine})
            for (const bool at_once : {false, true})
                readings.push_back({one, two, at_once, Window::kGauss5, 10});
    readings.push_back({RuleOne::kMean9, RuleTwo::kSevenOfEight, false, Window::kGauss55, 10});
    readings.push_back({RuleOne::kMean9, RuleTwo::kSevenOfEight, false, Window::kBox, 10});
    readings.push_back({RuleOne::kMean9, RuleTwo::kSevenOfEight, false, Window::kGauss5, 1});
    readings.push_back({RuleOne::kMean9, RuleTwo::kSevenOfEight, false, Window::kGauss5, 28});
    readings.push_back({RuleOne::kSum9, RuleTwo::kSevenOfEight, false, Window::kBox, 14});
    return readings;
}

// A scene of three depths with a slant, noise in the right view.
inline test::OwnedPair stepped_pair(int width, int height, std::uint32_t seed, int offset = 0,
                                    int extra = 0) {
    test::OwnedPair pair = test::warped_pair(
        width, height, seed,
        [=](int x, int y) {
            if (x > width / 2 && y > height / 3 && y < height * 2 / 3) return offset + 19;
            return offset + 4 + 6 * y / height;
        },
        extra);
    test::add_noise(pair.right, seed + 1, 3);
    return pair;
}

}  // namespace groundline::stereo
