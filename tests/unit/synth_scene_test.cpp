// Scene descriptions: names, keys, refusals, and the way the camera moves.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "core/deterministic_math.hpp"
#include "core/error.hpp"
#include "synth/scatter.hpp"
#include "synth/scene.hpp"

namespace groundline::synth {
namespace {

// The sentence with which a spec is refused; empty if it is not.
std::string refusal_of(std::string_view spec) {
    try {
        scene_by_name(spec);
    } catch (const Refusal& refusal) {
        EXPECT_EQ(refusal.status(), ExitStatus::kUsage);
        return refusal.what();
    }
    return {};
}

bool contains(const std::string& text, std::string_view part) {
    return text.find(part) != std::string::npos;
}

TEST(SynthScene, HasTheDocumentedDefaults) {
    const Scene scene = scene_by_name("plane");
    EXPECT_EQ(scene.rig.width, 640);
    EXPECT_EQ(scene.rig.height, 480);
    EXPECT_TRUE(scene.rig.calibrated);
    EXPECT_DOUBLE_EQ(scene.rig.focal_px, 500.0);
    EXPECT_DOUBLE_EQ(scene.rig.baseline_m, 0.12);
    EXPECT_DOUBLE_EQ(scene.mount.height_m, 1.0);
    EXPECT_DOUBLE_EQ(scene.mount.pitch_rad, det::radians(12.0));
    EXPECT_DOUBLE_EQ(scene.mount.roll_rad, 0.0);
    EXPECT_EQ(scene.frames, 1);
    EXPECT_EQ(scene_by_name("drive").frames, 30);
    EXPECT_EQ(scene_by_name("boxes").things.size(), 3U);
    EXPECT_DOUBLE_EQ(scene_by_name("mismatch").photometric.right_gain, 1.06);
    EXPECT_DOUBLE_EQ(scene_by_name("mismatch").photometric.right_offset, 4.0);
}

TEST(SynthScene, AllNamesOfTheHelpTextOpen) {
    const std::string help = scene_help();
    const std::size_t end = help.find("Keys:\n");
    int names = 0;
    for (std::size_t at = help.find('\n') + 1; at < end; at = help.find('\n', at) + 1) {
        const std::size_t first = help.find_first_not_of(' ', at);
        const std::string name = help.substr(first, help.find(' ', first) - first);
        EXPECT_EQ(scene_by_name(name).name, name);
        EXPECT_EQ(scene_by_name("synthetic:" + name).name, name);
        ++names;
    }
    EXPECT_GE(names, 13);
    for (const char* known : {"plane", "boxes", "poles", "ditch", "wall", "undulating", "drive", "clutter",
                              "low_texture", "dark", "sky", "mismatch", "step"})
        EXPECT_EQ(scene_by_name(known).name, known);
}

TEST(SynthScene, KeysReachTheScene) {
    const Scene scene = scene_by_name(
        "synthetic:boxes?seed=7&frames=4&width=320&height=200&focal=260.5&baseline=0.2&pitch_deg=-3&roll_deg="
        "5.5&camera_height_m=0.5&gain=1.1&offset=-3&noise=2.5&contrast=0.5&undulation_m=0.05&boxes=5&rate_hz="
        "20&speed_mps=1.5");
    EXPECT_EQ(scene.seed, 7U);
    EXPECT_EQ(scene.frames, 4);
    EXPECT_EQ(scene.rig.width, 320);
    EXPECT_EQ(scene.rig.height, 200);
    EXPECT_DOUBLE_EQ(scene.rig.focal_px, 260.5);
    EXPECT_DOUBLE_EQ(scene.rig.cx_px, 159.5);
    EXPECT_DOUBLE_EQ(scene.rig.cy_px, 99.5);
    EXPECT_DOUBLE_EQ(scene.rig.baseline_m, 0.2);
    EXPECT_DOUBLE_EQ(scene.mount.pitch_rad, det::radians(-3.0));
    EXPECT_DOUBLE_EQ(scene.mount.roll_rad, det::radians(5.5));
    EXPECT_DOUBLE_EQ(scene.mount.height_m, 0.5);
    EXPECT_DOUBLE_EQ(scene.photometric.right_gain, 1.1);
    EXPECT_DOUBLE_EQ(scene.photometric.right_offset, -3.0);
    EXPECT_DOUBLE_EQ(scene.photometric.noise_sigma, 2.5);
    EXPECT_DOUBLE_EQ(scene.contrast, 0.5);
    ASSERT_EQ(scene.waves.size(), 1U);
    EXPECT_DOUBLE_EQ(scene.waves[0].amplitude_m, 0.05);
    EXPECT_EQ(scene.things.size(), 5U);
    EXPECT_DOUBLE_EQ(scene.rate_hz, 20.0);
    EXPECT_DOUBLE_EQ(scene.speed_mps, 1.5);
}

TEST(SynthScene, RefusesAnUnknownNameWithTheNearest) {
    const std::string sentence = refusal_of("boxs");
    EXPECT_TRUE(contains(sentence, "'boxs'")) << sentence;
    EXPECT_TRUE(contains(sentence, "did you mean 'boxes'")) << sentence;
    EXPECT_TRUE(contains(sentence, "undulating")) << "all names are listed: " << sentence;
    EXPECT_TRUE(contains(refusal_of(""), "unknown scene ''"));
}

TEST(SynthScene, RefusesAnUnknownKeyWithTheNearest) {
    const std::string sentence = refusal_of("plane?pich_deg=3");
    EXPECT_TRUE(contains(sentence, "'pich_deg'")) << sentence;
    EXPECT_TRUE(contains(sentence, "did you mean 'pitch_deg'")) << sentence;
    EXPECT_TRUE(contains(sentence, "baseline")) << "all keys are listed: " << sentence;
}

TEST(SynthScene, RefusesWhatIsNoUsableNumber) {
    for (const char* spec :
         {"plane?seed=", "plane?seed=one", "plane?seed=1x", "plane?seed=-1", "plane?seed=1.5",
          "plane?noise=nan", "plane?gain=inf", "plane?width=8", "plane?height=100000",
          "plane?camera_height_m=0", "plane?frames=0", "plane?baseline=-0.1", "plane?pitch_deg=91"})
        EXPECT_TRUE(contains(refusal_of(spec), "number from")) << spec << ": " << refusal_of(spec);
    EXPECT_TRUE(contains(refusal_of("plane?seed"), "key=value"));
    EXPECT_TRUE(contains(refusal_of("plane?seed=1&&frames=2"), "key=value"));
    EXPECT_TRUE(contains(refusal_of("plane?seed=1&seed=2"), "given twice"));
    EXPECT_TRUE(contains(refusal_of("plane?undulation_m=0.5"), "quarter of camera_height_m"));
    EXPECT_TRUE(contains(refusal_of("ditch?step_m=2"), "beyond the far side"));
}

TEST(SynthScene, ThingsStandApart) {
    for (int seed = 1; seed <= 50; ++seed) {
        const Scene scene = scene_by_name("clutter?seed=" + std::to_string(seed));
        for (std::size_t i = 0; i < scene.things.size(); ++i)
            for (std::size_t j = 0; j < i; ++j) {
                const double dx = scene.things[i].x_m - scene.things[j].x_m;
                const double dz = scene.things[i].z_m - scene.things[j].z_m;
                EXPECT_GT(std::sqrt(dx * dx + dz * dz), reach_m(scene.things[i]) + reach_m(scene.things[j]));
            }
    }
}

TEST(SynthScene, DriveMovesAndKeepsItsPathClear) {
    const Scene scene = scene_by_name("drive?frames=200");
    EXPECT_DOUBLE_EQ(camera_at(scene, 0).forward_m, 0.0);
    EXPECT_DOUBLE_EQ(camera_at(scene, 199).forward_m, 0.5 * 199 / 10.0);
    double largest_pitch = 0.0;
    for (int frame = 0; frame < 200; ++frame) {
        const GroundPose pose = camera_at(scene, frame).pose;
        largest_pitch = std::max(largest_pitch, std::abs(pose.pitch_rad - scene.mount.pitch_rad));
        EXPECT_LE(std::abs(pose.roll_rad), det::radians(1.2) + 1e-12);
        EXPECT_LE(std::abs(pose.height_m - 1.0), 0.01 + 1e-12);
    }
    EXPECT_GT(largest_pitch, det::radians(0.7));
    EXPECT_LE(largest_pitch, det::radians(0.8) + 1e-12);
    int things = 0;
    for (std::int64_t cell = 0; cell < 5; ++cell)
        for (const Thing& thing : strewn_in_cell(scene.seed, cell, 100.0)) {
            ++things;
            EXPECT_GE(std::abs(thing.x_m), 0.8 + reach_m(thing) - 1e-12);
        }
    EXPECT_GT(things, 10);
}

}  // namespace
}  // namespace groundline::synth
