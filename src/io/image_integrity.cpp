#include "io/image_integrity.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <cstring>
#include <optional>

namespace groundline::io {
namespace {

using Bytes = std::span<const std::uint8_t>;

enum class Format { kNone, kPng, kJpeg, kPnm, kTiff, kBmp };

bool begins(Bytes bytes, std::string_view magic) {
    return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
}

Format format_of(Bytes bytes) {
    using namespace std::string_view_literals;
    if (begins(bytes, "\x89PNG\r\n\x1a\n"sv)) return Format::kPng;
    if (begins(bytes, "\xFF\xD8\xFF"sv)) return Format::kJpeg;
    if (begins(bytes, "II*\0"sv) || begins(bytes, "MM\0*"sv)) return Format::kTiff;
    // "BM" alone is too weak a mark: text may begin so. The next four bytes are the file's length, the four
    // after them are zero in every writer's files.
    if (begins(bytes, "BM"sv) && bytes.size() >= 10 && begins(bytes.subspan(6), "\0\0\0\0"sv))
        return Format::kBmp;
    if (bytes.size() >= 3 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6' &&
        std::isspace(bytes[2]) != 0)
        return Format::kPnm;
    return Format::kNone;
}

std::size_t big_endian(Bytes bytes, std::size_t at, std::size_t count) {
    std::size_t value = 0;
    for (std::size_t i = 0; i < count; ++i)
        value = value << 8U | bytes[at + i];
    return value;
}

// PNG: chunks of length, type, data and checksum up to IEND.
bool png_whole(Bytes bytes) {
    std::size_t at = 8;
    while (at + 12 <= bytes.size()) {
        const std::size_t length = big_endian(bytes, at, 4);
        if (length > bytes.size() - at - 12) return false;
        if (begins(bytes.subspan(at + 4), "IEND")) return true;
        at += length + 12;
    }
    return false;
}

// JPEG: segments with a length up to a start of scan, then coded data in which FF is followed by 00 or a
// restart marker, up to the next segment; EOI ends it. Thumbnails sit inside segments and are skipped.
bool jpeg_whole(Bytes bytes) {
    std::size_t at = 2;
    while (at + 2 <= bytes.size()) {
        if (bytes[at] != 0xFF) {
            const auto* next =
                static_cast<const std::uint8_t*>(std::memchr(bytes.data() + at, 0xFF, bytes.size() - at));
            if (next == nullptr) return false;
            at = static_cast<std::size_t>(next - bytes.data());
            continue;
        }
        const unsigned marker = bytes[at + 1];
        if (marker == 0xD9) return true;
        const bool stands_alone = marker == 0x00 || marker == 0x01 || (marker >= 0xD0 && marker <= 0xD8);
        if (marker == 0xFF) {
            at += 1;  // fill byte
        } else if (stands_alone) {
            at += 2;
        } else {
            if (at + 4 > bytes.size()) return false;
            at += 2 + big_endian(bytes, at + 2, 2);
        }
    }
    return false;
}

// Binary PGM and PPM: three numbers between white space and comments, one white space, then the samples.
bool pnm_whole(Bytes bytes) {
    if (bytes[1] != '5' && bytes[1] != '6') return true;
    std::size_t at = 2;
    std::array<std::size_t, 3> numbers{};
    for (std::size_t& number : numbers) {
        while (at < bytes.size() && (std::isspace(bytes[at]) != 0 || bytes[at] == '#')) {
            if (bytes[at] == '#')
                while (at < bytes.size() && bytes[at] != '\n')
                    ++at;
            else
                ++at;
        }
        const std::size_t first = at;
        while (at < bytes.size() && std::isdigit(bytes[at]) != 0 && at - first < 8)
            number = number * 10 + (bytes[at++] - '0');
        if (at == first) return false;
    }
    const std::size_t samples = numbers[0] * numbers[1] * (bytes[1] == '6' ? 3 : 1);
    return at + 1 + samples * (numbers[2] > 255 ? 2 : 1) <= bytes.size();
}

bool bmp_whole(Bytes bytes) {
    const std::size_t length = bytes[2] | static_cast<std::size_t>(bytes[3]) << 8U |
                               static_cast<std::size_t>(bytes[4]) << 16U |
                               static_cast<std::size_t>(bytes[5]) << 24U;
    return bytes.size() >= length;
}

}  // namespace

bool looks_like_image(Bytes bytes) {
    return format_of(bytes) != Format::kNone;
}

std::string image_fault(Bytes bytes) {
    if (bytes.empty()) return "the file is empty";
    bool whole = true;
    std::string_view name;
    switch (format_of(bytes)) {
        case Format::kNone:
            return fmt::format("it is not {}", kImageFormats);
        case Format::kPng:
            whole = png_whole(bytes);
            name = "PNG";
            break;
        case Format::kJpeg:
            whole = jpeg_whole(bytes);
            name = "JPEG";
            break;
        case Format::kPnm:
            whole = pnm_whole(bytes);
            name = "PGM/PPM";
            break;
        case Format::kBmp:
            whole = bmp_whole(bytes);
            name = "BMP";
            break;
        case Format::kTiff:
            break;
    }
    if (whole) return {};
    return fmt::format("the {} data end too early (truncated file)", name);
}

}  // namespace groundline::io
