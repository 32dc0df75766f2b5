#include "io/result_writer.hpp"

#include <gtest/gtest.h>

#include <clocale>
#include <limits>
#include <locale>
#include <nlohmann/json.hpp>
#include <sstream>

#include "io/picture.hpp"
#include "io_result_fixture.hpp"
#include "io_test_support.hpp"

namespace groundline::io {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;
using testing::HandMade;
using testing::kHeight;
using testing::kWidth;
using testing::listing;
using testing::read_text;
using testing::refusal;
using testing::TempFolder;
using testing::write_text;

void fill_line(HandMade& made) {
    FrameResult& result = made.result;
    result.verdict = Verdict::kDegraded;
    result.reasons.add(Reason::kNoMountPrior);
    result.reasons.add(Reason::kUneven);
    result.ground.found = result.ground.metric = true;
    result.ground.plane = {0.001, 0.25, -12.5};
    result.ground.pose = {det::radians(1.5), det::radians(-2.0), 1.65};
    result.ground.sigma = {det::radians(0.125), det::radians(0.25), 0.015625};
    result.share = {0.5, 0.25, 0.125, 0.125};
    Sector blocked;
    blocked.bearing_rad = det::radians(10.0);
    blocked.width_rad = det::radians(5.0);
    blocked.blocked = blocked.held = true;
    blocked.kind = TerrainClass::kObstacle;
    blocked.nearest_m = 3.25;
    blocked.nearest_sigma_m = 0.0625;
    blocked.free_range_m = 3.0;
    blocked.coverage = 0.75;
    Sector open = blocked;
    open.bearing_rad = det::radians(-10.0);
    open.blocked = open.held = false;
    open.kind = TerrainClass::kUnknown;
    result.sectors.push_back(blocked);
    result.sectors.push_back(open);
}

constexpr const char* kGoldenLine =
    R"({"frame":7,"source":"000007.png","utime_us":700000,"verdict":"degraded",)"
    R"("reasons":["no_mount_prior","uneven"],)"
    R"("ground":{"plane":[0.001000000,0.250000000,-12.500000],"pitch_deg":1.500000,"roll_deg":-2.000000,)"
    R"("height_m":1.650000,"sigma":{"pitch_deg":0.125000,"roll_deg":0.250000,"height_m":0.015625}},)"
    R"("share":{"unknown":0.500000,"traversable":0.250000,"obstacle":0.125000,"drop":0.125000},)"
    R"("sectors":[{"bearing_deg":10.0000,"width_deg":5.0000,"blocked":true,"held":true,"kind":"obstacle",)"
    R"("nearest_m":3.2500,"sigma_m":0.0625,"free_range_m":3.0000,"coverage":0.750000},)"
    R"({"bearing_deg":-10.0000,"width_deg":5.0000,"blocked":false,"held":false,"kind":"unknown",)"
    R"("nearest_m":null,"sigma_m":null,"free_range_m":3.0000,"coverage":0.750000}]})";

constexpr const char* kGoldenWithoutGround =
    R"({"frame":7,"source":"000007.png","utime_us":700000,"verdict":"blind","reasons":["no_ground"],)"
    R"("ground":{"plane":null,"pitch_deg":null,"roll_deg":null,"height_m":null,)"
    R"("sigma":{"pitch_deg":null,"roll_deg":null,"height_m":null}},)"
    R"("share":{"unknown":1.000000,"traversable":0.000000,"obstacle":0.000000,"drop":0.000000},)"
    R"("sectors":[]})";

TEST(FrameLine, IsTheGoldenText) {
    HandMade made;
    fill_line(made);
    EXPECT_EQ(frame_line(made.result), kGoldenLine);
    HandMade blind;
    blind.result.reasons.add(Reason::kNoGround);
    blind.result.share = {1.0, -0.0, 0.0, 0.0};
    EXPECT_EQ(frame_line(blind.result), kGoldenWithoutGround);
}

TEST(FrameLine, IsValidJsonWhateverTheNameAndNumbers) {
    HandMade made;
    fill_line(made);
    made.result.stamp.set_name("a\"b\\c\n\xC3(\xE2\x82\xAC.png");
    made.result.ground.pose.height_m = std::numeric_limits<double>::quiet_NaN();
    made.result.ground.plane.d0 = -std::numeric_limits<double>::infinity();
    made.result.ground.plane.du = -1e-12;
    made.result.share[0] = 1e300;
    const std::string line = frame_line(made.result);
    EXPECT_EQ(line.find('\n'), std::string::npos);
    const json parsed = json::parse(line);
    EXPECT_EQ(parsed["source"].get<std::string>().substr(0, 6), "a\"b\\c\n");
    EXPECT_TRUE(parsed["ground"]["height_m"].is_null());
    EXPECT_TRUE(parsed["ground"]["plane"][2].is_null());
    EXPECT_HAS(line, "\"plane\":[0.000000000,");
}

TEST(FrameLine, WithoutMetresThePlaneAloneIsTold) {
    HandMade made;
    fill_line(made);
    made.result.ground.metric = false;
    const json parsed = json::parse(frame_line(made.result));
    EXPECT_EQ(parsed["ground"]["plane"][1], 0.25);
    EXPECT_TRUE(parsed["ground"]["height_m"].is_null());
    EXPECT_TRUE(parsed["ground"]["sigma"]["roll_deg"].is_null());
}

// Streams take their decimal point from the C++ locale, printf takes it from the C locale, which can be
// tried only where one with a comma is installed.
TEST(FrameLine, KnowsNoLocale) {
    struct Comma : std::numpunct<char> {
        char do_decimal_point() const override { return ','; }
    };
    HandMade made;
    fill_line(made);
    const std::locale before = std::locale::global(std::locale(std::locale(), new Comma));
    for (const char* name : {"de_DE.UTF-8", "fr_FR.UTF-8", "C"}) {
        std::setlocale(LC_ALL, name);
        EXPECT_EQ(frame_line(made.result), kGoldenLine) << name;
    }
    std::locale::global(before);
}

TEST(ResultWriter, WritesNothingBeforeItIsTold) {
    const TempFolder folder;
    Counters counters;
    { const ResultWriter writer(folder / "out", counters); }
    EXPECT_FALSE(fs::exists(folder / "out"));
    { const ResultWriter writer(folder.path(), counters); }
    EXPECT_TRUE(listing(folder.path()).empty());
}

TEST(ResultWriter, WritesEveryFileOfTheContract) {
    const TempFolder folder;
    const fs::path out = folder / "deep/out";
    Counters counters;
    HandMade made;
    fill_line(made);
    made.set_pixel(3, 2, TerrainClass::kObstacle, 8.0);
    made.result.times_ns[static_cast<std::size_t>(Stage::kMatch)] = 12'345'678;
    ResultWriter writer(out, counters);
    writer.begin({{"source", "here"}});
    const json first = json::parse(read_text(out / "summary.json"));
    EXPECT_EQ(first["complete"], false);
    EXPECT_TRUE(first.contains("groundline"));
    EXPECT_EQ(first["source"], "here");

    ASSERT_TRUE(writer.consume(made.result)) << writer.error();
    EXPECT_EQ(read_text(out / "frames.jsonl"), std::string(kGoldenLine) + "\n") << "before the end too";
    made.result.stamp.position = 1234567;
    ASSERT_TRUE(writer.consume(made.result));
    writer.finish({{"frames", 2}, {"complete", "not ours to say"}}, true);

    const json last = json::parse(read_text(out / "summary.json"));
    EXPECT_EQ(last["complete"], true);
    EXPECT_EQ(last["frames"], 2);
    EXPECT_FALSE(last.contains("source"));
    for (const char* kind : {"disparity", "mask", "overlay", "vdisparity"})
        for (const char* name : {"000007.png", "1234567.png"})
            EXPECT_TRUE(fs::exists(out / kind / name)) << kind << name;
    const Image8 mask = read_image(out / "mask/000007.png");
    ASSERT_EQ(mask.width, kWidth);
    ASSERT_EQ(mask.height, kHeight);
    EXPECT_EQ(mask.luma().at(3, 2), 2);
    EXPECT_EQ(mask.luma().at(4, 2), 1);
    Image8 picture;
    paint_overlay(made.result, picture);
    EXPECT_EQ(read_image(out / "overlay/000007.png").bytes, picture.bytes);
    paint_v_disparity(made.result, picture);
    EXPECT_EQ(read_image(out / "vdisparity/000007.png").bytes, picture.bytes);

    std::istringstream timing(read_text(out / "timing.jsonl"));
    std::string line;
    ASSERT_TRUE(std::getline(timing, line));
    const json times = json::parse(line);
    EXPECT_EQ(times["frame"], 7);
    EXPECT_EQ(times["match_ms"], 12.346);
    EXPECT_GT(times["write_ms"], 0.0) << "the writer's own time";
    for (const char* key : {"read_ms", "rectify_ms", "ground_ms", "classify_ms", "publish_ms"})
        EXPECT_TRUE(times.contains(key)) << key;
    EXPECT_TRUE(testing::temporary_files(out).empty());
}

TEST(ResultWriter, DisparityComesBackWithClampsCounted) {
    const TempFolder folder;
    Counters counters;
    HandMade made;
    auto& q4 = made.result.disparity.disparity_q4;
    q4.at(0, 0) = 1;     // 1/16 px
    q4.at(1, 0) = 4095;  // 255.9375 px, the largest that fits
    q4.at(2, 0) = 4096;  // 256 px: too large
    q4.at(3, 0) = 0;     // valid, yet 0 means none in the file
    q4.at(4, 0) = -5;    // measured disparities may be negative (offset)
    q4.at(5, 0) = 32767;
    made.set_invalid(6, 0, Invalid::kSpeckle);
    made.set_invalid(7, 0, Invalid::kRangeEdge);
    q4.at(7, 0) = 4096;  // not valid: neither written nor counted
    ResultWriter writer(folder / "out", counters);
    writer.begin({});
    ASSERT_TRUE(writer.consume(made.result));
    const Image16 file = read_disparity_truth(folder / "out/disparity/000007.png");
    ASSERT_TRUE(file.view().same_size(kWidth, kHeight));
    const std::vector<std::uint16_t> row(file.pixels.begin(), file.pixels.begin() + 9);
    EXPECT_EQ(row, (std::vector<std::uint16_t>{16, 65520, 65535, 1, 1, 65535, 0, 0, 2048}));
    EXPECT_EQ(counters.get(Count::kDisparityClamped), 4U);
}

TEST(ResultWriter, EqualResultsAreEqualBytes) {
    const TempFolder folder;
    Counters counters;
    HandMade made;
    fill_line(made);
    for (const char* name : {"a", "b"}) {
        ResultWriter writer(folder / name, counters);
        writer.begin({});
        ASSERT_TRUE(writer.consume(made.result));
        writer.finish({}, true);
        fs::remove(folder / name / "timing.jsonl");
    }
    EXPECT_EQ(listing(folder / "a"), listing(folder / "b"));
}

TEST(ResultWriter, AForeignFolderIsRefusedAndUntouched) {
    Counters counters;
    for (const std::string name : {"thesis.tex", "left/000000.png", ".git/config"}) {
        const TempFolder folder;
        write_text(folder / name, "precious");
        const auto before = listing(folder.path());
        const std::string sentence =
            refusal(ExitStatus::kInput, [&] { ResultWriter(folder.path(), counters); });
        EXPECT_HAS(sentence, folder.path().string());
        EXPECT_HAS(sentence, fs::path(name).begin()->string());
        EXPECT_HAS(sentence, "choose a new or an empty folder");
        EXPECT_EQ(listing(folder.path()), before);
    }
    for (const std::string summary : {"{\"complete\": true}", "[\"groundline\"]", "{\"groundline\": ", ""}) {
        const TempFolder folder;
        write_text(folder / "summary.json", summary);
        refusal(ExitStatus::kInput, [&] { ResultWriter(folder.path(), counters); });
        EXPECT_EQ(read_text(folder / "summary.json"), summary);
    }
    const TempFolder folder;
    write_text(folder / "file", "x");
    EXPECT_HAS(refusal(ExitStatus::kInput, [&] { ResultWriter(folder / "file", counters); }), "is no folder");
}

TEST(ResultWriter, AnEarlierResultIsReplacedAndStrangersInItStay) {
    const TempFolder folder;
    const fs::path out = folder / "out";
    Counters counters;
    HandMade made;
    for (const int frames : {3, 1}) {
        ResultWriter writer(out, counters);
        writer.begin({});
        for (int i = 0; i < frames; ++i) {
            made.result.stamp.position = i;
            ASSERT_TRUE(writer.consume(made.result));
        }
        writer.finish({{"frames", frames}}, true);
        if (frames == 1) break;
        write_text(out / "mask/my_notes.png", "mine");
        write_text(out / "mask/.000002.png.tmp", "left by a killed run");
    }
    EXPECT_EQ(json::parse(read_text(out / "summary.json"))["frames"], 1);
    EXPECT_TRUE(fs::exists(out / "mask/000000.png"));
    EXPECT_FALSE(fs::exists(out / "mask/000001.png"));
    EXPECT_FALSE(fs::exists(out / "overlay/000002.png"));
    EXPECT_EQ(read_text(out / "mask/my_notes.png"), "mine");
    EXPECT_TRUE(testing::temporary_files(out).empty());
    const std::string lines = read_text(out / "frames.jsonl");
    EXPECT_EQ(std::count(lines.begin(), lines.end(), '\n'), 1);
    { ResultWriter(out, counters).begin({}); }
    EXPECT_FALSE(fs::exists(out / "mask/000000.png"));
    EXPECT_EQ(read_text(out / "frames.jsonl"), "");
}

TEST(ResultWriter, ARunThatWasCutOffSaysSoAndCanBeReplaced) {
    const TempFolder folder;
    Counters counters;
    HandMade made;
    {
        ResultWriter writer(folder / "out", counters);
        writer.begin({{"source", "here"}});
        ASSERT_TRUE(writer.consume(made.result));
    }
    EXPECT_EQ(json::parse(read_text(folder / "out/summary.json"))["complete"], false);
    const std::string lines = read_text(folder / "out/frames.jsonl");
    ASSERT_TRUE(lines.ends_with("}\n"));
    EXPECT_EQ(json::parse(lines)["frame"], 7);
    const ResultWriter again(folder / "out", counters);
}

TEST(ResultWriter, AFailureIsToldNotThrown) {
    const TempFolder folder;
    Counters counters;
    HandMade made;
    ResultWriter writer(folder / "out", counters);
    writer.begin({});
    fs::remove_all(folder / "out/overlay");
    EXPECT_FALSE(writer.consume(made.result));
    EXPECT_HAS(writer.error(), (folder / "out/overlay/000007.png").string());
    EXPECT_EQ(read_text(folder / "out/frames.jsonl"), "") << "a line stands for a whole frame";
}

TEST(ResultWriter, AFolderThatCannotBeMadeIsToldAtTheBeginning) {
    const TempFolder folder;
    Counters counters;
    write_text(folder / "file", "x");
    const std::string sentence =
        refusal(ExitStatus::kFailed, [&] { ResultWriter(folder / "file/out", counters).begin({}); });
    EXPECT_HAS(sentence, "file/out");
}

}  // namespace
}  // namespace groundline::io
