// `groundline evaluate` on folders made by hand: what it counts, says, refuses and returns.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/evaluate_command.hpp"
#include "cli/evaluate_set.hpp"
#include "cli/replay_command.hpp"
#include "core/error.hpp"
#include "core/ground.hpp"
#include "io/png.hpp"
#include "unit/evaluate_support.hpp"

namespace groundline::cli {

// Stands in for the pipeline: the suite's own replay is only recorded.
ReplayOptions last_replay;
int run_replay(const ReplayOptions& options) {
    last_replay = options;
    return static_cast<int>(ExitStatus::kInput);
}

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kWidth = 8;
constexpr int kHeight = 2;

class Evaluate : public CommandTest {
  protected:
    Evaluate() {
        std::string pattern = testing::TempDir() + "evaluate-XXXXXX";
        root_ = ::mkdtemp(pattern.data());
        ::setenv("TMPDIR", (root_ / "tmp").c_str(), 1);  // where a suite puts its results
        fs::create_directory(root_ / "tmp");
    }
    ~Evaluate() override {
        ::unsetenv("TMPDIR");
        fs::remove_all(root_);
    }

    static void write(const fs::path& path, const std::string& text) {
        fs::create_directories(path.parent_path());
        std::ofstream(path, std::ios::binary) << text;
    }
    static void write16(const fs::path& path, std::vector<std::uint16_t> pixels, int width = kWidth) {
        fs::create_directories(path.parent_path());
        const int height = static_cast<int>(pixels.size()) / width;
        io::write_png(path, ConstImageView<std::uint16_t>(pixels.data(), width, height, width));
    }
    static void write8(const fs::path& path, std::vector<std::uint8_t> pixels, int width = kWidth) {
        fs::create_directories(path.parent_path());
        const int height = static_cast<int>(pixels.size()) / width;
        io::write_png(path, ConstLuma(pixels.data(), width, height, width));
    }
    static std::string line(int frame, const std::string& verdict, double pitch_deg) {
        return R"({"frame":)" + std::to_string(frame) + R"(,"verdict":")" + verdict +
               R"(","ground":{"plane":[0,1,2],"pitch_deg":)" + std::to_string(pitch_deg) +
               R"(,"roll_deg":0.5,"height_m":1.1,"sigma":{}}})" + "\n";
    }

    // Two frames. Top row of each: 4 ground, 4 sky pixels; bottom row: 4 ground, 4 obstacle pixels; 1 px of
    // the ground is occluded. The result answers 6 of 11 scored pixels of frame 0 (one is 2 px off, one 4 px)
    // and all of frame 1 exactly; its masks call one obstacle pixel free and one unknown, and alarm on one
    // ground pixel.
    void make_truth(const fs::path& folder, bool with_classes = true) const {
        for (const char* name : {"000000.png", "000001.png"}) {
            write16(folder / "disp" / name,
                    {512, 512, 512, 512, 0, 0, 0, 0, 512, 512, 512, 512, 2560, 2560, 2560, 2560});
            write8(folder / "occluded" / name, {0, 0, 0, 255, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
            if (!with_classes) continue;
            write8(folder / "class" / name, {1, 1, 1, 1, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2});
        }
        write(folder / "truth.json", R"({"frames":[{"pitch_deg":5,"roll_deg":0,"height_m":1.0},
                                        {"pitch_deg":5,"roll_deg":0,"height_m":1.0}]})");
    }
    void make_result(const fs::path& folder, int frames = 2) const {
        std::string lines;
        for (int i = 0; i < frames; ++i) {
            const std::string name = "00000" + std::to_string(i) + ".png";
            if (i == 0) {
                write16(folder / "disparity" / name,
                        {512, 512, 0, 512, 300, 0, 0, 0, 1024, 1536, 0, 0, 2560, 2560, 0, 0});
                write8(folder / "mask" / name, {1, 1, 0, 0, 0, 0, 0, 0, 2, 1, 0, 0, 2, 1, 0, 2});
            } else {
                write16(folder / "disparity" / name,
                        {512, 512, 512, 512, 0, 0, 0, 0, 512, 512, 512, 512, 2560, 2560, 2560, 2560});
                write8(folder / "mask" / name, {1, 1, 1, 1, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2});
            }
            lines += line(i, i == 0 ? "trusted" : "degraded", 5.0 + i);
        }
        write(folder / "frames.jsonl", lines);
    }

    int run(EvaluateOptions options) {
        return kept([&] { return run_evaluate(options); });
    }
    int run_pair(bool as_json = true) {
        EvaluateOptions options;
        options.truth = root_ / "truth";
        options.out = root_ / "out";
        options.json = as_json;
        return run(options);
    }

    fs::path root_;
};

TEST_F(Evaluate, FiguresOfAHandMadeSet) {
    make_truth(root_ / "truth");
    make_result(root_ / "out");
    ASSERT_EQ(run_pair(), 0) << sentence_;
    const json found = json::parse(out_);
    EXPECT_EQ(found["frames"],
              json::parse(R"({"evaluated":2,"without_result":0,"without_truth":0,"unreadable":0})"));
    EXPECT_EQ(found["verdicts"], json::parse(R"({"trusted":1,"degraded":1,"blind":0})"));
    EXPECT_EQ(found["disparity"],
              json::parse(R"({"scored":22,"answered":17,"occluded":2,"occlusion_from":"occluded/",
        "density":0.772727,"bad1":0.117647,"bad3":0.058824,"bad1_with_absent":0.318182,"bad3_with_absent":0.272727,
        "mean_abs_error_px":0.352941})"));
    EXPECT_EQ(found["terrain"],
              json::parse(R"({"truth":"class/","obstacle_pixels":8,"ground_pixels":16,"drop_pixels":0,
        "obstacle_recall":0.75,"obstacle_called_free":0.125,"ground_false_positive":0.0625,"ground_known":0.75,
        "drop_recall":null,"drop_called_free":null})"));
    EXPECT_EQ(found["pose"],
              json::parse(R"({"truth":"truth.json","frames":2,"pitch_deg_mean":0.5,"pitch_deg_max":1.0,
        "roll_deg_mean":0.5,"roll_deg_max":0.5,"height_share_mean":0.1,"height_share_max":0.1})"));
    EXPECT_TRUE(found["remarks"].empty());
    EXPECT_TRUE(err_.empty());

    const std::string first = out_;
    run_pair();
    EXPECT_EQ(out_, first);
    ASSERT_EQ(run_pair(false), 0);
    for (const char* part : {"77.3 %", "11.8 % of the answered; 31.8 %", "0.35 px", "75.0 %", "12.50 %",
                             "6.2 %", "1 trusted, 1 degraded, 0 blind", "0.50 deg, 1.00 deg"})
        EXPECT_NE(out_.find(part), std::string::npos) << part << " is not in:\n" << out_;
}

TEST_F(Evaluate, MissingFramesAreCountedAndSaid) {
    make_truth(root_ / "truth");
    make_result(root_ / "out", 1);
    write16(root_ / "out/disparity/000007.png", std::vector<std::uint16_t>(16));
    ASSERT_EQ(run_pair(), 0) << sentence_;
    const json found = json::parse(out_);
    EXPECT_EQ(found["frames"],
              json::parse(R"({"evaluated":1,"without_result":1,"without_truth":1,"unreadable":0})"));
    EXPECT_EQ(found["disparity"]["scored"], 11);  // the frame without result weighs nothing
    EXPECT_NE(err_.find("1 frame of the truth without a result"), std::string::npos) << err_;
    EXPECT_NE(err_.find("1 frame of the result without truth"), std::string::npos) << err_;
}

TEST_F(Evaluate, ALaterFrameThatCannotBeReadIsStatus66) {
    make_truth(root_ / "truth");
    make_result(root_ / "out");
    const fs::path broken = root_ / "out/disparity/000001.png";
    fs::resize_file(broken, fs::file_size(broken) / 2);
    EXPECT_EQ(run_pair(), 66);
    EXPECT_EQ(json::parse(out_)["frames"]["unreadable"], 1);
    EXPECT_EQ(json::parse(out_)["disparity"]["scored"], 11);
    EXPECT_NE(err_.find("000001.png"), std::string::npos) << err_;

    make_result(root_ / "out");
    write8(root_ / "out/mask/000001.png", std::vector<std::uint8_t>(18), 9);
    EXPECT_EQ(run_pair(), 66);
    EXPECT_NE(err_.find("has 9x2 pixels; expected 8x2"), std::string::npos) << err_;
}

TEST_F(Evaluate, RefusesWhatIsMissing) {
    make_truth(root_ / "truth");
    EXPECT_EQ(run_pair(), 66);
    EXPECT_NE(sentence_.find("holds no result"), std::string::npos) << sentence_;
    make_result(root_ / "out");
    fs::remove_all(root_ / "truth");
    EXPECT_EQ(run_pair(), 66);
    EXPECT_NE(sentence_.find("holds no truth"), std::string::npos) << sentence_;

    make_truth(root_ / "truth");
    for (const char* name : {"000000.png", "000001.png"})
        fs::rename(root_ / "out/disparity" / name, root_ / "out/disparity" / ("1" + std::string(name)));
    EXPECT_EQ(run_pair(), 66);
    EXPECT_NE(sentence_.find("no frame of"), std::string::npos) << sentence_;
    EXPECT_TRUE(out_.empty());
}

TEST_F(Evaluate, RefusesWhatIsMalformed) {
    make_truth(root_ / "truth");
    make_result(root_ / "out");
    write(root_ / "out/frames.jsonl",
          line(0, "trusted", 1) + "{\"frame\":1,\"verdict\":\"sure\",\"ground\":null}\n");
    EXPECT_EQ(run_pair(), 66);
    EXPECT_NE(sentence_.find("frames.jsonl:2:"), std::string::npos) << sentence_;

    make_result(root_ / "out");
    write(root_ / "truth/truth.json", R"({"frames":[{"pitch_deg":"steep"}]})");
    EXPECT_EQ(run_pair(), 66);
    EXPECT_NE(sentence_.find("truth.json"), std::string::npos) << sentence_;

    make_truth(root_ / "truth");
    write(root_ / "truth/calib.txt", "P0: 100 0 4 0 0 100 1\n");
    EXPECT_EQ(run_pair(), 78) << sentence_;
    EXPECT_NE(sentence_.find("calib.txt"), std::string::npos) << sentence_;
}

TEST_F(Evaluate, BeyondThirtyMetresNothingIsJudged) {
    make_truth(root_ / "truth");  // with this rig the ground is 45 m away, the obstacle 9 m
    write(root_ / "truth/calib.txt", "P0: 100 0 4 0 0 100 1 0 0 0 1 0\nP1: 100 0 4 -90 0 100 1 0 0 0 1 0\n");
    make_result(root_ / "out");
    ASSERT_EQ(run_pair(), 0) << sentence_;
    const json found = json::parse(out_);
    EXPECT_EQ(found["terrain"]["obstacle_pixels"], 8);
    EXPECT_EQ(found["terrain"]["ground_pixels"], 0);
    EXPECT_TRUE(found["terrain"]["ground_known"].is_null());
}

// With the truth folder's calibration the ground is 45 m away; the run's own says otherwise.
TEST_F(Evaluate, TheCalibrationOfTheRunGoesBeforeThatOfTheTruth) {
    make_truth(root_ / "truth");
    write(root_ / "truth/calib.txt", "P0: 100 0 4 0 0 100 1 0 0 0 1 0\nP1: 100 0 4 -90 0 100 1 0 0 0 1 0\n");
    make_result(root_ / "out");
    const auto summary = [](const char* focal, const char* baseline, const char* offset) {
        return std::string(R"({"calibration":{"file":"x","format":"y","cx_px":4,"cy_px":1,"focal_px":)") +
               focal + R"(,"baseline_m":)" + baseline + R"(,"disparity_offset_px":)" + offset + "}}";
    };
    const struct {
        std::string text;
        int ground_pixels;
    } cases[] = {{summary("100", "0.3", "0"), 16},     // 15 m
                 {summary("100", "0.3", "1.5"), 0},    // 60 m
                 {summary("100", "0.9", "-2.0"), 16},  // 22.5 m
                 {summary("250", "0.3", "0"), 0},      // 37.5 m
                 {R"({"calibration":null})", 0},      {R"({})", 0}};
    for (const auto& each : cases) {
        write(root_ / "out/summary.json", each.text);
        ASSERT_EQ(run_pair(), 0) << sentence_;
        const json found = json::parse(out_);
        EXPECT_EQ(found["terrain"]["ground_pixels"], each.ground_pixels) << each.text;
        EXPECT_EQ(found["terrain"]["obstacle_pixels"], 8) << each.text;
    }
    fs::remove(root_ / "truth/calib.txt");
    write(root_ / "out/summary.json", summary("100", "0.9", "0"));
    ASSERT_EQ(run_pair(), 0) << sentence_;
    EXPECT_EQ(json::parse(out_)["terrain"]["ground_pixels"], 0);
    for (const std::string& text :
         {summary("\"long\"", "0.3", "0"), summary("100", "0", "0"), summary("-1", "0.3", "0"),
          summary("100", "0.3", "null"), std::string(R"({"calibration":{}})"), std::string("{")}) {
        write(root_ / "out/summary.json", text);
        EXPECT_EQ(run_pair(), 66) << text;
        EXPECT_NE(sentence_.find("summary.json"), std::string::npos) << sentence_;
    }
}

TEST_F(Evaluate, WithoutClassesAndCalibrationOnlyDisparityIsJudged) {
    make_truth(root_ / "truth", false);
    fs::remove(root_ / "truth/truth.json");
    make_result(root_ / "out");
    ASSERT_EQ(run_pair(), 0) << sentence_;
    const json found = json::parse(out_);
    EXPECT_EQ(found["disparity"]["scored"], 22);
    EXPECT_TRUE(found["terrain"].is_null());
    EXPECT_TRUE(found["pose"].is_null());
    EXPECT_NE(err_.find("no terrain scores"), std::string::npos) << err_;
}

TEST_F(Evaluate, WithCalibrationTheDisparitiesTellTheTerrain) {
    RectifiedRig rig;
    rig.calibrated = true;
    rig.focal_px = 100.0;
    rig.cx_px = 32.0;
    rig.cy_px = 24.0;
    rig.cx_right_px = 32.0;
    rig.baseline_m = 0.3;
    const GroundPose pose{0.1, 0.0, 1.0};
    const DisparityPlane plane = plane_of(pose, rig);
    std::vector<std::uint16_t> truth(64 * 48);
    std::vector<std::uint8_t> mask(truth.size());
    for (std::size_t i = 0; i < truth.size(); ++i) {
        const auto x = static_cast<double>(i % 64);
        const auto y = static_cast<double>(i / 64);
        const bool box = x >= 20 && x < 30 && y >= 20 && y < 30;  // stands out everywhere: 0.5 m and more
        const double disparity = box ? 12.0 : plane.at(x, y);
        if (disparity > 0.0) truth[i] = static_cast<std::uint16_t>(disparity * 256.0 + 0.5);
        mask[i] = box ? 2 : 1;
    }
    write16(root_ / "truth/disp.png", truth, 64);
    write(root_ / "truth/calib.txt",
          "P0: 100 0 32 0 0 100 24 0 0 0 1 0\nP1: 100 0 32 -30 0 100 24 0 0 0 1 0\n");
    write16(root_ / "out/disparity/000000.png", truth, 64);
    write8(root_ / "out/mask/000000.png", mask, 64);
    write(root_ / "out/frames.jsonl", line(0, "trusted", 5.729578));
    ASSERT_EQ(run_pair(), 0) << sentence_;
    const json found = json::parse(out_);
    EXPECT_EQ(found["disparity"]["occlusion_from"], "disparity truth");
    EXPECT_GT(found["disparity"]["occluded"], 0);
    EXPECT_EQ(found["terrain"]["truth"], "disparity truth");
    EXPECT_EQ(found["terrain"]["obstacle_pixels"], 100);
    EXPECT_EQ(found["terrain"]["obstacle_recall"], 1.0);
    EXPECT_GT(found["terrain"]["ground_pixels"], 1000);
    EXPECT_EQ(found["terrain"]["ground_false_positive"], 0.0);
    EXPECT_EQ(found["pose"]["truth"], "disparity truth");
    EXPECT_LT(found["pose"]["pitch_deg_max"], 0.01);
    EXPECT_NEAR(found["pose"]["height_share_max"], 0.1, 0.001);
}

TEST_F(Evaluate, SuiteTabulatesEverySetAndTheMean) {
    make_truth(root_ / "suite/b_set");
    make_truth(root_ / "suite/a_set");
    make_truth(root_ / "suite/broken");
    write(root_ / "suite/without_truth/left.png", "");
    write(root_ / "suite/SOURCE.txt", "");
    EvaluateOptions options;
    options.suite = root_ / "suite";
    options.json = true;
    std::vector<std::string> sources;
    options.replay = [&](const fs::path& source, const fs::path& out) {
        sources.push_back(source.filename().string());
        EXPECT_EQ(out.parent_path().parent_path(), root_ / "tmp");
        if (source.filename() == "broken") throw Refusal(ExitStatus::kConfig, "the calibration is refused");
        make_result(out);
        if (source.filename() == "b_set")
            fs::copy_file(out / "mask/000001.png", out / "mask/000000.png",
                          fs::copy_options::overwrite_existing);
        return 0;
    };
    EXPECT_EQ(run(options), 78);
    EXPECT_EQ(sources, (std::vector<std::string>{"a_set", "b_set", "broken"}));
    EXPECT_TRUE(fs::is_empty(root_ / "tmp"));
    const json found = json::parse(out_);
    ASSERT_EQ(found["sets"].size(), 3U);
    EXPECT_EQ(found["sets"][0]["name"], "a_set");
    EXPECT_EQ(found["sets"][0]["status"], 0);
    EXPECT_EQ(found["sets"][0]["terrain"]["obstacle_recall"], 0.75);
    EXPECT_EQ(found["sets"][1]["terrain"]["obstacle_recall"], 1.0);
    EXPECT_EQ(found["sets"][2]["status"], 78);
    EXPECT_EQ(found["sets"][2]["problem"], "the calibration is refused");
    EXPECT_EQ(found["mean"]["terrain"]["obstacle_recall"], 0.875);  // of the two that could be compared
    EXPECT_EQ(found["mean"]["disparity"]["density"], 0.772727);
    EXPECT_TRUE(found["mean"]["terrain"]["drop_recall"].is_null());
    EXPECT_NE(err_.find("broken: the calibration is refused"), std::string::npos) << err_;

    options.json = false;
    EXPECT_EQ(run(options), 78);
    EXPECT_NE(out_.find("\nmean "), std::string::npos) << out_;
    EXPECT_NE(out_.find("87.5"), std::string::npos) << out_;
    EXPECT_NE(out_.find("\nbroken "), std::string::npos) << out_;

    options.sets = {"a", "b_"};
    sources.clear();
    EXPECT_EQ(run(options), 0);
    EXPECT_EQ(sources, (std::vector<std::string>{"a_set", "b_set"}));
}

TEST_F(Evaluate, SuiteEndsWhenAReplayIsInterrupted) {
    make_truth(root_ / "suite/a");
    make_truth(root_ / "suite/b");
    EvaluateOptions options;
    options.suite = root_ / "suite";
    int replays = 0;
    options.replay = [&](const fs::path&, const fs::path& out) {
        ++replays;
        make_result(out, 1);
        return 130;
    };
    EXPECT_EQ(run(options), 130);
    EXPECT_EQ(replays, 1);
    EXPECT_TRUE(fs::is_empty(root_ / "tmp"));
}

TEST_F(Evaluate, SuiteWithoutTruthIsRefused) {
    EvaluateOptions options;
    options.suite = root_ / "nowhere";
    EXPECT_EQ(run(options), 66);
    fs::create_directories(root_ / "suite/empty");
    options.suite = root_ / "suite";
    EXPECT_EQ(run(options), 66);
    EXPECT_NE(sentence_.find("holds truth"), std::string::npos) << sentence_;
}

TEST(EvaluateOptions, CommandLine) {
    const auto parse = [](std::vector<std::string> words) {
        EvaluateOptions options;
        CLI::App app;
        add_evaluate_options(app, options);
        std::reverse(words.begin(), words.end());  // as CLI11 wants them
        app.parse(words);
        if (options.replay && !options.suite.empty()) options.replay("source", "out");
        return options;
    };
    EXPECT_EQ(parse({"t", "o", "--json"}).out, "o");
    EXPECT_EQ(parse({"--suite", "d", "--set", "a=1", "--set", "b=2"}).suite, "d");
    EXPECT_EQ(last_replay.source, std::vector<std::string>{"source"});
    EXPECT_EQ(last_replay.set, (std::vector<std::string>{"a=1", "b=2"}));
    EXPECT_EQ(last_replay.out, "out");
    EXPECT_TRUE(last_replay.quiet);
    EXPECT_THROW(parse({}), CLI::ParseError);
    EXPECT_THROW(parse({"t"}), CLI::ParseError);
    EXPECT_THROW(parse({"t", "o", "--suite", "d"}), CLI::ParseError);
    EXPECT_THROW(parse({"t", "o", "--set", "a=1"}), CLI::ParseError);
}

TEST(EvaluateOptions, MatchersHaveTheirOwn) {
    const auto parse = [](std::vector<std::string> words) {
        EvaluateOptions options;
        CLI::App app;
        add_evaluate_options(app, options);
        std::reverse(words.begin(), words.end());
        app.parse(words);
        return options;
    };
    using Words = std::vector<std::string>;
    EXPECT_FALSE(parse({"--suite", "d"}).matchers);
    EXPECT_EQ(parse({"--suite", "d", "--sets", "a,b*"}).sets, (Words{"a", "b*"}));
    const EvaluateOptions all = parse({"--matchers", "--suite", "d"});
    EXPECT_TRUE(all.matchers);
    EXPECT_EQ(all.suite, "d");
    EXPECT_TRUE(all.matcher_names.empty());
    EXPECT_EQ(all.disparities, 0);
    const EvaluateOptions some = parse({"--suite", "d", "--matchers", "paper,bm15", "--conditions",
                                        "clean,noise", "--disparities", "208", "--json"});
    EXPECT_EQ(some.matcher_names, (Words{"paper", "bm15"}));
    EXPECT_EQ(some.conditions, (Words{"clean", "noise"}));
    EXPECT_EQ(some.disparities, 208);
    for (const Words& wrong :
         {Words{"--matchers"}, Words{"t", "o", "--matchers"}, Words{"t", "o", "--sets", "a"},
          Words{"--suite", "d", "--conditions", "clean"}, Words{"--suite", "d", "--disparities", "64"},
          Words{"--suite", "d", "--matchers", "--set", "a=1"},
          Words{"--suite", "d", "--matchers", "--config", "f"},
          Words{"--suite", "d", "--matchers", "--conditions", ","}, Words{"--suite", "d", "--sets", ""},
          Words{"--suite", "d", "--matchers", "--disparities", "100"},
          Words{"--suite", "d", "--matchers", "--disparities", "0"},
          Words{"--suite", "d", "--matchers", "--disparities", "64x"},
          Words{"--suite", "d", "--matchers", "--disparities", "272"}}) {
        EXPECT_THROW(parse(wrong), CLI::ParseError) << testing::PrintToString(wrong);
    }
}

}  // namespace
}  // namespace groundline::cli
