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

// The image with padding behind each row, as image.hpp wants it.
inline cv::Mat padded(const cv::Mat& image) {
    const cv::Mat wide(image.rows, image.cols + static_cast<int>(kRowPadding), CV_8UC1, cv::Scalar(0));
    const cv::Mat part = wide.colRange(0, image.cols);
    image.copyTo(part);
    return part;
}

// Empty where the data is not there.
inline RealPair load(const std::string& name) {
    const std::string folder = std::string(GROUNDLINE_SOURCE_DIR "/../shared/data/") + name;
    if (!std::filesystem::exists(folder + "/disp.png")) return {};
    return {padded(cv::imread(folder + "/left.png", cv::IMREAD_GRAYSCALE)),
            padded(cv::imread(folder + "/right.png", cv::IMREAD_GRAYSCALE)),
            cv::imread(folder + "/disp.png", cv::IMREAD_UNCHANGED)};
}

}  // namespace groundline::stereo
