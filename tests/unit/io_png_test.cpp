#include "io/png.hpp"

#include <gtest/gtest.h>

#include <array>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "core/arena.hpp"
#include "io_test_support.hpp"

namespace groundline::io {
namespace {

using testing::TempFolder;

template <typename Read>
std::string failure(Read read) {
    try {
        read();
    } catch (const std::runtime_error& problem) {
        return problem.what();
    }
    return {};
}

TEST(Png, LumaOfOddSizeInPaddedRowsComesBackExactly) {
    const TempFolder folder;
    Arena arena;
    const Luma image = arena.image<std::uint8_t>(37, 11);
    std::mt19937 random(1);
    for (int y = 0; y < 11; ++y)
        for (int x = 0; x < 37; ++x)
            image.at(x, y) = static_cast<std::uint8_t>(random());
    write_png(folder / "a.png", ConstLuma(image));
    const Image8 back = read_image(folder / "a.png");
    ASSERT_EQ(back.width, 37);
    ASSERT_EQ(back.height, 11);
    ASSERT_EQ(back.channels, 1);
    for (int y = 0; y < 11; ++y)
        for (int x = 0; x < 37; ++x)
            ASSERT_EQ(back.luma().at(x, y), image.at(x, y));
}

TEST(Png, SixteenBitsComeBackExactly) {
    const TempFolder folder;
    Arena arena;
    const ImageView<std::uint16_t> image = arena.image<std::uint16_t>(5, 3);
    const std::array<std::uint16_t, 5> values = {0, 1, 255, 256, 65535};
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 5; ++x)
            image.at(x, y) = values[static_cast<std::size_t>((x + y) % 5)];
    write_png(folder / "a.png", ConstImageView<std::uint16_t>(image));
    const Image16 back = read_png16(folder / "a.png");
    ASSERT_TRUE(back.view().same_size(5, 3));
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 5; ++x)
            ASSERT_EQ(back.view().at(x, y), image.at(x, y));
}

TEST(Png, ColourComesBackAndBecomesLumaByOurWeightsAlone) {
    const TempFolder folder;
    Image8 colour{std::vector<std::uint8_t>(3 * 64 * 64), 64, 64, 3};
    std::mt19937 random(2);
    for (std::uint8_t& sample : colour.bytes)
        sample = static_cast<std::uint8_t>(random());
    write_png(folder / "a.png", colour.bgr());
    EXPECT_EQ(read_image(folder / "a.png").bytes, colour.bytes);
    const Image8 luma = read_luma_png(folder / "a.png");
    ASSERT_EQ(luma.channels, 1);
    for (std::size_t i = 0; i < luma.bytes.size(); ++i) {
        const unsigned blue = colour.bytes[3 * i], green = colour.bytes[3 * i + 1],
                       red = colour.bytes[3 * i + 2];
        ASSERT_EQ(luma.bytes[i], (77 * red + 150 * green + 29 * blue + 128) >> 8U);
    }
}

TEST(Png, AlphaIsIgnoredAndSixteenBitsBecomeTheHighByte) {
    const TempFolder folder;
    const cv::Mat alpha(2, 2, CV_8UC4, cv::Scalar(10, 20, 30, 7));
    cv::imwrite((folder / "alpha.png").string(), alpha);
    EXPECT_EQ(read_image(folder / "alpha.png").bytes,
              (std::vector<std::uint8_t>{10, 20, 30, 10, 20, 30, 10, 20, 30, 10, 20, 30}));
    cv::imwrite((folder / "deep.png").string(), cv::Mat(1, 1, CV_16UC1, cv::Scalar(0x12FF)));
    EXPECT_EQ(read_image(folder / "deep.png").bytes, std::vector<std::uint8_t>{0x12});
    cv::imwrite((folder / "deep_colour.png").string(),
                cv::Mat(1, 1, CV_16UC3, cv::Scalar(0x10FF, 0x2000, 0x30FF)));
    EXPECT_EQ(read_luma_png(folder / "deep_colour.png").bytes,
              std::vector<std::uint8_t>{luma_of(0x30, 0x20, 0x10)});
}

TEST(Png, EveryFormatIsToldByContentNotByName) {
    const TempFolder folder;
    const cv::Mat grey(24, 32, CV_8UC1, cv::Scalar(77));
    for (const std::string extension : {".png", ".jpg", ".pgm", ".tiff", ".bmp"}) {
        cv::imwrite((folder / ("a" + extension)).string(), grey);
        std::filesystem::rename(folder / ("a" + extension), folder / "picture");
        const Image8 image = read_luma_png(folder / "picture");
        EXPECT_EQ(image.width, 32) << extension;
        EXPECT_EQ(image.height, 24) << extension;
        EXPECT_EQ(image.bytes[100], 77) << extension;
    }
    cv::imwrite((folder / "a.ppm").string(), cv::Mat(3, 4, CV_8UC3, cv::Scalar(1, 2, 3)));
    EXPECT_EQ(read_image(folder / "a.ppm").channels, 3);
}

// Every length from nothing to all but the last byte. A TIFF may end in bytes nobody needs; of it, what is
// cut off the samples or the directory must be noticed: half the file is.
TEST(Png, ACutFileIsNeverReadAsAPicture) {
    const TempFolder folder;
    cv::Mat picture(24, 32, CV_8UC1);
    std::mt19937 random(3);
    for (int y = 0; y < picture.rows; ++y)
        for (int x = 0; x < picture.cols; ++x)
            picture.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(random());
    for (const std::string extension : {".png", ".jpg", ".pgm", ".bmp", ".tiff"}) {
        const std::filesystem::path whole = folder / ("whole" + extension),
                                    cut = folder / ("cut" + extension);
        cv::imwrite(whole.string(), picture);
        const std::string bytes = testing::read_text(whole);
        const std::size_t longest = extension == ".tiff" ? bytes.size() / 2 : bytes.size() - 1;
        for (std::size_t length = 0; length <= longest;
             length += length < 32 || length + 32 > longest ? 1 : 29) {
            testing::write_text(cut, bytes.substr(0, length));
            ::testing::internal::CaptureStderr();
            const std::string sentence = failure([&] { read_image(cut); });
            ASSERT_EQ(::testing::internal::GetCapturedStderr(), "") << "what is wrong is told once, by us";
            ASSERT_NE(sentence, "") << extension << " of " << length << " bytes out of " << bytes.size();
            ASSERT_NE(sentence.find(cut.string()), std::string::npos) << sentence;
        }
        EXPECT_EQ(read_image(whole).width, 32) << extension;
    }
}

TEST(Png, WhatIsNoPictureIsToldWithItsName) {
    const TempFolder folder;
    testing::write_text(folder / "empty.png", "");
    testing::write_text(folder / "text.png",
                        "BM is how this text begins, and it is long enough for a header");
    EXPECT_HAS(failure([&] { read_image(folder / "absent.png"); }), "absent.png': No such file");
    EXPECT_HAS(failure([&] { read_image(folder / "empty.png"); }), "empty.png': the file is empty");
    EXPECT_HAS(failure([&] { read_image(folder / "text.png"); }), "text.png': it is not PNG, JPEG");
    EXPECT_HAS(failure([&] { read_image(folder.path()); }), "it is no file");
}

TEST(Png, DamagedCompressedDataIsRefused) {
    const TempFolder folder;
    testing::write_ramp(folder / "a.png", 64, 64, 0);
    std::string bytes = testing::read_text(folder / "a.png");
    for (std::size_t i = bytes.size() / 2; i < bytes.size() / 2 + 8; ++i)
        bytes[i] = static_cast<char>(~bytes[i]);
    testing::write_text(folder / "a.png", bytes);
    EXPECT_HAS(failure([&] { read_image(folder / "a.png"); }), "a.png': its data cannot be decoded");
}

TEST(Png, TruthOfEightBitsOrInColourIsRefused) {
    const TempFolder folder;
    testing::write_ramp(folder / "a.png", 4, 4, 0);
    EXPECT_HAS(failure([&] { read_disparity_truth(folder / "a.png"); }), "expected a grey image of 16 bits");
    cv::imwrite((folder / "b.png").string(), cv::Mat(2, 2, CV_16UC3, cv::Scalar(1, 2, 3)));
    EXPECT_HAS(failure([&] { read_disparity_truth(folder / "b.png"); }), "found colour of 16 bits");
}

TEST(Png, AFailedWriteNamesThePathAndLeavesNothing) {
    const TempFolder folder;
    const Image8 image = testing::ramp(4, 4, 0);
    EXPECT_HAS(failure([&] { write_png(folder / "absent" / "a.png", image.luma()); }), "absent/a.png");
    // A folder stands where the file should go: the rename fails after the temporary file was written.
    std::filesystem::create_directories(folder / "a.png" / "inside");
    const auto before = testing::listing(folder.path());
    EXPECT_HAS(failure([&] { write_png(folder / "a.png", image.luma()); }), "a.png");
    EXPECT_EQ(testing::listing(folder.path()), before);
    EXPECT_HAS(failure([&] { write_png(folder / "b.png", ConstLuma()); }), "b.png': the picture (0x0)");
    EXPECT_FALSE(std::filesystem::exists(folder / "b.png"));
}

TEST(Png, AnEarlierFileIsReplaced) {
    const TempFolder folder;
    testing::write_ramp(folder / "a.png", 64, 64, 0);
    testing::write_ramp(folder / "a.png", 3, 2, 9);
    EXPECT_EQ(read_image(folder / "a.png").bytes, testing::ramp(3, 2, 9).bytes);
    EXPECT_TRUE(testing::temporary_files(folder.path()).empty());
}

}  // namespace
}  // namespace groundline::io
