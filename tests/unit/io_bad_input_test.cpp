#include <gtest/gtest.h>

#include "core/arena.hpp"
#include "io/pair_reader.hpp"
#include "io_test_support.hpp"

namespace groundline::io {
namespace {

namespace fs = std::filesystem;
using testing::refusal;
using testing::TempFolder;
using testing::write_ramp;
using testing::write_text;

std::string refused(const fs::path& path) {
    return refusal(ExitStatus::kInput, [&] { open_pairs({path.string()}); });
}

void write_pairs(const TempFolder& folder, int count) {
    for (int i = 0; i < count; ++i) {
        const std::string name = "00000" + std::to_string(i) + ".png";
        write_ramp(folder / "left" / name, 21, 13, i);
        write_ramp(folder / "right" / name, 21, 13, 100 + i);
    }
}

void cut_in_half(const fs::path& path) {
    const std::string bytes = testing::read_text(path);
    write_text(path, bytes.substr(0, bytes.size() / 2));
}

TEST(BadInput, WhatIsNotThere) {
    const TempFolder folder;
    const std::string sentence = refused(folder / "absent");
    EXPECT_HAS(sentence, (folder / "absent").string());
    EXPECT_HAS(sentence, "expected a folder with left/ and right/");
}

TEST(BadInput, AFolderOfNothingKnownListsWhatIsAccepted) {
    const TempFolder folder;
    write_text(folder / "notes.txt", "hello");
    const std::string sentence = refused(folder.path());
    EXPECT_HAS(sentence, folder.path().string());
    for (const char* layout : {"left/ and right/", "left.png", "KITTI", "EuRoC", "Middlebury", "video"})
        EXPECT_HAS(sentence, layout);
}

TEST(BadInput, AFileOfNothingKnown) {
    const TempFolder folder;
    write_text(folder / "notes.txt", "no video at all");
    write_text(folder / "empty.avi", "");
    EXPECT_HAS(refused(folder / "notes.txt"), "notes.txt' as a video");
    EXPECT_HAS(refused(folder / "empty.avi"), "empty.avi' is empty");
}

TEST(BadInput, OneImageAloneAndAFolderAsAnImage) {
    const TempFolder folder;
    write_ramp(folder / "a.png", 8, 6, 0);
    EXPECT_HAS(refused(folder / "a.png"), "a.png' is one image; expected a left and a right image");
    EXPECT_HAS(refusal(ExitStatus::kInput,
                       [&] {
                           open_pairs({(folder / "a.png").string(), folder.path().string()});
                       }),
               "is a folder where one of two images was expected");
    EXPECT_HAS(refusal(ExitStatus::kUsage, [] { open_pairs({}); }), "one or two words");
    EXPECT_HAS(refusal(ExitStatus::kUsage, [] { open_pairs({"a", "b", "c"}); }), "one or two words");
}

TEST(BadInput, OneSideOnlyInEveryLayout) {
    for (const auto& [there, missing] :
         std::vector<std::pair<std::string, std::string>>{{"left/a.png", "right/"},
                                                          {"right/a.png", "left/"},
                                                          {"left.png", "right"},
                                                          {"im0.png", "im1"},
                                                          {"image_0/a.png", "image_1/"},
                                                          {"image_2/a.png", "image_3/"},
                                                          {"image_00/data/0.png", "image_01/data/"},
                                                          {"image_03/data/0.png", "image_02/data/"}}) {
        const TempFolder folder;
        write_ramp(folder / there, 8, 6, 0);
        const std::string sentence = refused(folder.path());
        EXPECT_HAS(sentence, folder.path().string());
        EXPECT_HAS(sentence, missing + "; expected both sides");
    }
    const TempFolder folder;
    write_text(folder / "mav0/cam0/data.csv", "1,1.png\n");
    EXPECT_HAS(refused(folder.path()), "mav0/cam0/data.csv but not mav0/cam1/data.csv");
}

TEST(BadInput, EmptyFolders) {
    const TempFolder folder;
    fs::create_directories(folder / "left");
    fs::create_directories(folder / "right");
    EXPECT_HAS(refused(folder.path()), "hold no images");
}

TEST(BadInput, NamesOnOneSideOnlyAreNamed) {
    const TempFolder folder;
    write_pairs(folder, 2);
    write_ramp(folder / "left/000007.png", 21, 13, 0);
    write_ramp(folder / "right/000008.png", 21, 13, 0);
    const std::string sentence = refused(folder.path());
    EXPECT_HAS(sentence, "left': 000007.png");
    EXPECT_HAS(sentence, "right': 000008.png");
}

TEST(BadInput, ABadFirstPairIsRefusedByName) {
    const auto broken = [](const std::string& side, auto damage) {
        const TempFolder folder;
        write_pairs(folder, 2);
        damage(folder / side / "000000.png");
        const std::string sentence = refused(folder.path());
        EXPECT_HAS(sentence, (folder / side / "000000.png").string());
        return sentence;
    };
    for (const std::string side : {"left", "right"}) {
        EXPECT_HAS(broken(side, [](const fs::path& path) { write_text(path, ""); }), "empty");
        EXPECT_HAS(broken(side, cut_in_half), "truncated");
        EXPECT_HAS(broken(side, [](const fs::path& path) { write_text(path, "text"); }), "it is not PNG");
        EXPECT_HAS(broken(side, [](const fs::path& path) { write_ramp(path, 21, 12, 0); }), "21x12");
    }
    const TempFolder folder;
    write_ramp(folder / "left.png", 8, 6, 0);
    EXPECT_HAS(refusal(ExitStatus::kInput,
                       [&] {
                           open_pairs({(folder / "left.png").string(), (folder / "gone.png").string()});
                       }),
               "gone.png");
}

// Pair 1 of 3 is damaged; the run must tell and go on.
void expect_told(const std::string& side, const std::string& why, void (*damage)(const fs::path&)) {
    const TempFolder folder;
    write_pairs(folder, 3);
    damage(folder / side / "000001.png");
    const OpenedPairs opened = open_pairs({folder.path().string()});
    Arena arena;
    StereoFrame frame = StereoFrame::make(arena, 21, 13, false);
    ASSERT_EQ(opened.reader->next(frame), Pull::kFrame);
    ASSERT_EQ(opened.reader->next(frame), Pull::kBad) << why;
    EXPECT_EQ(frame.stamp.position, 1);
    EXPECT_EQ(frame.stamp.utime_us, 100'000);
    EXPECT_HAS(opened.reader->error(), (folder / side / "000001.png").string());
    EXPECT_HAS(opened.reader->error(), why);
    ASSERT_EQ(opened.reader->next(frame), Pull::kFrame);
    EXPECT_EQ(frame.stamp.position, 2);
    EXPECT_EQ(frame.left.at(0, 0), 2);
    EXPECT_EQ(opened.reader->error(), "");
    EXPECT_EQ(opened.reader->next(frame), Pull::kEnd);
}

TEST(BadInput, ABadLaterPairIsToldAndTheNextOneFollows) {
    for (const std::string side : {"left", "right"}) {
        expect_told(side, "empty", [](const fs::path& path) { write_text(path, ""); });
        expect_told(side, "truncated", cut_in_half);
        expect_told(side, "it is not PNG", [](const fs::path& path) { write_text(path, "text"); });
        expect_told(side, "22x13 pixels; expected 21x13",
                    [](const fs::path& path) { write_ramp(path, 22, 13, 0); });
    }
}

TEST(BadInput, ALaterPairThatVanishes) {
    const TempFolder folder;
    write_pairs(folder, 2);
    const OpenedPairs opened = open_pairs({folder.path().string()});
    Arena arena;
    StereoFrame frame = StereoFrame::make(arena, 21, 13, false);
    fs::remove(folder / "right/000001.png");
    ASSERT_EQ(opened.reader->next(frame), Pull::kFrame);
    ASSERT_EQ(opened.reader->next(frame), Pull::kBad);
    EXPECT_HAS(opened.reader->error(), "right/000001.png': No such file");
}

TEST(BadInput, MalformedStampsAreToldByLine) {
    {
        const TempFolder folder;
        write_ramp(folder / "image_00/data/0.png", 8, 6, 0);
        write_ramp(folder / "image_01/data/0.png", 8, 6, 0);
        write_text(folder / "image_00/timestamps.txt", "2011-09-26 13:02:25.5\n2011-13-26 13:02:25.5\n");
        EXPECT_HAS(refused(folder.path()), "timestamps.txt:2: '2011-13-26");
        write_text(folder / "image_00/timestamps.txt", "\n");
        EXPECT_HAS(refused(folder.path()), "timestamps.txt' has no line for the image");
    }
    const TempFolder folder;
    write_text(folder / "mav0/cam1/data.csv", "#stamps\n5,r.png\n");
    for (const auto& [text, why] : std::vector<std::pair<std::string, std::string>>{
             {"#x\n12,a.png\nabc,b.png\n",
              "data.csv:3: expected 'stamp in ns, image file', found 'abc,b.png'"},
             {"12\n", "data.csv:1: expected"},
             {"12,a.png\n12,b.png\n", "data.csv:2: the stamp does not increase"},
             {"99000000,a.png\n", "has one in"},
             {"", "has one in"}}) {
        write_text(folder / "mav0/cam0/data.csv", text);
        EXPECT_HAS(refused(folder.path()), why);
    }
}

}  // namespace
}  // namespace groundline::io
