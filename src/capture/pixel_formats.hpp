// Pixel formats of cameras, and the 8-bit luma in them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/image.hpp"

namespace groundline::capture {

// In the order in which a driver that may choose takes them: the fewest bytes a pixel that keep the luma
// whole, then what has to be decoded.
enum class PixelFormat : std::uint8_t {
    kGrey,   // 8 bits
    kNv12,   // a plane of 8-bit luma, then one of colour, which is not read
    kYuyv,   // Y U Y V
    kUyvy,   // U Y V Y
    kY10,    // 10 bits in the low end of 16, little-endian
    kY10P,   // 10 bits packed as on MIPI: four bytes of high bits, then one of the four pixels' low bits
    kY12,    // 12 bits in the low end of 16, little-endian
    kY16,    // 16 bits, little-endian
    kRgb24,  // red, green, blue, 8 bits each
    kBgr24,  // blue, green, red
    kMjpeg,
    kCount,
};
inline constexpr int kPixelFormats = static_cast<int>(PixelFormat::kCount);
inline constexpr std::array<std::string_view, static_cast<std::size_t>(kPixelFormats)> kPixelFormatNames = {
    "grey", "nv12", "yuyv", "uyvy", "y10", "y10p", "y12", "y16", "rgb24", "bgr24", "mjpeg"};

constexpr std::string_view name_of(PixelFormat format) {
    return kPixelFormatNames[static_cast<std::size_t>(format)];
}

// A picture as a driver's buffer holds it: `width` by `height` pixels, both eyes' where they lie side by
// side. Only `bytes` are ever read, which is what the driver says it filled.
struct RawPicture {
    std::span<const std::uint8_t> bytes;
    PixelFormat format = PixelFormat::kGrey;
    int width = 0;
    int height = 0;
    std::size_t bytes_per_line = 0;  // of the luma plane; 0 for kMjpeg
};

// Bytes that hold the luma of `width` pixels of one row. 0 for kMjpeg.
std::size_t luma_row_bytes(PixelFormat format, int width);

// The columns of one eye where both lie side by side in a picture of `width`: the left half is the left
// eye's.
struct Columns {
    int first = 0;
    int count = 0;
};
constexpr Columns left_half(int width) {
    return {0, width / 2};
}
constexpr Columns right_half(int width) {
    return {width / 2, width / 2};
}

// Writes rows first_row, first_row + 1, ... of the columns `columns` of `picture` into all rows of `into`,
// which is columns.count wide. Deeper pixels lose their low bits; values beyond 10 or 12 bits count as the
// largest; colours become luma as everywhere. With kY10P columns.first must be a multiple of 4. False, and
// nothing written, where the rows or columns are not in the picture, a line is shorter than its pixels, the
// bytes end before the last pixel wanted, or the format is kMjpeg (see mjpeg.hpp). No allocation.
[[nodiscard]] bool unpack_luma(const RawPicture& picture, Columns columns, int first_row, Luma into);

}  // namespace groundline::capture
