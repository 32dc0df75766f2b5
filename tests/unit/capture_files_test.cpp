#include "capture/files.hpp"

#include <gtest/gtest.h>

#include "capture/open.hpp"
#include "core/arena.hpp"
#include "io_test_support.hpp"

namespace groundline::capture {
namespace {

namespace fs = std::filesystem;
using io::testing::refusal;
using io::testing::TempFolder;
using io::testing::write_ramp;
using io::testing::write_text;

TEST(Files, SequenceGoesOnAcrossLoopsPositionDoesNot) {
    const TempFolder folder;
    for (const std::string name : {"a.png", "b.png"}) {
        write_ramp(folder / "left" / name, 8, 6, 1);
        write_ramp(folder / "right" / name, 8, 6, 2);
    }
    const auto source = open_files({folder.path().string()});
    EXPECT_FALSE(source->info().live);
    Arena arena;
    StereoFrame frame = StereoFrame::make(arena, 8, 6, false);
    for (int sequence = 0; sequence < 6; ++sequence) {
        ASSERT_EQ(source->next(frame), Pull::kFrame);
        EXPECT_EQ(frame.stamp.sequence, sequence);
        EXPECT_EQ(frame.stamp.position, sequence % 2);
        if (sequence % 2 == 1) {
            EXPECT_EQ(source->next(frame), Pull::kEnd);
            EXPECT_EQ(source->error(), "");
            ASSERT_TRUE(source->rewind());
        }
    }
}

TEST(Files, ABadPairIsNotHandedOutButKeepsItsPosition) {
    const TempFolder folder;
    for (const std::string name : {"a.png", "b.png", "c.png"}) {
        write_ramp(folder / "left" / name, 8, 6, 1);
        write_ramp(folder / "right" / name, 8, 6, 2);
    }
    write_text(folder / "right/b.png", "");
    const auto source = open_files({folder.path().string()});
    Arena arena;
    StereoFrame frame = StereoFrame::make(arena, 8, 6, false);
    ASSERT_EQ(source->next(frame), Pull::kFrame);
    ASSERT_EQ(source->next(frame), Pull::kBad);
    EXPECT_EQ(frame.stamp.position, 1);
    EXPECT_HAS(source->error(), "right/b.png");
    ASSERT_EQ(source->next(frame), Pull::kFrame);
    EXPECT_EQ(frame.stamp.position, 2);
    EXPECT_EQ(frame.stamp.sequence, 1);
}

TEST(Open, FilesBringTheirFolderAndKittisColourMark) {
    const TempFolder folder;
    write_ramp(folder / "image_2/0.png", 8, 6, 1);
    write_ramp(folder / "image_3/0.png", 8, 6, 2);
    const OpenedSource opened = open_source({folder.path().string()});
    EXPECT_EQ(opened.folder, folder.path());
    EXPECT_TRUE(opened.colour_pair);
    EXPECT_FALSE(opened.rig.has_value());
    EXPECT_EQ(opened.note, "");
    EXPECT_EQ(opened.source->info().width, 8);
}

TEST(Open, WhatIsLeftOutIsTold) {
    const TempFolder folder;
    write_ramp(folder / "cam0/data/a.png", 8, 6, 1);
    write_ramp(folder / "cam1/data/a.png", 8, 6, 2);
    write_text(folder / "cam0/data.csv", "1000000000,a.png\n2000000000,b.png\n");
    write_text(folder / "cam1/data.csv", "1000000000,a.png\n");
    EXPECT_HAS(open_source({folder.path().string()}).note, "1 left and 0 right");
}

TEST(Open, ARenderedSceneBringsItsRig) {
    const OpenedSource opened = open_source({"synthetic:plane"});
    ASSERT_TRUE(opened.rig.has_value());
    EXPECT_TRUE(opened.rig->calibrated);
    EXPECT_EQ(opened.rig->width, opened.source->info().width);
    EXPECT_TRUE(opened.folder.empty());
}

TEST(Open, WhatCannotBeOpenedIsRefused) {
    EXPECT_HAS(refusal(ExitStatus::kInput, [] { open_source({"no/such/place"}); }),
               "'no/such/place'; expected");
    EXPECT_HAS(refusal(ExitStatus::kUsage, [] { open_source({"synthetic:plane", "other"}); }), "other");
    refusal(ExitStatus::kUsage, [] { open_source({}); });
    refusal(ExitStatus::kUsage, [] { open_source({"synthetic:no_such_scene"}); });
}

}  // namespace
}  // namespace groundline::capture
