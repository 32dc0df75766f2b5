// The key table: every key settable and printable, refusals that name line and nearest key, the sample file.
#include "settings/settings.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "capture/camera_source.hpp"
#include "core/edit_distance.hpp"
#include "core/error.hpp"
#include "settings/cpu_list.hpp"
#include "settings/key.hpp"

namespace groundline::settings {
namespace {

class SettingsFile : public testing::Test {
  protected:
    std::filesystem::path write(const std::string& text) {
        std::ofstream(path_) << text;
        return path_;
    }
    void TearDown() override { std::filesystem::remove(path_); }

    std::filesystem::path path_ = std::filesystem::path(testing::TempDir()) /
                                  (std::string("groundline_") +
                                   testing::UnitTest::GetInstance()->current_test_info()->name() + ".yaml");
};

// The refusal of `action`, which must come.
template <typename Action>
std::string refusal(Action action, ExitStatus expected) {
    try {
        action();
    } catch (const Refusal& refused) {
        EXPECT_EQ(refused.status(), expected) << refused.what();
        return refused.what();
    }
    ADD_FAILURE() << "nothing was refused";
    return {};
}

TEST(Keys, NamesAreUniqueAndEachDefaultIsAccepted) {
    std::set<std::string> names;
    for (const Key& key : keys()) {
        EXPECT_TRUE(names.insert(key.name).second) << key.name;
        EXPECT_FALSE(key.help.empty()) << key.name;
        Settings settings;
        const std::string value = key.print(settings);
        EXPECT_TRUE(key.parse(settings, value)) << key.name << "=" << value;
        EXPECT_EQ(key.print(settings), value) << key.name;
    }
}

TEST(Keys, ContractNamesAndDefaultsHold) {
    const Settings defaults;
    const auto value = [&](const char* name) {
        const Key* key = find_key(name);
        return key == nullptr ? std::string("missing") : key->print(defaults);
    };
    EXPECT_EQ(value("stereo.disparities"), "auto");
    EXPECT_EQ(value("stereo.min_disparity"), "0");
    EXPECT_EQ(value("stereo.normalise"), "off");
    EXPECT_EQ(value("stereo.checks"), "on");
    EXPECT_EQ(value("terrain.tolerance_m"), "0.2");
    EXPECT_EQ(value("terrain.tolerance_ratio"), "0.15");
    EXPECT_EQ(value("terrain.clearance_m"), "2");
    EXPECT_EQ(value("terrain.band"), "off");
    EXPECT_EQ(value("terrain.stopping_distance_m"), "2");
    for (const char* name : {"mount.height_m", "mount.pitch_deg", "mount.roll_deg"})
        EXPECT_EQ(value(name), "unset") << name;
}

TEST(Cameras, AreSetWordByWord) {
    Settings settings;
    const std::vector<std::pair<const char*, const char*>> words = {{"capture.driver", "v4l2"},
                                                                    {"capture.left", "by-path/a"},
                                                                    {"capture.right", "serial:B"},
                                                                    {"capture.width", "1280"},
                                                                    {"capture.height", "800"},
                                                                    {"capture.format", "y10p"},
                                                                    {"capture.rate_hz", "29.97"},
                                                                    {"capture.exposure_us", "5000"},
                                                                    {"capture.gain", "12"},
                                                                    {"capture.flip", "both"},
                                                                    {"capture.follow_exposure", "on"},
                                                                    {"capture.pair_tolerance_ms", "4"},
                                                                    {"capture.start_timeout_s", "7"},
                                                                    {"capture.stall_timeout_s", "0.5"}};
    for (const auto& [key, value] : words) {
        set_word(settings, std::string(key) + "=" + value);
        EXPECT_EQ(find_key(key)->print(settings), value) << key;
    }
    const capture::CameraSetup& camera = settings.capture.camera;
    EXPECT_EQ(camera.format, capture::PixelFormat::kY10P);
    EXPECT_EQ(camera.exposure_us, 5000.0);
    EXPECT_EQ(camera.flip, capture::Flip::kBoth);
    const capture::CameraSourceConfig config = camera_source_config(settings);
    EXPECT_EQ(config.name, "by-path/a and serial:B");
    EXPECT_EQ(config.width, 1280);
    EXPECT_EQ(config.height, 800);
    EXPECT_FALSE(config.side_by_side);
    EXPECT_TRUE(config.follow_exposure);
    EXPECT_EQ(config.pairing.tolerance_ns, 4'000'000);
    EXPECT_EQ(config.limits.start_ns, 7'000'000'000);
    EXPECT_EQ(config.limits.stall_ns, 500'000'000);
    set_word(settings, "capture.format=auto");
    set_word(settings, "capture.gain=auto");
    EXPECT_FALSE(settings.capture.camera.format.has_value());
    EXPECT_FALSE(settings.capture.camera.gain.has_value());
    EXPECT_NE(refusal([&] { set_word(settings, "capture.format=rgb"); }, ExitStatus::kConfig).find("nv12"),
              std::string::npos);
}

TEST(Cameras, MustBeNamedOneWayOrTheOther) {
    struct Case {
        const char* device;
        const char* left;
        const char* right;
        const char* words;  // of the refusal; empty: it is good
    };
    for (const Case& c : {Case{"", "a", "b", ""},
                          {"d", "", "", ""},
                          {"", "", "", "no cameras are named"},
                          {"", "a", "", "no cameras are named"},
                          {"", "a", "a", "name two cameras"},
                          {"d", "a", "", "not all of them"}}) {
        Settings settings;
        settings.capture.camera.device = c.device;
        settings.capture.camera.left = c.left;
        settings.capture.camera.right = c.right;
        if (*c.words == '\0') {
            EXPECT_EQ(camera_source_config(settings).side_by_side, *c.device != '\0');
        } else {
            EXPECT_NE(
                refusal([&] { (void)camera_source_config(settings); }, ExitStatus::kConfig).find(c.words),
                std::string::npos);
        }
    }
}

TEST(Cameras, AreJudgedByTheirPeriod) {
    Settings settings;
    settings.capture.camera.left = "a";
    settings.capture.camera.right = "b";
    set_word(settings, "capture.rate_hz=4");
    set_word(settings, "capture.pair_tolerance_ms=1000");
    set_word(settings, "capture.stall_timeout_s=0.75");
    EXPECT_EQ(camera_source_config(settings).pairing.tolerance_ns, 125'000'000) << "half a period at most";
    set_word(settings, "capture.stall_timeout_s=0.74");
    EXPECT_NE(
        refusal([&] { (void)camera_source_config(settings); }, ExitStatus::kConfig).find("0.75 or more"),
        std::string::npos);
}

TEST(Words, SetTheValueOrSayWhatWasExpected) {
    Settings settings;
    set_word(settings, "stereo.disparities=128");
    EXPECT_EQ(settings.matcher.disparities, 128);
    EXPECT_FALSE(settings.auto_disparities);
    set_word(settings, "terrain.tolerance_m=0.1");
    EXPECT_EQ(settings.terrain.tolerance_up_m, 0.1);
    EXPECT_EQ(settings.terrain.tolerance_down_m, 0.1);
    set_word(settings, "stereo.normalise=local_mean");
    EXPECT_TRUE(settings.matcher.normalise_local_mean);
    set_word(settings, "stereo.checks=off");
    EXPECT_FALSE(settings.matcher.checks);

    for (const char* word : {"stereo.disparities=100", "stereo.disparities=272", "stereo.disparities=",
                             "terrain.tolerance_m=nan", "terrain.tolerance_m=-1", "terrain.tolerance_m=1e99",
                             "terrain.tolerance_m=0.2m", "stereo.matcher=magic", "stereo.checks=perhaps"})
        refusal([&] { set_word(settings, word); }, ExitStatus::kConfig);
    const std::string unknown =
        refusal([&] { set_word(settings, "stereo.mathcer=paper"); }, ExitStatus::kConfig);
    EXPECT_NE(unknown.find("stereo.mathcer"), std::string::npos) << unknown;
    EXPECT_NE(unknown.find("'stereo.matcher'"), std::string::npos) << unknown;
    refusal([&] { set_word(settings, "stereo.matcher"); }, ExitStatus::kUsage);
}

TEST_F(SettingsFile, NestedAndDottedKeysMeanTheSame) {
    Settings nested;
    load_file(nested, write("stereo:\n  matcher: paper\n  normalise: local_mean\nterrain: {band: 50rows}\n"));
    Settings dotted;
    load_file(dotted, write("stereo.matcher: paper\nstereo.normalise: local_mean\nterrain.band: 50rows\n"));
    EXPECT_EQ(in_force(nested), in_force(dotted));
    EXPECT_NE(in_force(nested), in_force(Settings{}));
}

TEST_F(SettingsFile, UnknownKeyNamesLineAndNearest) {
    Settings settings;
    const auto file = write("stereo:\n  matcher: paper\n\n  normalize: local_mean\n");
    const std::string sentence = refusal([&] { load_file(settings, file); }, ExitStatus::kConfig);
    EXPECT_NE(sentence.find(file.string() + ":4"), std::string::npos) << sentence;
    EXPECT_NE(sentence.find("'stereo.normalise'"), std::string::npos) << sentence;
}

TEST_F(SettingsFile, WhatIsNotAConfigurationIsRefused) {
    Settings settings;
    refusal([&] { load_file(settings, "/nonexistent/groundline.yaml"); }, ExitStatus::kInput);
    refusal([&] { load_file(settings, testing::TempDir()); }, ExitStatus::kInput);
    for (const char* text : {"- a\n- b\n", "stereo: [1, 2]\n", "stereo:\n  matcher: {a: [\n", "just words\n",
                             "terrain:\n  tolerance_m: .nan\n", "terrain.tolerance_m:\n"})
        refusal([&] { load_file(settings, write(text)); }, ExitStatus::kConfig);
}

TEST_F(SettingsFile, AnEmptyFileChangesNothing) {
    for (const char* text : {"# nothing yet\n", "\n", ""}) {
        Settings settings;
        load_file(settings, write(text));
        EXPECT_EQ(in_force(settings), in_force(Settings{})) << '"' << text << '"';
    }
}

TEST_F(SettingsFile, TheSampleUncommentedIsTheDefault) {
    std::istringstream sample(sample_file());
    std::string text;
    for (std::string line; std::getline(sample, line);)
        if (line.starts_with("#") && !line.starts_with("# ")) text += line.substr(1) + "\n";
    Settings settings;
    load_file(settings, write(text));
    EXPECT_EQ(in_force(settings), in_force(Settings{}));
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), static_cast<std::ptrdiff_t>(keys().size()));
}

TEST(Sample, TheShippedFileIsTheTable) {
    std::ifstream shipped(GROUNDLINE_SOURCE_DIR "/config/groundline.yaml");
    std::stringstream text;
    text << shipped.rdbuf();
    EXPECT_EQ(text.str(), sample_file()) << "write it anew with: groundline config > config/groundline.yaml";
}

TEST(CpuList, IsReadOrRefused) {
    EXPECT_EQ(parse_cpu_list(""), std::vector<int>{});
    EXPECT_EQ(parse_cpu_list("3"), std::vector<int>{3});
    EXPECT_EQ(parse_cpu_list("0,2-4,1023"), (std::vector<int>{0, 2, 3, 4, 1023}));
    for (const char* bad : {",", "1,", ",1", "1,,2", "a", "-1", "3-2", "1-", "1024", "0x1", " 1", "1-2-3"})
        EXPECT_FALSE(parse_cpu_list(bad).has_value()) << bad;
    Settings settings;
    refusal([&] { set_word(settings, "realtime.capture_cpus=1-"); }, ExitStatus::kConfig);
}

TEST(Reload, TakesWhatMayChangeAndNamesWhatMayNot) {
    Settings running;
    set_word(running, "terrain.clearance_m=1.5");
    Settings wanted;
    for (const char* word : {"terrain.tolerance_m=0.1", "publish.preview=on", "stereo.matcher=census",
                             "publish.prefix=OTHER", "terrain.clearance_m=1.5"})
        set_word(wanted, word);
    const Reload result = reload(running, wanted);
    EXPECT_EQ(result.taken, (std::vector<std::string>{"terrain.tolerance_m", "publish.preview"}));
    EXPECT_EQ(result.need_restart, (std::vector<std::string>{"stereo.matcher", "publish.prefix"}));
    EXPECT_EQ(result.settings.terrain.tolerance_up_m, 0.1);
    EXPECT_EQ(result.settings.terrain.tolerance_down_m, 0.1);
    EXPECT_EQ(result.settings.terrain.clearance_m, 1.5);
    EXPECT_TRUE(result.settings.publish.preview);
    EXPECT_EQ(result.settings.publish.prefix, "GROUNDLINE");
    EXPECT_EQ(result.settings.matcher.kind, stereo::MatcherKind::kCensusPyramid);
}

// A reload goes through the printed form of each value, so that form must hold all of it.
TEST(Reload, NothingChangedIsNothingToDo) {
    Settings running;
    set_word(running, "terrain.tolerance_m=0.123456789012345");
    const Reload result = reload(running, running);
    EXPECT_TRUE(result.taken.empty());
    EXPECT_TRUE(result.need_restart.empty());
    const Reload taken = reload(Settings{}, running);
    EXPECT_EQ(taken.settings.terrain.tolerance_up_m, 0.123456789012345);
}

TEST(Mount, HalfAMountIsRefusedAndAWholeOneNarrowsTheGate) {
    Settings settings;
    EXPECT_FALSE(terrain_config(settings).mount_known);
    set_word(settings, "mount.height_m=1");
    refusal([&] { terrain_config(settings); }, ExitStatus::kConfig);
    set_word(settings, "mount.pitch_deg=10");
    const terrain::TerrainConfig config = terrain_config(settings);
    EXPECT_TRUE(config.mount_known);
    EXPECT_EQ(config.gate.pitch_min_deg, 2.0);
    EXPECT_EQ(config.gate.pitch_max_deg, 18.0);
    EXPECT_EQ(config.gate.height_max_m, 1.3);
}

TEST(Terrain, WholeDisparitiesAreTrustedHalfAsMuch) {
    Settings settings;
    const double subpixel_px = terrain_config(settings).sigma_disparity_px;
    const auto sigma_px = [](const char* matcher, const char* word) {
        Settings settings_then;
        set_word(settings_then, matcher);
        set_word(settings_then, word);
        return terrain_config(settings_then).sigma_disparity_px;
    };
    for (const char* matcher :
         {"stereo.matcher=paper", "stereo.matcher=census", "stereo.matcher=census_pyramid"})
        EXPECT_EQ(sigma_px(matcher, "stereo.subpixel=off"), 2.0 * subpixel_px) << matcher;
    // Without checks the paper's matcher alone stays with whole disparities.
    EXPECT_EQ(sigma_px("stereo.matcher=paper", "stereo.checks=off"), 2.0 * subpixel_px);
    EXPECT_EQ(sigma_px("stereo.matcher=census", "stereo.checks=off"), subpixel_px);
}

TEST(Verdict, BrightnessIsJudgedAsTheMatcherSeesIt) {
    const auto photometric = [](std::initializer_list<const char*> words) {
        Settings settings;
        for (const char* word : words)
            set_word(settings, word);
        return verdict_limits(settings).photometric;
    };
    EXPECT_EQ(photometric({}), verdict::kLocalOrder);
    EXPECT_EQ(photometric({"stereo.matcher=census"}), verdict::kLocalOrder);
    EXPECT_EQ(photometric({"stereo.matcher=paper"}), verdict::kRawDifferences);
    EXPECT_EQ(photometric({"stereo.matcher=paper", "stereo.normalise=local_mean"}), verdict::kLocalOrder);
}

TEST(Keys, WhatIsLeftToTheMatcherSaysSo) {
    Settings settings;
    for (const char* name : {"stereo.saturated_percent", "stereo.uniqueness_percent"}) {
        const Key* key = find_key(name);
        EXPECT_EQ(key->print(settings), "auto");
        EXPECT_TRUE(key->parse(settings, "12"));
        EXPECT_EQ(key->print(settings), "12");
        EXPECT_FALSE(key->parse(settings, "-2"));
        EXPECT_TRUE(key->parse(settings, "auto"));
        EXPECT_EQ(key->print(settings), "auto");
    }
}

TEST(EditDistance, CountsInsertionsDeletionsAndSubstitutions) {
    EXPECT_EQ(edit_distance("", ""), 0U);
    EXPECT_EQ(edit_distance("abc", ""), 3U);
    EXPECT_EQ(edit_distance("kitten", "sitting"), 3U);
    EXPECT_EQ(edit_distance("normalize", "normalise"), 1U);
}

}  // namespace
}  // namespace groundline::settings
