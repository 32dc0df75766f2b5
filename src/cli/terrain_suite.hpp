// The rendered scenes that the terrain stage is judged on: every one a spec that a replay takes.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace groundline::cli {

// What is shown of the rendered pair.
enum class Picture : std::uint8_t {
    kRendered,   // the pair as it is
    kBlack,      // nothing but 0 in both views
    kWhite,      // nothing but 255
    kNoise,      // every pixel of both views by itself
    kLeftTwice,  // the left view on both sides
    kSwapped,    // left and right exchanged
    kFrozen,     // the same pair three times, from a live source; the third is judged
};

struct SuiteFrame {
    std::string scene;  // its name in the suite
    std::uint32_t seed = 0;
    std::string spec;  // for synth::scene_by_name and `groundline replay synthetic:SPEC`
    Picture picture = Picture::kRendered;
};

inline constexpr std::string_view kSuitePrefix = "synthetic:";

// What a suite asks of its frames.
enum class Study : std::uint8_t {
    kScenes,   // figures by pixel, pose
    kDitches,  // and what is made of a ditch that can be seen
    kFree,     // that there is nothing: scenes without any thing
    kNever,    // that it is not trusted
};

struct Suite {
    Study study = Study::kScenes;
    std::vector<SuiteFrame> frames;  // scene by scene, in each seed by seed
};

// `name`: "synthetic:" (all scenes), "synthetic:NAME,..." of them, or one of "synthetic:ditches",
// "synthetic:free", "synthetic:never". `seeds` of every scene, of synthetic:free of all its scenes together;
// 0: 20, for ditches 200, for free 1000. Pose, place and size are a function of scene and seed. Throws
// Refusal(kUsage) for a scene that is not known.
//
// Poses: roll -8 .. 8 deg, pitch 5 .. 20 deg, camera height 0.3 .. 1.2 m, at least four times the amplitude
// of waves; baseline 0.12 m, below a height of 0.5 m 0.06 m, so that the nearest ground is within the default
// search range. 640x480.
Suite terrain_suite(std::string_view name, int seeds);

// Whether a ditch can be told from rough ground: at least 6 rows of its far side lie deeper than the
// tolerance, and it is deep enough for them (algorithm.md 4.10).
bool detectable_ditch(double focal_px, double camera_height_m, double range_m, double width_m, double depth_m,
                      double tolerance_m);

}  // namespace groundline::cli
