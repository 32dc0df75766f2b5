#include "capture/pixel_formats.hpp"

#include <algorithm>
#include <cstring>

namespace groundline::capture {
namespace {

using Byte = std::uint8_t;

// One of two bytes a pixel holds the luma, or its high end.
void every_second(const Byte* __restrict source, int count, Byte* __restrict target) {
    for (int x = 0; x < count; ++x)
        target[x] = source[2 * x];
}

// `drop` low bits go; what lies beyond 8 bits after that is the largest.
void narrow(const Byte* __restrict source, int count, unsigned drop, Byte* __restrict target) {
    for (int x = 0; x < count; ++x) {
        const unsigned value = source[2 * x] | (static_cast<unsigned>(source[2 * x + 1]) << 8U);
        target[x] = static_cast<Byte>(std::min(value >> drop, 255U));
    }
}

void four_of_five(const Byte* __restrict source, int count, Byte* __restrict target) {
    int x = 0;
    for (; x + 4 <= count; x += 4, source += 5)
        std::memcpy(target + x, source, 4);
    for (; x < count; ++x)
        target[x] = *source++;
}

template <int kRed, int kBlue>
void weigh(const Byte* __restrict source, int count, Byte* __restrict target) {
    for (int x = 0; x < count; ++x)
        target[x] = luma_of(source[3 * x + kRed], source[3 * x + 1], source[3 * x + kBlue]);
}

// Bytes from the beginning of a row to the pixel `first`.
std::size_t offset_of(PixelFormat format, int first) {
    const auto column = static_cast<std::size_t>(first);
    switch (format) {
        case PixelFormat::kGrey:
        case PixelFormat::kNv12:
            return column;
        case PixelFormat::kY10P:
            return column / 4 * 5;
        case PixelFormat::kRgb24:
        case PixelFormat::kBgr24:
            return 3 * column;
        default:
            return 2 * column;
    }
}

}  // namespace

std::size_t luma_row_bytes(PixelFormat format, int width) {
    const auto pixels = static_cast<std::size_t>(std::max(width, 0));
    switch (format) {
        case PixelFormat::kMjpeg:
        case PixelFormat::kCount:
            return 0;
        case PixelFormat::kY10P:
            return pixels / 4 * 5 + pixels % 4;
        case PixelFormat::kYuyv:
            return pixels == 0 ? 0 : 2 * pixels - 1;
        default:
            return offset_of(format, width);
    }
}

bool unpack_luma(const RawPicture& picture, Columns columns, int first_row, Luma into) {
    const PixelFormat format = picture.format;
    if (format == PixelFormat::kMjpeg || format == PixelFormat::kCount) return false;
    if (columns.first < 0 || columns.count != into.width || columns.count > picture.width - columns.first)
        return false;
    if (first_row < 0 || into.height > picture.height - first_row) return false;
    if (format == PixelFormat::kY10P && columns.first % 4 != 0) return false;
    if (into.empty()) return true;
    if (picture.bytes_per_line < luma_row_bytes(format, picture.width)) return false;
    const std::size_t offset = offset_of(format, columns.first);
    const auto last_row = static_cast<std::size_t>(first_row) + static_cast<std::size_t>(into.height) - 1;
    const std::size_t needed =
        last_row * picture.bytes_per_line + offset + luma_row_bytes(format, columns.count);
    if (picture.bytes.size() < needed) return false;

    const Byte* source =
        picture.bytes.data() + static_cast<std::size_t>(first_row) * picture.bytes_per_line + offset;
    for (int y = 0; y < into.height; ++y, source += picture.bytes_per_line) {
        Byte* target = into.row(y);
        switch (format) {
            case PixelFormat::kGrey:
            case PixelFormat::kNv12:
                std::memcpy(target, source, static_cast<std::size_t>(columns.count));
                break;
            case PixelFormat::kYuyv:
                every_second(source, columns.count, target);
                break;
            case PixelFormat::kUyvy:
            case PixelFormat::kY16:
                every_second(source + 1, columns.count, target);
                break;
            case PixelFormat::kY10:
                narrow(source, columns.count, 2, target);
                break;
            case PixelFormat::kY12:
                narrow(source, columns.count, 4, target);
                break;
            case PixelFormat::kY10P:
                four_of_five(source, columns.count, target);
                break;
            case PixelFormat::kRgb24:
                weigh<0, 2>(source, columns.count, target);
                break;
            case PixelFormat::kBgr24:
                weigh<2, 0>(source, columns.count, target);
                break;
            case PixelFormat::kMjpeg:
            case PixelFormat::kCount:
                break;
        }
    }
    return true;
}

}  // namespace groundline::capture
