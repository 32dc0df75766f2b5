// Real pairs with truth from ../shared/data, which is not everywhere.
#pragma once

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "core/image.hpp"

namespace groundline::stereo {

struct RealPair {
    cv::Mat left;
    cv::Mat right;
    cv::Mat truth;  // 1/256 px, 0 where unknown
};

inline ConstLuma view_of(const cv::Mat& image) {
    return {image.data, image.cols, image.rows, static_cast<std::ptrdiff_t>(image.step)};
}

// Empty where the data is not there.
inline RealPair load(const std::string& name) {
    const std::string folder = std::string(GROUNDLINE_SOURCE_DIR "/../shared/data/") + name;
    if (!std::filesystem::exists(folder + "/disp.png")) return {};
    return {cv::imread(folder + "/left.png", cv::IMREAD_GRAYSCALE),
            cv::imread(folder + "/right.png", cv::IMREAD_GRAYSCALE),
            cv::imread(folder + "/disp.png", cv::IMREAD_UNCHANGED)};
}

}  // namespace groundline::stereo
