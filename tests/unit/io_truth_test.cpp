#include "io/truth.hpp"

#include <gtest/gtest.h>

#include "io_test_support.hpp"

namespace groundline::io {
namespace {

namespace fs = std::filesystem;
using testing::refusal;
using testing::TempFolder;
using testing::write_ramp;
using testing::write_text;

void write_depth(const fs::path& path, int width, int height, std::uint16_t value) {
    fs::create_directories(path.parent_path());
    Image16 image{std::vector<std::uint16_t>(static_cast<std::size_t>(width * height), value), width, height};
    write_png(path, image.view());
}

TEST(Truth, OneFile) {
    const TempFolder folder;
    write_depth(folder / "disp.png", 8, 6, 1280);
    const Truth truth(folder.path());
    ASSERT_EQ(truth.frames(), 1);
    EXPECT_FALSE(truth.has_classes());
    EXPECT_FALSE(truth.has_heights());
    EXPECT_FALSE(truth.has_occlusion());
    EXPECT_EQ(truth.json_text(), "");
    const TruthFrame frame = truth.read(0);
    EXPECT_EQ(frame.disparity_q8.view().at(7, 5), 1280);
    EXPECT_EQ(frame.classes.width, 0);
}

TEST(Truth, FoldersInOrderWithAllKinds) {
    const TempFolder folder;
    for (int i = 0; i < 11; ++i) {
        const std::string name = std::to_string(i) + ".png";
        write_depth(folder / "disp" / name, 8, 6, static_cast<std::uint16_t>(256 * i));
        write_depth(folder / "height" / name, 8, 6, static_cast<std::uint16_t>(32768 + i));
        write_ramp(folder / "class" / name, 8, 6, i);
        write_ramp(folder / "occluded" / name, 8, 6, i + 1);
    }
    write_text(folder / "truth.json", "{\"frames\": []}");
    const Truth truth(folder.path());
    ASSERT_EQ(truth.frames(), 11);
    EXPECT_TRUE(truth.has_classes() && truth.has_heights() && truth.has_occlusion());
    EXPECT_EQ(truth.json_text(), "{\"frames\": []}");
    const TruthFrame frame = truth.read(10);
    EXPECT_EQ(frame.disparity_q8.pixels[0], 2560);
    EXPECT_EQ(frame.height_mm.pixels[0], 32778);
    EXPECT_EQ(frame.classes.bytes[0], 10);
    EXPECT_EQ(frame.occluded.bytes[0], 11);
}

TEST(Truth, WhatIsMissingIsNamed) {
    const TempFolder folder;
    EXPECT_HAS(refusal(ExitStatus::kInput, [&] { Truth{folder.path()}; }), "expected disp.png or disp/");
    fs::create_directories(folder / "disp");
    EXPECT_HAS(refusal(ExitStatus::kInput, [&] { Truth{folder.path()}; }), "holds no images");
    write_depth(folder / "disp/a.png", 8, 6, 1);
    fs::create_directories(folder / "class");
    EXPECT_HAS(refusal(ExitStatus::kInput, [&] { Truth{folder.path()}; }), (folder / "class/a.png").string());
}

TEST(Truth, AnotherSizeThanTheDisparityIsNamed) {
    const TempFolder folder;
    write_depth(folder / "disp/a.png", 8, 6, 1);
    write_ramp(folder / "class/a.png", 8, 5, 1);
    const Truth truth(folder.path());
    try {
        truth.read(0);
        FAIL();
    } catch (const std::runtime_error& problem) {
        EXPECT_HAS(std::string(problem.what()), "class/a.png' has 8x5 pixels; expected 8x6");
    }
}

TEST(Truth, RecordedSets) {
    const fs::path data = GROUNDLINE_SOURCE_DIR "/../shared/data";
    if (!fs::exists(data)) GTEST_SKIP() << "the recorded sets are not at hand";
    EXPECT_EQ(Truth(data / "mb_tsukuba").read(0).disparity_q8.width, 384);
}

}  // namespace
}  // namespace groundline::io
