#include "cli/compared_matchers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <set>
#include <utility>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/error.hpp"
#include "stereo/matcher.hpp"

namespace groundline::cli {
namespace {

// Ours: a row for each kind that the tables show.
struct OurMethod {
    const char* name;
    stereo::MatcherKind kind;
    bool local_mean;  // taken out of both views first
};
constexpr std::array kOurs = {
    OurMethod{"paper", stereo::MatcherKind::kPaper, false},
    OurMethod{"paper_local_mean", stereo::MatcherKind::kPaper, true},
    OurMethod{"census", stereo::MatcherKind::kCensus, false},
    OurMethod{"census_pyramid", stereo::MatcherKind::kCensusPyramid, false},
};

// OpenCV's, with what differs between them. Uniqueness in per cent.
enum class OpenCvMethod { kBlock, kSemiGlobal };
struct OpenCvChoice {
    const char* name;
    OpenCvMethod method;
    int mode;    // of StereoSGBM
    int window;  // px
    int uniqueness;
    int texture;        // StereoBM only
    int speckle_px;     // 0: no such test; else patches within a range of 1
    int left_right_px;  // -1: no such test
};
constexpr std::array kOpenCv = {
    OpenCvChoice{"bm11/dense", OpenCvMethod::kBlock, 0, 11, 0, 0, 0, -1},
    OpenCvChoice{"bm15/filtered", OpenCvMethod::kBlock, 0, 15, 10, 10, 100, 1},
    OpenCvChoice{"sgbm_3way/dense", OpenCvMethod::kSemiGlobal, cv::StereoSGBM::MODE_SGBM_3WAY, 5, 0, 0, 0,
                 -1},
    OpenCvChoice{"sgbm_3way/filtered", OpenCvMethod::kSemiGlobal, cv::StereoSGBM::MODE_SGBM_3WAY, 5, 10, 0,
                 100, 1},
    OpenCvChoice{"sgbm_hh/filtered", OpenCvMethod::kSemiGlobal, cv::StereoSGBM::MODE_HH, 5, 10, 0, 100, 1},
};
constexpr int kSpeckleRange = 1;       // px within which neighbours belong together
constexpr int kStepPenalty = 8 * 25;   // P1 of StereoSGBM
constexpr int kJumpPenalty = 32 * 25;  // P2

// 0 means no answer, so the answer 0 is stored as the smallest there is.
std::uint16_t stored(int disparity_q4) {
    return static_cast<std::uint16_t>(std::clamp(disparity_q4 * (256 / kDisparityOne), 1, 65535));
}

class Ours final : public ComparedMatcher {
  public:
    Ours(const OurMethod& method, bool checks, const MatchSize& size, Parallel& parallel)
        : parallel_(parallel), map_(DisparityMap::make(arena_, size.width, size.height)) {
        stereo::MatcherConfig config;
        config.kind = method.kind;
        config.min_disparity = size.min_disparity;
        config.disparities = size.disparities;
        config.normalise_local_mean = method.local_mean;
        config.checks = checks;
        matcher_ = stereo::make_matcher(config, size.width, size.height, parallel.lanes(), arena_);
    }
    void match(ConstLuma left, ConstLuma right) override { matcher_->match(left, right, map_, parallel_); }
    void answers(ImageView<std::uint16_t> disparity_q8) const override {
        assert(disparity_q8.same_size(map_.width(), map_.height()));
        for (int y = 0; y < map_.height(); ++y)
            for (int x = 0; x < map_.width(); ++x)
                disparity_q8.at(x, y) =
                    map_.invalid.at(x, y) == Invalid::kNone ? stored(map_.disparity_q4.at(x, y)) : 0;
    }

  private:
    Arena arena_;
    Parallel& parallel_;
    DisparityMap map_;
    std::unique_ptr<stereo::Matcher> matcher_;
};

cv::Mat mat(ConstLuma image) {
    // OpenCV knows no matrix of constant pixels; compute() only reads them.
    auto* pixels = const_cast<std::uint8_t*>(image.data);  // NOLINT
    return {image.height, image.width, CV_8UC1, pixels, static_cast<std::size_t>(image.stride)};
}

class OpenCv final : public ComparedMatcher {
  public:
    OpenCv(const OpenCvChoice& choice, const MatchSize& size)
        : min_disparity_(size.min_disparity),
          repeated_(size.repeat_left ? std::max(0, size.min_disparity + size.disparities) : 0) {
        if (choice.method == OpenCvMethod::kBlock) {
            const cv::Ptr<cv::StereoBM> block = cv::StereoBM::create(size.disparities, choice.window);
            block->setUniquenessRatio(choice.uniqueness);
            block->setTextureThreshold(choice.texture);
            block->setSpeckleRange(kSpeckleRange * cv::StereoMatcher::DISP_SCALE);  // StereoBM counts 1/16 px
            matcher_ = block;
        } else {
            matcher_ = cv::StereoSGBM::create(0, size.disparities, choice.window, kStepPenalty, kJumpPenalty,
                                              0, 0, choice.uniqueness, 0, 0, choice.mode);
            matcher_->setSpeckleRange(kSpeckleRange);
        }
        matcher_->setMinDisparity(size.min_disparity);
        matcher_->setDisp12MaxDiff(choice.left_right_px);
        matcher_->setSpeckleWindowSize(choice.speckle_px);
    }
    void match(ConstLuma left, ConstLuma right) override {
        if (repeated_ == 0) {
            matcher_->compute(mat(left), mat(right), found_);
            return;
        }
        cv::copyMakeBorder(mat(left), left_, 0, 0, repeated_, 0, cv::BORDER_REPLICATE);
        cv::copyMakeBorder(mat(right), right_, 0, 0, repeated_, 0, cv::BORDER_REPLICATE);
        matcher_->compute(left_, right_, wide_);
        found_ = wide_.colRange(repeated_, wide_.cols);
    }
    void answers(ImageView<std::uint16_t> disparity_q8) const override {
        assert(disparity_q8.same_size(found_.cols, found_.rows));
        static_assert(kDisparityOne == cv::StereoMatcher::DISP_SCALE);
        for (int y = 0; y < found_.rows; ++y)
            for (int x = 0; x < found_.cols; ++x) {
                const int disparity_q4 = found_.at<std::int16_t>(y, x);
                const bool answered = disparity_q4 > (min_disparity_ - 1) * kDisparityOne;
                disparity_q8.at(x, y) = answered ? stored(disparity_q4) : 0;
            }
    }

  private:
    int min_disparity_;
    int repeated_;  // columns
    cv::Ptr<cv::StereoMatcher> matcher_;
    cv::Mat left_;
    cv::Mat right_;
    cv::Mat wide_;
    cv::Mat found_;
};

std::string parameters_of(const OpenCvChoice& choice) {
    const std::string tests = fmt::format(
        "uniqueness {} %, left-right {}, speckle {}", choice.uniqueness,
        choice.left_right_px < 0 ? "off" : fmt::format("{} px", choice.left_right_px),
        choice.speckle_px == 0 ? "off" : fmt::format("{} px within {} px", choice.speckle_px, kSpeckleRange));
    if (choice.method == OpenCvMethod::kBlock)
        return fmt::format("OpenCV StereoBM {0}x{0}, texture {1}, {2}", choice.window, choice.texture, tests);
    return fmt::format("OpenCV StereoSGBM {0} {1}x{1}, P1 {2}, P2 {3}, {4}",
                       choice.mode == cv::StereoSGBM::MODE_HH ? "MODE_HH" : "MODE_SGBM_3WAY", choice.window,
                       kStepPenalty, kJumpPenalty, tests);
}

std::vector<MatcherChoice> all_matchers() {
    std::vector<MatcherChoice> all;
    for (const OurMethod& method : kOurs)
        for (const bool checks : {false, true})
            all.push_back(
                {fmt::format("{}/{}", method.name, checks ? "filtered" : "dense"),
                 fmt::format("groundline's{}, checks {}", method.local_mean ? ", local mean removed" : "",
                             checks ? "as by default" : "off"),
                 true, [&method, checks](const MatchSize& size, Parallel& parallel) {
                     return std::make_unique<Ours>(method, checks, size, parallel);
                 }});
    for (const OpenCvChoice& choice : kOpenCv)
        all.push_back(
            {choice.name, parameters_of(choice), false,
             [&choice](const MatchSize& size, Parallel&) { return std::make_unique<OpenCv>(choice, size); }});
    return all;
}

bool fits(const MatcherChoice& choice, const std::string& name) {
    return choice.name == name || choice.name.starts_with(name + "/");
}

}  // namespace

const std::vector<MatcherChoice>& compared_matchers() {
    static const std::vector<MatcherChoice> all = all_matchers();
    return all;
}

std::vector<MatcherChoice> choose_matchers(const std::vector<std::string>& names) {
    const std::vector<MatcherChoice>& all = compared_matchers();
    for (const std::string& name : names) {
        if (std::any_of(all.begin(), all.end(),
                        [&](const MatcherChoice& choice) { return fits(choice, name); }))
            continue;
        std::string known;
        for (const MatcherChoice& choice : all)
            known += (known.empty() ? "" : ", ") + choice.name;
        throw Refusal(ExitStatus::kUsage,
                      fmt::format("no matcher is called '{}'; there are {}", name, known));
    }
    std::vector<MatcherChoice> chosen;
    for (const MatcherChoice& choice : all)
        if (names.empty() || std::any_of(names.begin(), names.end(),
                                         [&](const std::string& name) { return fits(choice, name); }))
            chosen.push_back(choice);
    return chosen;
}

}  // namespace groundline::cli
