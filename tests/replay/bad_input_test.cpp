// What goes wrong for a user: one clear sentence, the documented status, and nothing half-written.
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/videoio.hpp>

#include "replay/program.hpp"

namespace groundline::test {
namespace {

namespace fs = std::filesystem;

// Four good pairs of 96x64 with a calibration, rendered once.
const fs::path& good_pairs() {
    static const Folder folder;
    static const fs::path pairs = [] {
        const fs::path out = folder / "pairs";
        const Outcome outcome =
            run_groundline({"synth", "boxes?width=160&height=120&focal=125&frames=4", "--out", out.string()});
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return out;
    }();
    return pairs;
}

class BadInput : public testing::Test {
  protected:
    void SetUp() override {
        fs::create_directory(source_);
        for (const char* part : {"left", "right", "calib.txt"})
            fs::copy(good_pairs() / part, source_ / part, fs::copy_options::recursive);
    }

    // Replays with an output folder and expects refusal: status, one sentence that names `what`, no output.
    void expect_refused(int status, const std::string& what, std::vector<std::string> more = {}) {
        std::vector<std::string> words{"replay",      source_.string(), "--out",
                                       out_.string(), "--set",          "stereo.disparities=32"};
        words.insert(words.end(), more.begin(), more.end());
        const Outcome outcome = run_groundline(words);
        EXPECT_EQ(outcome.status, status) << outcome.err;
        EXPECT_TRUE(outcome.one_sentence()) << outcome.err;
        EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
        EXPECT_EQ(outcome.out, "");
        EXPECT_FALSE(fs::exists(out_)) << "an output folder was begun";
    }
    // Expects the run to go on without pair `position`, whose `what` is named.
    void expect_left_out(int position, const std::string& what) {
        const Outcome outcome = run_groundline({"replay", source_.string(), "--out", out_.string(), "--set",
                                                "stereo.disparities=32", "--quiet"});
        EXPECT_EQ(outcome.status, 66);
        EXPECT_TRUE(outcome.one_sentence()) << outcome.err;
        EXPECT_NE(outcome.err.find("pair " + std::to_string(position)), std::string::npos) << outcome.err;
        EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
        std::ifstream summary(out_ / "summary.json");
        const std::string text{std::istreambuf_iterator<char>(summary), {}};
        EXPECT_NE(text.find("\"complete\": false"), std::string::npos) << text;
        EXPECT_NE(text.find("\"frames_bad\": 1"), std::string::npos) << text;
        for (int frame = 0; frame < 4; ++frame)
            EXPECT_EQ(fs::exists(out_ / ("mask/00000" + std::to_string(frame) + ".png")), frame != position);
    }
    void calibration(const std::string& text) { write_text(source_ / "calib.txt", text); }

    Folder folder_;
    fs::path source_ = folder_ / "source";
    fs::path out_ = folder_ / "out";
};

TEST_F(BadInput, GoodPairsAreReplayed) {
    const Outcome outcome = run_groundline(
        {"replay", source_.string(), "--out", out_.string(), "--set", "stereo.disparities=32"});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(outcome.err, "");
}

TEST_F(BadInput, SourceMissing) {
    fs::remove_all(source_);
    expect_refused(66, source_.string());
}

TEST_F(BadInput, SourceNothingKnown) {
    fs::remove_all(source_ / "left");
    fs::remove_all(source_ / "right");
    expect_refused(66, source_.string());
}

TEST_F(BadInput, FolderWithOneSideOnly) {
    fs::remove_all(source_ / "right");
    expect_refused(66, "right");
}

TEST_F(BadInput, PairWithOneSideOnly) {
    fs::remove(source_ / "right/000002.png");
    expect_refused(66, "000002.png");
}

TEST_F(BadInput, FirstImageEmpty) {
    write_text(source_ / "left/000000.png", "");
    expect_refused(66, "left/000000.png");
}

TEST_F(BadInput, FirstImageTruncated) {
    fs::resize_file(source_ / "right/000000.png", fs::file_size(source_ / "right/000000.png") / 2);
    expect_refused(66, "right/000000.png");
}

TEST_F(BadInput, FirstImageNotAnImage) {
    write_text(source_ / "left/000000.png", "this is a letter, not a picture");
    expect_refused(66, "left/000000.png");
}

TEST_F(BadInput, LeftAndRightOfDifferentSize) {
    const Folder other;
    ASSERT_EQ(run_groundline({"synth", "plane?width=176&height=120", "--out", other.at("p")}).status, 0);
    fs::copy_file(other / "p/right/000000.png", source_ / "right/000000.png",
                  fs::copy_options::overwrite_existing);
    expect_refused(66, "176");
}

TEST_F(BadInput, ALaterImageEmptyIsLeftOut) {
    write_text(source_ / "left/000001.png", "");
    expect_left_out(1, "left/000001.png");
}

TEST_F(BadInput, ALaterImageTruncatedIsLeftOut) {
    fs::resize_file(source_ / "right/000003.png", fs::file_size(source_ / "right/000003.png") - 20);
    expect_left_out(3, "right/000003.png");
}

TEST_F(BadInput, ALaterPairOfAnotherSizeIsLeftOut) {
    const Folder other;
    ASSERT_EQ(run_groundline({"synth", "plane?width=176&height=120", "--out", other.at("p")}).status, 0);
    for (const char* side : {"left", "right"})
        fs::copy_file(other / ("p/" + std::string(side) + "/000000.png"),
                      source_ / (std::string(side) + "/000002.png"), fs::copy_options::overwrite_existing);
    expect_left_out(2, "000002.png");
}

TEST_F(BadInput, CalibrationUnreadable) {
    expect_refused(66, "nowhere.yaml", {"--calibration", folder_.at("nowhere.yaml")});
}

TEST_F(BadInput, CalibrationMalformed) {
    calibration("P0: 125 0 80 0 0 125\nP1: nonsense\n");
    expect_refused(78, "calib.txt");
}

TEST_F(BadInput, CalibrationNotANumber) {
    calibration("P0: nan 0 80 0 0 125 60 0 0 0 1 0\nP1: 125 0 80 -15 0 125 60 0 0 0 1 0\n");
    expect_refused(78, "calib.txt");
}

TEST_F(BadInput, CalibrationWithZeroBaseline) {
    calibration("P0: 125 0 80 0 0 125 60 0 0 0 1 0\nP1: 125 0 80 0 0 125 60 0 0 0 1 0\n");
    expect_refused(78, "baseline");
}

TEST_F(BadInput, CalibrationOfAnotherSize) {
    calibration("P0: 707 0 601 0 0 707 183 0 0 0 1 0\nP1: 707 0 601 -379 0 707 183 0 0 0 1 0\n");
    expect_refused(78, "calib.txt");
}

TEST_F(BadInput, UnknownConfigurationKeyOnTheCommandLine) {
    expect_refused(78, "'stereo.matcher'", {"--set", "stereo.matchr=paper"});
}

TEST_F(BadInput, UnknownConfigurationKeyInTheFile) {
    write_text(folder_ / "c.yaml", "stereo:\n  matcher: paper\n  chekcs: off\n");
    expect_refused(78, "c.yaml:3", {"--config", folder_.at("c.yaml")});
    expect_refused(78, "'stereo.checks'", {"--config", folder_.at("c.yaml")});
}

TEST_F(BadInput, ConfigurationNotANumber) {
    expect_refused(78, "terrain.tolerance_m", {"--set", "terrain.tolerance_m=nan"});
}

TEST_F(BadInput, HalfAMount) {
    expect_refused(78, "mount.pitch_deg", {"--set", "mount.height_m=1"});
}

TEST_F(BadInput, MoreDisparitiesThanThePictureIsWide) {
    expect_refused(78, "disparities", {"--set", "stereo.disparities=256"});
}

TEST_F(BadInput, OutputFolderHoldsSomethingElse) {
    write_text(out_ / "thesis.txt", "do not lose me");
    const Outcome outcome = run_groundline({"replay", source_.string(), "--out", out_.string()});
    EXPECT_EQ(outcome.status, 66);
    EXPECT_TRUE(outcome.one_sentence()) << outcome.err;
    EXPECT_NE(outcome.err.find(out_.string()), std::string::npos) << outcome.err;
    EXPECT_EQ(names(out_), std::vector<std::string>{"thesis.txt"});
}

TEST_F(BadInput, AnEarlierResultOfOursIsReplaced) {
    write_text(folder_ / "empty/keep", "");
    ASSERT_EQ(run_groundline({"replay", source_.string(), "--out", out_.string()}).status, 0);
    EXPECT_EQ(run_groundline({"replay", source_.string(), "--frames", "1", "--out", out_.string()}).status,
              0);
    EXPECT_TRUE(fs::exists(out_ / "mask/000000.png"));
    EXPECT_FALSE(fs::exists(out_ / "mask/000001.png")) << "a picture of the earlier result was left";
}

TEST_F(BadInput, AVideoOfOddWidth) {
    fs::remove_all(source_);
    source_ = folder_ / "odd.avi";
    cv::VideoWriter video(source_.string(), cv::CAP_OPENCV_MJPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'),
                          10.0, {161, 64});
    ASSERT_TRUE(video.isOpened());
    video.write(cv::Mat(64, 161, CV_8UC3, cv::Scalar(90, 90, 90)));
    video.release();
    expect_refused(66, "odd.avi");
}

TEST(Misuse, EndsWithStatusTwoAndOneLine) {
    const std::vector<std::vector<std::string>> cases = {
        {},
        {"fly"},
        {"replay"},
        {"replay", "a", "b", "c"},
        {"replay", "synthetic:plane", "--threads", "0"},
        {"replay", "synthetic:plane", "--rate", "fast"},
        {"replay", "synthetic:plane", "--frames", "-3"},
        {"replay", "synthetic:plane", "--set", "stereo.matcher"},
        {"replay", "synthetic:plane", "--loop", "--out", "/tmp/groundline-never"},
        {"replay", "synthetic:plain"},
        {"synth", "plane?coluor=1", "--out", "/tmp/groundline-never"},
        {"evaluate"},
        {"evaluate", "only-one"},
    };
    for (const auto& words : cases) {
        const Outcome outcome = run_groundline(words);
        EXPECT_EQ(outcome.status, 2) << testing::PrintToString(words) << outcome.err;
        EXPECT_TRUE(outcome.one_sentence()) << testing::PrintToString(words) << outcome.err;
        EXPECT_FALSE(fs::exists("/tmp/groundline-never"));
    }
}

TEST(Help, GoesToStdoutWithStatusZero) {
    for (const std::vector<std::string>& words :
         {std::vector<std::string>{"--help"}, {"--version"}, {"replay", "--help"}, {"synth", "--help"}}) {
        const Outcome outcome = run_groundline(words);
        EXPECT_EQ(outcome.status, 0);
        EXPECT_EQ(outcome.err, "");
        EXPECT_FALSE(outcome.out.empty());
    }
}

}  // namespace
}  // namespace groundline::test
