// The replay contract: the files, their forms, and the same bytes for any number of threads and any run.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "replay/program.hpp"

namespace groundline::test {
namespace {

using Json = nlohmann::json;

// All that depends on time or threads, and so may differ between runs.
const std::vector<std::string> kTimed = {"timing.jsonl", "summary.json"};

std::vector<Json> lines(const std::filesystem::path& file) {
    std::ifstream stream(file);
    std::vector<Json> objects;
    for (std::string line; std::getline(stream, line);)
        objects.push_back(Json::parse(line));
    return objects;
}

Outcome replay(const std::string& scene, const std::filesystem::path& out,
               std::vector<std::string> more = {}) {
    std::vector<std::string> words{"replay", "synthetic:" + scene, "--out", out.string(), "--quiet"};
    words.insert(words.end(), more.begin(), more.end());
    return run_groundline(words);
}

TEST(Contract, WritesEveryFileOfEveryFrame) {
    const Folder folder;
    const Outcome outcome = replay("boxes?width=320&height=240&focal=250&frames=3", folder / "out");
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    std::vector<std::string> expected{"frames.jsonl", "summary.json", "timing.jsonl"};
    for (const char* kind : {"disparity", "mask", "overlay", "vdisparity"})
        for (const char* frame : {"000000", "000001", "000002"})
            expected.push_back(std::string(kind) + "/" + frame + ".png");
    std::sort(expected.begin(), expected.end());
    EXPECT_EQ(names(folder / "out"), expected);

    const cv::Mat disparity = cv::imread(folder.at("out/disparity/000001.png"), cv::IMREAD_UNCHANGED);
    EXPECT_EQ(disparity.type(), CV_16UC1);
    EXPECT_EQ(disparity.size(), cv::Size(320, 240));
    const cv::Mat mask = cv::imread(folder.at("out/mask/000001.png"), cv::IMREAD_UNCHANGED);
    EXPECT_EQ(mask.type(), CV_8UC1);
    EXPECT_EQ(mask.size(), cv::Size(320, 240));
    double highest = 0;
    cv::minMaxLoc(mask, nullptr, &highest);
    EXPECT_EQ(highest, 2) << "three boxes stand in the scene";
    EXPECT_EQ(cv::imread(folder.at("out/overlay/000001.png"), cv::IMREAD_UNCHANGED).size(),
              cv::Size(320, 240));

    const std::vector<Json> frames = lines(folder / "out/frames.jsonl");
    ASSERT_EQ(frames.size(), 3U);
    for (std::size_t i = 0; i < frames.size(); ++i) {
        const Json& frame = frames[i];
        EXPECT_EQ(frame.at("frame"), i);
        for (const char* key : {"source", "utime_us", "verdict", "reasons", "ground", "share", "sectors"})
            EXPECT_TRUE(frame.contains(key)) << key;
        EXPECT_EQ(frame.at("verdict"), "trusted") << frame.dump();
        EXPECT_EQ(frame.at("ground").at("plane").size(), 3U);
        EXPECT_NEAR(frame.at("ground").at("height_m"), 1.0, 0.03);
        EXPECT_NEAR(frame.at("ground").at("pitch_deg"), 12.0, 0.5);
    }
    EXPECT_EQ(lines(folder / "out/timing.jsonl").size(), 3U);
    const Json summary = Json::parse(std::ifstream(folder / "out/summary.json"));
    EXPECT_EQ(summary.at("complete"), true);
    EXPECT_EQ(summary.at("settings").at("stereo.matcher"), "census_pyramid");
    EXPECT_EQ(summary.at("counters").at("results_delivered"), 3);
}

TEST(Contract, SameBytesForAnyThreadsAndEveryRun) {
    const Folder folder;
    const std::string scene = "drive?width=320&height=240&focal=250&frames=3&seed=5";
    std::string first;
    for (const char* threads : {"1", "2", "3", "2"}) {
        const Outcome outcome = replay(scene, folder / "out", {"--threads", threads});
        ASSERT_EQ(outcome.status, 0) << outcome.err;
        const std::string all = contents(folder / "out", kTimed);
        if (first.empty()) first = all;
        EXPECT_TRUE(all == first) << threads << " threads gave other bytes";
    }
    EXPECT_GT(first.size(), 10000U);
}

TEST(Contract, FilesAndTheSceneTheyCameFromGiveTheSameDisparities) {
    const Folder folder;
    const std::string scene = "boxes?width=320&height=240&focal=250&frames=2";
    ASSERT_EQ(run_groundline({"synth", scene, "--out", folder.at("pairs")}).status, 0);
    ASSERT_EQ(run_groundline({"replay", folder.at("pairs"), "--quiet", "--out", folder.at("files")}).status,
              0);
    ASSERT_EQ(replay(scene, folder / "rendered").status, 0);
    EXPECT_TRUE(contents(folder / "files/disparity") == contents(folder / "rendered/disparity"));
    EXPECT_TRUE(contents(folder / "files/mask") == contents(folder / "rendered/mask"));
}

TEST(Contract, InterruptedRunsKeepWhatIsDoneAndSaySo) {
    const Folder folder;
    const Outcome outcome = run_groundline(
        {"replay", "synthetic:drive?width=320&height=240&focal=250&frames=100000", "--out", folder.at("out")},
        folder / "out/frames.jsonl");
    EXPECT_EQ(outcome.status, 130) << outcome.err;
    const Json summary = Json::parse(std::ifstream(folder / "out/summary.json"));
    EXPECT_EQ(summary.at("complete"), false);
    const std::vector<Json> frames = lines(folder / "out/frames.jsonl");
    EXPECT_EQ(frames.size(), summary.at("counters").at("frames_read").get<std::size_t>());
    EXPECT_EQ(names(folder / "out/mask").size(), frames.size());
}

TEST(Contract, PacedRunsDeliverTheNewest) {
    const Folder folder;
    const Outcome outcome = replay("plane?width=160&height=120&focal=125&frames=5", folder / "out",
                                   {"--rate", "20", "--set", "stereo.disparities=32"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const std::vector<Json> frames = lines(folder / "out/frames.jsonl");
    ASSERT_FALSE(frames.empty());
    EXPECT_EQ(frames.back().at("frame"), 4);
}

}  // namespace
}  // namespace groundline::test
