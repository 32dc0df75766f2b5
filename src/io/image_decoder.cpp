#include "io/image_decoder.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "io/atomic_file.hpp"
#include "io/image_integrity.hpp"

namespace groundline::io {
namespace {

// What goes wrong is told once, in our own sentence; OpenCV would print its own lines beside it.
void quiet_opencv() {
    [[maybe_unused]] static const auto before =
        cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
}

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& why) {
    throw std::runtime_error(fmt::format("cannot read the image '{}': {}", path.string(), why));
}

// One sample as 8 bits.
unsigned narrow(std::uint8_t sample) {
    return sample;
}
unsigned narrow(std::uint16_t sample) {
    return sample >> 8U;
}

template <typename Sample>
void luma_rows(const cv::Mat& from, Luma to) {
    const int channels = from.channels();
    for (int y = 0; y < to.height; ++y) {
        const auto* source = from.ptr<Sample>(y);
        std::uint8_t* target = to.row(y);
        if (channels == 1) {
            for (int x = 0; x < to.width; ++x)
                target[x] = static_cast<std::uint8_t>(narrow(source[x]));
        } else {
            for (int x = 0; x < to.width; ++x, source += channels)
                target[x] = luma_of(narrow(source[2]), narrow(source[1]), narrow(source[0]));
        }
    }
}

template <typename Sample>
void bgr_rows(const cv::Mat& from, const BgrView& to) {
    const int channels = from.channels();
    for (int y = 0; y < to.height; ++y) {
        const auto* source = from.ptr<Sample>(y);
        std::uint8_t* target = to.row(y);
        for (int x = 0; x < to.width; ++x, source += channels, target += 3)
            for (int channel = 0; channel < 3; ++channel)
                target[channel] = static_cast<std::uint8_t>(narrow(source[channels == 1 ? 0 : channel]));
    }
}

}  // namespace

void luma_from_bgr(const BgrView& from, Luma to) {
    for (int y = 0; y < to.height; ++y) {
        const std::uint8_t* source = from.row(y);
        std::uint8_t* target = to.row(y);
        for (int x = 0; x < to.width; ++x, source += 3)
            target[x] = luma_of(source[2], source[1], source[0]);
    }
}

struct ImageDecoder::Buffers {
    std::vector<std::uint8_t> file;
    cv::Mat decoded;
};

ImageDecoder::ImageDecoder() : buffers_(std::make_unique<Buffers>()) {
    quiet_opencv();
}

ImageDecoder::~ImageDecoder() = default;

ImageShape ImageDecoder::load(const std::filesystem::path& path) {
    std::vector<std::uint8_t>& file = buffers_->file;
    cv::Mat& image = buffers_->decoded;
    read_file_whole(path, file);
    if (const std::string fault = image_fault(file); !fault.empty()) refuse(path, fault);
    try {
        const cv::Mat bytes(1, static_cast<int>(file.size()), CV_8UC1, file.data());
        // A matrix of another size is given up by the decoder's own allocation, one of the same size reused.
        if (cv::imdecode(bytes, cv::IMREAD_UNCHANGED, &image).empty()) image.release();
    } catch (const cv::Exception&) {
        image.release();
    }
    if (image.empty()) refuse(path, "its data cannot be decoded (damaged or truncated file)");
    if (image.depth() != CV_8U && image.depth() != CV_16U)
        refuse(path, "its samples have neither 8 nor 16 bits without sign");
    if (image.channels() == 2) refuse(path, "it has two channels; expected grey or colour");
    return {image.cols, image.rows, image.channels() >= 3, image.depth() == CV_8U ? 8 : 16};
}

void ImageDecoder::copy_luma(Luma to) const {
    const cv::Mat& image = buffers_->decoded;
    if (image.depth() == CV_8U)
        luma_rows<std::uint8_t>(image, to);
    else
        luma_rows<std::uint16_t>(image, to);
}

void ImageDecoder::copy_bgr(const BgrView& to) const {
    const cv::Mat& image = buffers_->decoded;
    if (image.depth() == CV_8U)
        bgr_rows<std::uint8_t>(image, to);
    else
        bgr_rows<std::uint16_t>(image, to);
}

void ImageDecoder::copy_samples(const ImageView<std::uint16_t>& to) const {
    for (int y = 0; y < to.height; ++y) {
        const auto* source = buffers_->decoded.ptr<std::uint16_t>(y);
        std::copy(source, source + to.width, to.row(y));
    }
}

}  // namespace groundline::io
