// The operator's word for the robot's own parts: polygons, pictures, and what is refused.
#include "io/body_mask.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "io/png.hpp"
#include "unit/io_test_support.hpp"

namespace groundline::io {
namespace {

constexpr int kWidth = 40;
constexpr int kHeight = 30;

class BodyMask : public ::testing::Test {
  protected:
    Arena arena;
    testing::TempFolder folder;

    std::string refused(const std::string& text) {
        return testing::refusal(ExitStatus::kConfig, [&] { read_body_mask(text, kWidth, kHeight, arena); });
    }
    // Black but for its last row.
    std::string picture(int width, int height, std::uint8_t value) {
        Image8 image;
        image.width = width;
        image.height = height;
        image.bytes.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
        std::fill(image.bytes.end() - width, image.bytes.end(), value);
        const std::filesystem::path path = folder / "mask.png";
        write_png(path, image.luma());
        return path.string();
    }
};

TEST_F(BodyMask, NoWordIsNoMask) {
    EXPECT_TRUE(read_body_mask("", kWidth, kHeight, arena).empty());
}

TEST_F(BodyMask, PolygonsAreDrawnTogether) {
    const auto mask = read_body_mask("0,20 40,20 40,30 0,30; 10,0 12,0 12,5 10,5", kWidth, kHeight, arena);
    ASSERT_TRUE(mask.same_size(kWidth, kHeight));
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x)
            EXPECT_EQ(mask.at(x, y) != 0, y >= 20 || (y < 5 && (x == 10 || x == 11))) << x << ' ' << y;
}

TEST_F(BodyMask, APictureMarksWhatIsNotBlack) {
    const auto mask = read_body_mask(picture(kWidth, kHeight, 1), kWidth, kHeight, arena);
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x)
            EXPECT_EQ(mask.at(x, y) != 0, y == kHeight - 1);
}

TEST_F(BodyMask, WhatCannotBeMeantIsRefusedWithTheReason) {
    EXPECT_HAS(refused("0,0 1,1"), "neither polygons");
    EXPECT_HAS(refused("no/such.png"), "no/such.png");
    EXPECT_HAS(refused(picture(kWidth + 1, kHeight, 9)), "41 x 30 px; the rectified left picture is 40 x 30");
    EXPECT_HAS(refused(picture(kWidth, kHeight, 0)), "marks none");
    EXPECT_HAS(refused("100,100 110,100 110,110"), "marks none");
    EXPECT_HAS(refused("-1,-1 50,-1 50,50 -1,50"), "marks all");
    testing::write_text(folder / "notes.txt", "no picture");
    EXPECT_HAS(refused((folder / "notes.txt").string()), "notes.txt");
}

}  // namespace
}  // namespace groundline::io
