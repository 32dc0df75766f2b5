// Images in files: PNG written whole or not at all, and every still format of the sources read into memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/image.hpp"
#include "core/terrain_class.hpp"

namespace groundline::io {

// A decoded 8-bit image that owns its bytes: row-major without gaps, 1 channel (luma) or 3 (blue green red).
struct Image8 {
    std::vector<std::uint8_t> bytes;
    int width = 0;
    int height = 0;
    int channels = 1;

    ConstLuma luma() const { return {bytes.data(), width, height, width}; }  // 1 channel only
    BgrView bgr() { return {bytes.data(), width, height, 3 * static_cast<std::ptrdiff_t>(width)}; }  // 3 only
};

// A decoded 16-bit image of one channel.
struct Image16 {
    std::vector<std::uint16_t> pixels;
    int width = 0;
    int height = 0;

    ConstImageView<std::uint16_t> view() const { return {pixels.data(), width, height, width}; }
};

// Encodes in memory, writes under a temporary name in the same folder, then renames: a reader of `path` sees
// the old file or the whole new one. Overwrites. The folder must exist. Any thread.
// Throws std::runtime_error with a sentence that names the path.
void write_png(const std::filesystem::path& path, ConstLuma image);
void write_png(const std::filesystem::path& path, ConstImageView<std::uint16_t> image);
void write_png(const std::filesystem::path& path, ConstMask image);
void write_png(const std::filesystem::path& path, const BgrView& image);

// PNG, JPEG, PGM/PPM, TIFF or BMP, told by content. Alpha is ignored, 16-bit samples become 8 bits by >> 8
// (the high byte: 12-bit values stored unshifted come out dark), orientation tags are ignored.
// Throws std::runtime_error with a sentence that names the path: missing, empty, truncated, not an image.
Image8 read_image(const std::filesystem::path& path);
// The same as luma; colour goes through luma_of.
Image8 read_luma_png(const std::filesystem::path& path);
// One 16-bit channel, values as stored. Also refuses an image of another depth or with colour.
Image16 read_png16(const std::filesystem::path& path);
// Disparity x 256, 0 = none: a 16-bit image under the name its users know.
inline Image16 read_disparity_truth(const std::filesystem::path& path) {
    return read_png16(path);
}

}  // namespace groundline::io
