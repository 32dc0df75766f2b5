// Unpacking against packing: every format, odd sizes, padded lines, halves, row ranges and buffers cut short.
#include "capture/pixel_formats.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <random>
#include <vector>

namespace groundline::capture {
namespace {

constexpr std::array kUnpacked = {
    PixelFormat::kGrey, PixelFormat::kNv12, PixelFormat::kYuyv, PixelFormat::kUyvy,  PixelFormat::kY10,
    PixelFormat::kY10P, PixelFormat::kY12,  PixelFormat::kY16,  PixelFormat::kRgb24, PixelFormat::kBgr24};

int depth_of(PixelFormat format) {
    switch (format) {
        case PixelFormat::kY10:
        case PixelFormat::kY10P:
            return 10;
        case PixelFormat::kY12:
            return 12;
        case PixelFormat::kY16:
            return 16;
        default:
            return 8;
    }
}

// A packed picture in a block of exactly its size, so that a sanitizer sees a read beyond it, and the luma it
// holds.
struct Packed {
    RawPicture picture;
    std::unique_ptr<std::uint8_t[]> block;
    std::vector<std::uint8_t> luma;

    std::uint8_t at(int x, int y) const { return luma[static_cast<std::size_t>(y * picture.width + x)]; }
};

// Pixel x of a row, written the slow way. `other` fills what is not luma.
void put(PixelFormat format, std::uint8_t* row, int x, unsigned value, std::uint8_t other) {
    switch (format) {
        case PixelFormat::kYuyv:
            row[2 * x] = static_cast<std::uint8_t>(value);
            break;
        case PixelFormat::kUyvy:
            row[2 * x] = other;
            row[2 * x + 1] = static_cast<std::uint8_t>(value);
            break;
        case PixelFormat::kY10:
        case PixelFormat::kY12:
        case PixelFormat::kY16:
            row[2 * x] = static_cast<std::uint8_t>(value & 255U);
            row[2 * x + 1] = static_cast<std::uint8_t>(value >> 8U);
            break;
        case PixelFormat::kY10P:
            row[x / 4 * 5 + x % 4] = static_cast<std::uint8_t>(value >> 2U);
            break;
        default:
            row[x] = static_cast<std::uint8_t>(value);
    }
}

Packed pack(PixelFormat format, int width, int height, std::size_t padding, std::mt19937& random) {
    Packed packed;
    const std::size_t stride = luma_row_bytes(format, width) + padding;
    const std::size_t size = static_cast<std::size_t>(height - 1) * stride + luma_row_bytes(format, width);
    packed.block = std::make_unique<std::uint8_t[]>(size);
    for (std::size_t i = 0; i < size; ++i)
        packed.block[i] = static_cast<std::uint8_t>(random());
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            if (format == PixelFormat::kRgb24 || format == PixelFormat::kBgr24) {
                const std::uint8_t* pixel = packed.block.get() + static_cast<std::size_t>(y) * stride + 3 * x;
                const int first = format == PixelFormat::kRgb24 ? 77 : 29;
                packed.luma.push_back(static_cast<std::uint8_t>(
                    (first * pixel[0] + 150 * pixel[1] + (106 - first) * pixel[2] + 128) / 256));
                continue;
            }
            const int depth = depth_of(format);
            const unsigned value = static_cast<unsigned>(random()) & ((1U << depth) - 1U);
            put(format, packed.block.get() + static_cast<std::size_t>(y) * stride, x, value,
                static_cast<std::uint8_t>(random()));
            packed.luma.push_back(static_cast<std::uint8_t>(value >> (depth - 8)));
        }
    }
    packed.picture = {{packed.block.get(), size}, format, width, height, stride};
    return packed;
}

// A target whose rows are longer than its pixels, so that a write beyond them is seen.
struct Target {
    Target(int width, int height)
        : memory(static_cast<std::size_t>((width + 3) * height), 77),
          view(memory.data(), width, height, width + 3) {}
    bool only_pixels_written() const {
        for (int y = 0; y < view.height; ++y)
            for (int x = view.width; x < view.width + 3; ++x)
                if (view.row(y)[x] != 77) return false;
        return true;
    }
    bool untouched() const {
        for (const std::uint8_t byte : memory)
            if (byte != 77) return false;
        return true;
    }
    std::vector<std::uint8_t> memory;
    Luma view;
};

TEST(PixelFormats, EachGivesTheLumaThatWasPackedAtAnySizePaddingAndRows) {
    std::mt19937 random(1);
    for (const PixelFormat format : kUnpacked) {
        for (const int width : {1, 2, 3, 4, 5, 7, 15, 16, 17, 31, 33, 64, 67, 131}) {
            for (const std::size_t padding : {0U, 1U, 13U, 64U}) {
                const int height = 1 + static_cast<int>(random() % 5);
                const Packed packed = pack(format, width, height, padding, random);
                const int first_row = static_cast<int>(random() % static_cast<unsigned>(height));
                const int rows = 1 + static_cast<int>(random() % static_cast<unsigned>(height - first_row));
                Target target(width, rows);
                ASSERT_TRUE(unpack_luma(packed.picture, {0, width}, first_row, target.view));
                for (int y = 0; y < rows; ++y)
                    for (int x = 0; x < width; ++x)
                        ASSERT_EQ(target.view.at(x, y), packed.at(x, y + first_row))
                            << name_of(format) << " " << width << "x" << height << " at " << x << "," << y;
                ASSERT_TRUE(target.only_pixels_written()) << name_of(format);
            }
        }
    }
}

TEST(PixelFormats, SideBySideHalvesAreTheLeftAndTheRightColumns) {
    std::mt19937 random(2);
    for (const PixelFormat format : kUnpacked) {
        for (const int eye_width : {4, 8, 36, 68}) {
            const Packed packed = pack(format, 2 * eye_width, 3, 5, random);
            Target left(eye_width, 3);
            Target right(eye_width, 3);
            ASSERT_TRUE(unpack_luma(packed.picture, left_half(2 * eye_width), 0, left.view));
            ASSERT_TRUE(unpack_luma(packed.picture, right_half(2 * eye_width), 0, right.view));
            for (int y = 0; y < 3; ++y) {
                for (int x = 0; x < eye_width; ++x) {
                    ASSERT_EQ(left.view.at(x, y), packed.at(x, y)) << name_of(format);
                    ASSERT_EQ(right.view.at(x, y), packed.at(x + eye_width, y)) << name_of(format);
                }
            }
        }
    }
}

TEST(PixelFormats, ABufferThatEndsBeforeTheLastPixelIsRefusedAndNothingIsWritten) {
    std::mt19937 random(3);
    for (const PixelFormat format : kUnpacked) {
        for (const int width : {1, 6, 9, 64}) {
            const Packed packed = pack(format, width, 4, 7, random);
            const std::size_t whole = packed.picture.bytes.size();
            for (const std::size_t missing : {std::size_t{1}, std::size_t{2}, whole / 2, whole}) {
                if (missing > whole) continue;
                // A block of its own, so that a sanitizer sees the first byte read beyond it.
                const std::vector<std::uint8_t> cut(packed.block.get(), packed.block.get() + whole - missing);
                RawPicture picture = packed.picture;
                picture.bytes = cut;
                Target target(width, 4);
                EXPECT_FALSE(unpack_luma(picture, {0, width}, 0, target.view)) << name_of(format) << missing;
                EXPECT_TRUE(target.untouched());
            }
            // All that the upper rows need is there.
            RawPicture picture = packed.picture;
            picture.bytes = picture.bytes.first(2 * picture.bytes_per_line);
            Target upper(width, 2);
            EXPECT_TRUE(unpack_luma(picture, {0, width}, 0, upper.view)) << name_of(format);
        }
    }
}

TEST(PixelFormats, WhatIsNotInThePictureIsRefused) {
    std::mt19937 random(4);
    struct Case {
        Columns columns;
        int first_row;
        int into_width;
        int into_height;
    };
    for (const PixelFormat format : kUnpacked) {
        // A buffer longer than its picture, as drivers round sizes up.
        Packed packed = pack(format, 16, 8, 0, random);
        packed.picture.height = 4;
        for (const Case& wrong : {Case{{0, 16}, 1, 16, 4}, Case{{0, 16}, -1, 16, 2}, Case{{4, 16}, 0, 16, 4},
                                  Case{{-4, 16}, 0, 16, 4}, Case{{0, 16}, 0, 8, 4}, Case{{0, 16}, 4, 16, 1},
                                  Case{{0, 17}, 0, 17, 4}}) {
            Target target(wrong.into_width, wrong.into_height);
            EXPECT_FALSE(unpack_luma(packed.picture, wrong.columns, wrong.first_row, target.view))
                << name_of(format) << " " << wrong.columns.first << "+" << wrong.columns.count << " from row "
                << wrong.first_row;
            EXPECT_TRUE(target.untouched());
        }
        RawPicture short_lines = packed.picture;
        short_lines.bytes_per_line -= 1;
        Target target(16, 4);
        EXPECT_FALSE(unpack_luma(short_lines, {0, 16}, 0, target.view)) << name_of(format);
    }
    const Packed packed10 = pack(PixelFormat::kY10P, 16, 2, 0, random);
    Target target(8, 2);
    EXPECT_FALSE(unpack_luma(packed10.picture, {2, 8}, 0, target.view)) << "between the groups of four";
    RawPicture jpeg = packed10.picture;
    jpeg.format = PixelFormat::kMjpeg;
    EXPECT_FALSE(unpack_luma(jpeg, {0, 8}, 0, target.view));
}

TEST(PixelFormats, ValuesBeyondTheirDepthAreWhite) {
    for (const auto& [format, value, expected] : {std::tuple{PixelFormat::kY10, 1023, 255},
                                                  {PixelFormat::kY10, 1024, 255},
                                                  {PixelFormat::kY10, 65535, 255},
                                                  {PixelFormat::kY10, 3, 0},
                                                  {PixelFormat::kY10, 4, 1},
                                                  {PixelFormat::kY12, 4096, 255},
                                                  {PixelFormat::kY12, 15, 0},
                                                  {PixelFormat::kY12, 16, 1}}) {
        const std::array<std::uint8_t, 2> bytes = {static_cast<std::uint8_t>(value & 255),
                                                   static_cast<std::uint8_t>(value >> 8)};
        Target target(1, 1);
        ASSERT_TRUE(unpack_luma({bytes, format, 1, 1, 2}, {0, 1}, 0, target.view));
        EXPECT_EQ(target.view.at(0, 0), expected) << name_of(format) << " " << value;
    }
}

}  // namespace
}  // namespace groundline::capture
