// Pictures and an encoder for tests that need JPEGs.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "core/image.hpp"
// clang-format off
#include <jpeglib.h>
// clang-format on

namespace groundline::capture::test {

struct Picture {
    Picture(int w, int h) : width(w), height(h), memory(static_cast<std::size_t>(w * h)) {}
    Luma view() { return {memory.data(), width, height, width}; }
    int width;
    int height;
    std::vector<std::uint8_t> memory;
};

using Jpeg = std::vector<std::uint8_t>;

// How a colour picture's chroma is sampled against its luma.
struct Sampling {
    int components;
    int horizontal;
    int vertical;
};

// Colour is far from grey, so that a decoder that took it for luma would show. `restart` as in
// jpeg_compress_struct.
inline Jpeg compress(Picture& picture, Sampling sampling, unsigned restart = 0) {
    jpeg_compress_struct encoder{};
    jpeg_error_mgr errors{};
    encoder.err = jpeg_std_error(&errors);
    jpeg_create_compress(&encoder);
    unsigned char* bytes = nullptr;
    unsigned long size = 0;
    jpeg_mem_dest(&encoder, &bytes, &size);
    encoder.image_width = static_cast<unsigned>(picture.width);
    encoder.image_height = static_cast<unsigned>(picture.height);
    encoder.input_components = sampling.components;
    encoder.in_color_space = sampling.components == 1 ? JCS_GRAYSCALE : JCS_YCbCr;
    jpeg_set_defaults(&encoder);
    jpeg_set_quality(&encoder, 95, TRUE);
    encoder.comp_info[0].h_samp_factor = sampling.horizontal;
    encoder.comp_info[0].v_samp_factor = sampling.vertical;
    encoder.restart_interval = restart;
    jpeg_start_compress(&encoder, TRUE);
    std::vector<std::uint8_t> pixels(static_cast<std::size_t>(picture.width * sampling.components), 200);
    for (int y = 0; y < picture.height; ++y) {
        for (int x = 0; x < picture.width; ++x)
            pixels[static_cast<std::size_t>(x * sampling.components)] = picture.view().at(x, y);
        JSAMPROW row = pixels.data();
        jpeg_write_scanlines(&encoder, &row, 1);
    }
    jpeg_finish_compress(&encoder);
    jpeg_destroy_compress(&encoder);
    Jpeg jpeg(bytes, bytes + size);
    std::free(bytes);
    return jpeg;
}

inline constexpr Sampling kGrey{1, 1, 1};
inline constexpr Sampling k422{3, 2, 1};
inline constexpr Sampling k420{3, 2, 2};

}  // namespace groundline::capture::test
