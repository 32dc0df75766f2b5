#include "io/png.hpp"

#include <fmt/core.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>

#include "io/atomic_file.hpp"
#include "io/image_decoder.hpp"

namespace groundline::io {
namespace {

void write_matrix(const std::filesystem::path& path, const cv::Mat& image) {
    std::vector<std::uint8_t> encoded;
    try {
        // Without parameters OpenCV takes zlib's level 1, run lengths and one filter. Asking for level 1 by
        // number turns on the trial of all five filters: twice the time for files of the same size.
        if (!cv::imencode(".png", image, encoded)) encoded.clear();
    } catch (const cv::Exception&) {
        encoded.clear();
    }
    if (encoded.empty())
        throw std::runtime_error(
            fmt::format("cannot write '{}': the picture ({}x{}) cannot be encoded as PNG", path.string(),
                        image.cols, image.rows));
    write_file_whole(path, encoded);
}

// The views are only read; OpenCV's matrix has no const form.
template <typename T>
cv::Mat matrix_of(const ConstImageView<T>& image, int type) {
    return {image.height, image.width, type, const_cast<T*>(image.data),
            static_cast<std::size_t>(image.stride) * sizeof(T)};
}

}  // namespace

void write_png(const std::filesystem::path& path, ConstLuma image) {
    write_matrix(path, matrix_of(image, CV_8UC1));
}

void write_png(const std::filesystem::path& path, ConstImageView<std::uint16_t> image) {
    write_matrix(path, matrix_of(image, CV_16UC1));
}

void write_png(const std::filesystem::path& path, ConstMask image) {
    static_assert(sizeof(TerrainClass) == 1);
    write_matrix(path, matrix_of(image, CV_8UC1));
}

void write_png(const std::filesystem::path& path, const BgrView& image) {
    write_matrix(path,
                 {image.height, image.width, CV_8UC3, image.data, static_cast<std::size_t>(image.stride)});
}

Image8 read_image(const std::filesystem::path& path) {
    ImageDecoder decoder;
    const ImageShape shape = decoder.load(path);
    Image8 image;
    image.width = shape.width;
    image.height = shape.height;
    image.channels = shape.colour ? 3 : 1;
    const int row_bytes = shape.width * image.channels;
    image.bytes.resize(static_cast<std::size_t>(row_bytes) * static_cast<std::size_t>(shape.height));
    if (shape.colour)
        decoder.copy_bgr({image.bytes.data(), shape.width, shape.height, row_bytes});
    else
        decoder.copy_luma({image.bytes.data(), shape.width, shape.height, row_bytes});
    return image;
}

Image8 read_luma_png(const std::filesystem::path& path) {
    ImageDecoder decoder;
    const ImageShape shape = decoder.load(path);
    Image8 image;
    image.width = shape.width;
    image.height = shape.height;
    image.bytes.resize(static_cast<std::size_t>(shape.width) * static_cast<std::size_t>(shape.height));
    decoder.copy_luma({image.bytes.data(), shape.width, shape.height, shape.width});
    return image;
}

Image16 read_png16(const std::filesystem::path& path) {
    ImageDecoder decoder;
    const ImageShape shape = decoder.load(path);
    if (shape.bits != 16 || shape.colour)
        throw std::runtime_error(
            fmt::format("cannot read '{}': expected a grey image of 16 bits, found {} of {} bits",
                        path.string(), shape.colour ? "colour" : "grey", shape.bits));
    Image16 image;
    image.width = shape.width;
    image.height = shape.height;
    image.pixels.resize(static_cast<std::size_t>(shape.width) * static_cast<std::size_t>(shape.height));
    decoder.copy_samples({image.pixels.data(), shape.width, shape.height, shape.width});
    return image;
}

}  // namespace groundline::io
