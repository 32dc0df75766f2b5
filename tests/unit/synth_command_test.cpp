// `groundline synth`: the folder it writes, read back, and the folders it leaves alone.
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "cli/synth_command.hpp"
#include "core/deterministic_math.hpp"
#include "core/error.hpp"
#include "core/ground.hpp"
#include "io/png.hpp"
#include "unit/synth_support.hpp"

namespace groundline::cli {
namespace {

namespace fs = std::filesystem;

class SynthCommand : public testing::Test {
  protected:
    void SetUp() override {
        std::string pattern = (fs::temp_directory_path() / "groundline_synth_XXXXXX").string();
        ASSERT_NE(mkdtemp(pattern.data()), nullptr);
        folder_ = pattern;
    }
    void TearDown() override { fs::remove_all(folder_); }

    ExitStatus refusal_of(const SynthOptions& options) {
        try {
            run_synth(options);
        } catch (const Refusal& refusal) {
            sentence_ = refusal.what();
            return refusal.status();
        }
        return ExitStatus::kDone;
    }

    fs::path folder_;
    std::string sentence_;
};

std::string text_of(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

TEST_F(SynthCommand, WritesWhatTheRendererSays) {
    const std::string spec = "drive?width=96&height=72&ditch_m=2";
    SynthOptions options{spec, 2, folder_ / "new" / "set", 0.15};
    ASSERT_EQ(run_synth(options), 0);
    synth::test::Studio expected(spec);
    for (int frame = 0; frame < 2; ++frame) {
        expected.shoot(frame, 0.15);
        const std::string name = frame == 0 ? "000000.png" : "000001.png";
        const io::Image8 left = io::read_image(options.out / "left" / name);
        const io::Image8 right = io::read_image(options.out / "right" / name);
        const io::Image8 classes = io::read_image(options.out / "class" / name);
        const io::Image8 occluded = io::read_image(options.out / "occluded" / name);
        const io::Image16 disparity = io::read_png16(options.out / "disp" / name);
        const io::Image16 height = io::read_png16(options.out / "height" / name);
        ASSERT_EQ(left.channels, 3);
        ASSERT_EQ(right.channels, 1);
        ASSERT_EQ(left.width, 96);
        ASSERT_EQ(left.height, 72);
        int sky = 0, hidden = 0, drop = 0;
        for (int v = 0; v < 72; ++v)
            for (int u = 0; u < 96; ++u) {
                const auto at = static_cast<std::size_t>(96 * v + u);
                for (std::size_t i = 0; i < 3; ++i)
                    ASSERT_EQ(left.bytes[3 * at + i],
                              expected.left_bgr.row(v)[3 * static_cast<std::size_t>(u) + i]);
                ASSERT_EQ(right.bytes[at], expected.right.at(u, v));
                ASSERT_EQ(classes.bytes[at], static_cast<int>(expected.truth.terrain.at(u, v)));
                ASSERT_EQ(occluded.bytes[at], 255 * expected.truth.occluded.at(u, v));
                if (expected.truth.seen.at(u, v) == 0) {
                    ASSERT_EQ(disparity.pixels[at], 0);
                    ASSERT_EQ(height.pixels[at], 0);
                    ++sky;
                } else {
                    ASSERT_NEAR(disparity.pixels[at] / 256.0, expected.truth.disparity_px.at(u, v),
                                0.5 / 256 + 1e-9);
                    ASSERT_NEAR((height.pixels[at] - 32768) / 1000.0, expected.truth.height_m.at(u, v),
                                0.0005 + 1e-9);
                }
                hidden += occluded.bytes[at] != 0 ? 1 : 0;
                drop += classes.bytes[at] == 3 ? 1 : 0;
            }
        EXPECT_GT(sky, 100);
        EXPECT_GT(hidden, 10);
        EXPECT_GT(drop, 10);
    }
    const nlohmann::json truth = nlohmann::json::parse(text_of(options.out / "truth.json"));
    ASSERT_EQ(truth.at("frames").size(), 2U);
    const synth::CameraPose camera = synth::camera_at(synth::scene_by_name(spec), 1);
    const nlohmann::json& second = truth.at("frames")[1];
    EXPECT_EQ(second.at("pitch_deg").get<double>(), det::degrees(camera.pose.pitch_rad));
    EXPECT_EQ(second.at("roll_deg").get<double>(), det::degrees(camera.pose.roll_rad));
    EXPECT_EQ(second.at("height_m").get<double>(), camera.pose.height_m);
    const DisparityPlane plane = plane_of(camera.pose, expected.rig());
    EXPECT_EQ(second.at("plane")[0].get<double>(), plane.du);
    EXPECT_EQ(second.at("plane")[1].get<double>(), plane.dv);
    EXPECT_EQ(second.at("plane")[2].get<double>(), plane.d0);
    for (const auto& entry : fs::recursive_directory_iterator(options.out))
        EXPECT_NE(entry.path().filename().string().front(), '.') << "temporary file left: " << entry.path();
}

TEST_F(SynthCommand, CalibrationHasAllDigits) {
    ASSERT_EQ(
        run_synth(
            {"plane?width=32&height=24&focal=123.456789012345&baseline=0.1234567890123", {}, folder_, 0.2}),
        0);
    std::ifstream file(folder_ / "calib.txt");
    std::string name;
    double left[12], right[12];
    file >> name;
    EXPECT_EQ(name, "P0:");
    for (double& number : left)
        file >> number;
    file >> name;
    EXPECT_EQ(name, "P1:");
    for (double& number : right)
        file >> number;
    ASSERT_TRUE(file.good());
    EXPECT_EQ(left[0], 123.456789012345);
    EXPECT_EQ(left[5], left[0]);
    EXPECT_EQ(left[2], 15.5);
    EXPECT_EQ(left[6], 11.5);
    EXPECT_EQ(right[2], 15.5);
    EXPECT_NEAR((left[3] - right[3]) / left[0], 0.1234567890123, 1e-15);
}

TEST_F(SynthCommand, AnInterruptLeavesWholeFramesAndSaysSo) {
    const fs::path out = folder_ / "out";
    EXPECT_EXIT(
        {
            std::jthread hand([&] {
                while (!fs::exists(out / "left" / "000002.png"))
                    std::this_thread::sleep_for(std::chrono::milliseconds(1));
                raise(SIGINT);
            });
            const int status = run_synth({"boxes?width=32&height=24&frames=1000000", {}, out, 0.2});
            hand.join();
            std::exit(status);
        },
        testing::ExitedWithCode(130), "");
    const nlohmann::json truth = nlohmann::json::parse(text_of(out / "truth.json"));
    const std::size_t frames = truth.at("frames").size();
    EXPECT_GE(frames, 3U);
    for (const char* name : {"left", "right", "disp", "occluded", "class", "height"}) {
        std::size_t files = 0;
        for ([[maybe_unused]] const auto& entry : fs::directory_iterator(out / name))
            ++files;
        EXPECT_EQ(files, frames) << name;
    }
}

TEST_F(SynthCommand, UsesTheScenesOwnNumberOfFrames) {
    ASSERT_EQ(run_synth({"boxes?width=32&height=24&frames=3&noise=1", {}, folder_, 0.2}), 0);
    int files = 0;
    for (const auto& entry : fs::directory_iterator(folder_ / "left"))
        files += entry.is_regular_file() ? 1 : 0;
    EXPECT_EQ(files, 3);
}

TEST_F(SynthCommand, LeavesAFolderWithSomethingInItAlone) {
    std::ofstream(folder_ / "mine.txt") << "keep";
    EXPECT_EQ(refusal_of({"plane?width=32&height=24", 1, folder_, 0.2}), ExitStatus::kInput);
    EXPECT_NE(sentence_.find(folder_.string()), std::string::npos) << sentence_;
    EXPECT_NE(sentence_.find("holds something already"), std::string::npos) << sentence_;
    EXPECT_EQ(text_of(folder_ / "mine.txt"), "keep");
    EXPECT_FALSE(fs::exists(folder_ / "left"));
    EXPECT_EQ(refusal_of({"plane?width=32&height=24", 1, folder_ / "mine.txt", 0.2}), ExitStatus::kInput);
    EXPECT_NE(sentence_.find("is a file"), std::string::npos) << sentence_;
}

TEST_F(SynthCommand, RefusesMisuseBeforeItWritesAnything) {
    const fs::path out = folder_ / "out";
    EXPECT_EQ(refusal_of({"plain", 1, out, 0.2}), ExitStatus::kUsage);
    EXPECT_EQ(refusal_of({"plane?heigth=24", 1, out, 0.2}), ExitStatus::kUsage);
    EXPECT_EQ(refusal_of({"plane", 0, out, 0.2}), ExitStatus::kUsage);
    EXPECT_EQ(refusal_of({"plane", 1, out, 0.0}), ExitStatus::kUsage);
    EXPECT_FALSE(fs::exists(out));
}

}  // namespace
}  // namespace groundline::cli
