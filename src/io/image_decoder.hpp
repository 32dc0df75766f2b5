// Decodes one image file after another into memory that is reused.
#pragma once

#include <filesystem>
#include <memory>

#include "core/image.hpp"

namespace groundline::io {

// Luma of a colour picture of the same size, by luma_of.
void luma_from_bgr(const BgrView& from, Luma to);

struct ImageShape {
    int width = 0;
    int height = 0;
    bool colour = false;
    int bits = 8;  // of a sample: 8 or 16

    bool same_size(const ImageShape& other) const { return width == other.width && height == other.height; }
};

// Not thread-safe. Formats, alpha, depth and failures as read_image() in io/png.hpp.
class ImageDecoder {
  public:
    ImageDecoder();
    ~ImageDecoder();

    // Throws std::runtime_error with a sentence that names the path.
    ImageShape load(const std::filesystem::path& path);
    // The image loaded last; `to` must have its size.
    void copy_luma(Luma to) const;
    void copy_bgr(const BgrView& to) const;                       // grey is repeated in all three
    void copy_samples(const ImageView<std::uint16_t>& to) const;  // needs 16 bits and one channel

  private:
    struct Buffers;
    std::unique_ptr<Buffers> buffers_;
};

}  // namespace groundline::io
