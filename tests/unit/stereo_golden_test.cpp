// Results of all matchers on fixed pairs, as hashes: the same on every vector unit and every processor.
#include <gtest/gtest.h>

#include <cinttypes>
#include <cstdlib>
#include <string>

#include "support/vector_units.hpp"
#include "unit/stereo_test_tools.hpp"

namespace groundline::stereo {
namespace {

using test::OwnedPair;

// FNV-1a over the pixels of both planes, low byte of the disparity first; padding has no part in it.
std::uint64_t hash_of(const DisparityMap& map) {
    std::uint64_t hash = 0xCBF29CE484222325U;
    const auto add = [&](unsigned byte) { hash = (hash ^ (byte & 255U)) * 0x100000001B3U; };
    for (int y = 0; y < map.height(); ++y)
        for (int x = 0; x < map.width(); ++x) {
            const auto disparity_q4 = static_cast<unsigned>(map.disparity_q4.at(x, y));
            add(disparity_q4);
            add(disparity_q4 >> 8);
            add(static_cast<unsigned>(map.invalid.at(x, y)));
        }
    return hash;
}

enum class Scene { kStepped, kNoise, kFine };

struct Golden {
    const char* matcher;  // of kMatchers
    Scene scene;
    int width;
    int height;
    int min_disparity;
    int disparities;
    bool checks;
    std::uint64_t hash;
};

struct NamedMatcher {
    const char* name;
    MatcherKind kind;
    bool normalise;
};
constexpr NamedMatcher kMatchers[] = {{"paper", MatcherKind::kPaper, false},
                                      {"paper_local_mean", MatcherKind::kPaper, true},
                                      {"census", MatcherKind::kCensus, false},
                                      {"census_pyramid", MatcherKind::kCensusPyramid, false}};
constexpr const char* kSceneNames[] = {"kStepped", "kNoise", "kFine"};

// The output of GROUNDLINE_PRINT_GOLDEN=1 test_golden --gtest_filter='StereoGolden.*'
constexpr Golden kGolden[] = {
#include "unit/stereo_golden_hashes.inc"
};

// Integers alone: the same pixels everywhere.
OwnedPair pair_of(Scene scene, int width, int height, int min_disparity) {
    if (scene == Scene::kNoise)
        return {test::noise_image(width, height, 900), test::noise_image(width, height, 901)};
    if (scene == Scene::kStepped) return stepped_pair(width, height, 902, min_disparity);
    OwnedPair pair = test::warped_pair(width, height, 903, [=](int x, int y) {
        return min_disparity + (x % 40 < 6 && y > height / 4 ? 25 : 3 + 5 * y / height);
    });
    test::add_noise(pair.left, 904, 2);
    test::add_noise(pair.right, 905, 2);
    return pair;
}

std::uint64_t hash_now(const NamedMatcher& matcher, const Golden& golden) {
    MatcherConfig config;
    config.kind = matcher.kind;
    config.normalise_local_mean = matcher.normalise;
    config.min_disparity = golden.min_disparity;
    config.disparities = golden.disparities;
    config.checks = golden.checks;
    const OwnedPair pair = pair_of(golden.scene, golden.width, golden.height, golden.min_disparity);
    return hash_of(match_fast(config, pair.left.view(), pair.right.view()).map);
}

// One line of the table.
std::string line_of(const Golden& golden, std::uint64_t hash) {
    char line[160];
    std::snprintf(line, sizeof line, "{\"%s\", Scene::%s, %d, %d, %d, %d, %s, 0x%016" PRIX64 "},",
                  golden.matcher, kSceneNames[static_cast<int>(golden.scene)], golden.width, golden.height,
                  golden.min_disparity, golden.disparities, golden.checks ? "true" : "false", hash);
    return line;
}

TEST(StereoGolden, ResultsAreTheSameOnEveryVectorUnit) {
    on_every_vector_unit([] {
        for (const Golden& golden : kGolden)
            for (const NamedMatcher& matcher : kMatchers) {
                if (std::string(matcher.name) != golden.matcher) continue;
                const std::uint64_t hash = hash_now(matcher, golden);
                EXPECT_EQ(hash, golden.hash) << "now " << line_of(golden, hash);
            }
    });
}

// Prints the table anew where it is asked for.
TEST(StereoGolden, TableIsWhole) {
    struct Case {
        Scene scene;
        int width;
        int height;
        int min_disparity;
        int disparities;
    };
    std::size_t lines = 0;
    const bool print = std::getenv("GROUNDLINE_PRINT_GOLDEN") != nullptr;
    if (print) std::printf("// Hashes of stereo_golden_test.cpp, printed by it.\n");
    for (const NamedMatcher& matcher : kMatchers)
        for (const Case& of : {Case{Scene::kStepped, 160, 120, 0, 32}, Case{Scene::kNoise, 97, 61, -9, 16},
                               Case{Scene::kFine, 203, 137, 0, 64}, Case{Scene::kFine, 131, 290, -20, 48},
                               Case{Scene::kStepped, 301, 45, 7, 256}})
            for (const bool checks : {false, true}) {
                const Golden golden{matcher.name,     of.scene,       of.width, of.height,
                                    of.min_disparity, of.disparities, checks,   0};
                ++lines;
                if (print) std::printf("%s\n", line_of(golden, hash_now(matcher, golden)).c_str());
            }
    EXPECT_EQ(lines, std::size(kGolden));
}

}  // namespace
}  // namespace groundline::stereo
