#include "cli/terrain_suite.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/deterministic_math.hpp"
#include "core/error.hpp"
#include "synth/texture.hpp"
#include "terrain/config.hpp"

namespace groundline::cli {
namespace {

constexpr double kFocal = 500.0;  // px, of every scene of the renderer at a width of 640

// Numbers of one scene and seed, each by its place.
class Draw {
  public:
    Draw(std::string_view scene, std::uint32_t seed) {
        std::uint64_t name = 0xCBF29CE484222325U;  // FNV-1a
        for (const char letter : scene)
            name = (name ^ static_cast<unsigned char>(letter)) * 0x100000001B3U;
        key_ = synth::mix(name, seed);
    }
    double between(double low, double high, std::uint64_t place) const {
        return low + (high - low) * synth::unit(synth::mix(key_, place));
    }

  private:
    std::uint64_t key_;
};

struct Pose {
    double roll_deg;
    double pitch_deg;
    double height_m;
    double baseline_m() const { return height_m < 0.5 ? 0.06 : 0.12; }
    // Along the ground, of what is surely in view in the lower half of the picture, whatever the roll.
    double near_m(double angle_deg) const { return height_m / det::tan(det::radians(pitch_deg + angle_deg)); }
};

struct Limits {
    double pitch_least_deg = 5.0;
    double pitch_most_deg = 20.0;
    double height_least_m = 0.3;
    double height_most_m = 1.2;
    double roll_least_deg = -8.0;
    double roll_most_deg = 8.0;
};

using Extra = std::string (*)(const Pose&, const Draw&);
std::string nothing(const Pose&, const Draw&) {
    return {};
}

struct SceneKind {
    const char* name;
    const char* base;  // NAME?key=value& of the renderer
    Limits limits = {};
    Extra extra = nothing;  // more keys, drawn, each with & behind it
    Picture picture = Picture::kRendered;
};

std::string wall_ahead(const Pose&, const Draw& draw) {
    return fmt::format("wall_m={:.3f}&", draw.between(6.0, 8.0, 10));
}

// A wall that ends below the lower edge of the picture, also at its corners: no ground to be seen.
std::string wall_before_the_ground(const Pose& pose, const Draw&) {
    return fmt::format("wall_m={:.3f}&", 0.8 * pose.near_m(30.0));
}

std::string ditch_in_view(const Pose& pose, const Draw& draw) {
    const double tolerance_m = terrain::TerrainConfig{}.tolerance_down_m;
    const double near_m = pose.near_m(20.0);
    for (std::uint64_t attempt = 0;; ++attempt) {
        const double range_m = near_m + draw.between(0.2, 3.0, 100 + 3 * attempt);
        const double width_m = draw.between(0.3, 1.5, 101 + 3 * attempt);
        const double depth_m = draw.between(0.3, 1.2, 102 + 3 * attempt);
        if (detectable_ditch(kFocal, pose.height_m, range_m, width_m, depth_m, tolerance_m))
            return fmt::format("ditch_m={:.3f}&ditch_width_m={:.3f}&ditch_depth_m={:.3f}&", range_m, width_m,
                               depth_m);
    }
}

const std::array kScenes = {
    SceneKind{"plane", "plane?"},
    SceneKind{"boxes", "boxes?"},
    SceneKind{"tall_boxes", "boxes?boxes=5&box_height_m=1.2&"},
    SceneKind{"varied_boxes", "clutter?boxes=6&poles=0&rocks=0&wall_m=0&"},
    SceneKind{"poles", "poles?"},
    SceneKind{"rocks", "plane?rocks=8&"},
    SceneKind{"clutter", "clutter?"},
    SceneKind{"wall", "wall?", {}, wall_ahead},
    SceneKind{"low_texture", "low_texture?"},
    SceneKind{"mismatch", "mismatch?"},
    SceneKind{"gain", "boxes?gain=1.1&offset=5&noise=2&"},
    SceneKind{"noise", "boxes?noise=4&"},
    SceneKind{"waves_10_boxes", "undulating?undulation_m=0.10&boxes=3&", {5, 20, 0.4, 1.2}},
    SceneKind{"waves_5_rocks", "undulating?undulation_m=0.05&rocks=8&"},
    SceneKind{"drive", "drive?frames=1&"},
    SceneKind{"rolled_boxes", "boxes?", {5, 20, 0.3, 1.2, 8, 8}},
    SceneKind{"low_camera", "boxes?", {5, 20, 0.3, 0.4}},
};

const std::array kDitches = {SceneKind{"ditch", "plane?", {}, ditch_in_view}};

const std::array kFree = {
    SceneKind{"free_plane", "plane?"},
    SceneKind{"free_waves_10", "undulating?undulation_m=0.10&", {5, 20, 0.4, 1.2}},
    SceneKind{"free_waves_5", "undulating?undulation_m=0.05&"},
    SceneKind{"free_noise", "plane?noise=4&"},
    SceneKind{"free_low_texture", "plane?contrast=0.25&noise=2&"},
};

const std::array kNever = {
    SceneKind{"wall_only", "wall?wall_height_m=100&", {0, 10, 0.6, 1.2}, wall_before_the_ground},
    SceneKind{"sky_only", "plane?noise=1&", {-60, -50, 0.3, 1.2}},
    SceneKind{"black", "plane?", {}, nothing, Picture::kBlack},
    SceneKind{"white", "plane?", {}, nothing, Picture::kWhite},
    SceneKind{"random", "plane?", {}, nothing, Picture::kNoise},
    SceneKind{"left_twice", "boxes?", {}, nothing, Picture::kLeftTwice},
    SceneKind{"swapped", "boxes?", {}, nothing, Picture::kSwapped},
    SceneKind{"frozen", "boxes?", {}, nothing, Picture::kFrozen},
};

SuiteFrame frame_of(const SceneKind& kind, std::uint32_t seed) {
    const Draw draw(kind.name, seed);
    const Limits& limits = kind.limits;
    const Pose pose{draw.between(limits.roll_least_deg, limits.roll_most_deg, 0),
                    draw.between(limits.pitch_least_deg, limits.pitch_most_deg, 1),
                    draw.between(limits.height_least_m, limits.height_most_m, 2)};
    return {kind.name, seed,
            fmt::format("{}{}seed={}&roll_deg={:.3f}&pitch_deg={:.3f}&camera_height_m={:.4f}&baseline={}",
                        kind.base, kind.extra(pose, draw), seed, pose.roll_deg, pose.pitch_deg, pose.height_m,
                        pose.baseline_m()),
            kind.picture};
}

template <typename Kinds>
void add_frames(const Kinds& kinds, int seeds, std::vector<SuiteFrame>& frames) {
    for (const SceneKind& kind : kinds)
        for (int seed = 1; seed <= seeds; ++seed)
            frames.push_back(frame_of(kind, static_cast<std::uint32_t>(seed)));
}

// Seeds 1 .. `seeds`, each in one of the scenes.
void add_shared_frames(int seeds, std::vector<SuiteFrame>& frames) {
    for (std::size_t kind = 0; kind < kFree.size(); ++kind)
        for (std::size_t seed = kind + 1; seed <= static_cast<std::size_t>(seeds); seed += kFree.size())
            frames.push_back(frame_of(kFree[kind], static_cast<std::uint32_t>(seed)));
}

void add_named(std::string_view names, int seeds, std::vector<SuiteFrame>& frames) {
    while (!names.empty()) {
        const std::string_view name = names.substr(0, names.find(','));
        names.remove_prefix(std::min(names.size(), name.size() + 1));
        const auto* kind = std::find_if(kScenes.begin(), kScenes.end(),
                                        [&](const SceneKind& each) { return each.name == name; });
        if (kind == kScenes.end()) {
            std::string known;
            for (const SceneKind& each : kScenes)
                known += fmt::format("{}, ", each.name);
            throw Refusal(ExitStatus::kUsage, fmt::format("--suite synthetic: no scene is called '{}'; there "
                                                          "are {}and by themselves ditches, free, never",
                                                          name, known));
        }
        add_frames(std::array{*kind}, seeds, frames);
    }
}

}  // namespace

bool detectable_ditch(double focal_px, double camera_height_m, double range_m, double width_m, double depth_m,
                      double tolerance_m) {
    constexpr double kRows = 6.0;
    const double rows =
        focal_px * (camera_height_m / range_m - (camera_height_m + tolerance_m) / (range_m + width_m));
    return rows >= kRows && depth_m >= camera_height_m * width_m / range_m;
}

Suite terrain_suite(std::string_view name, int seeds) {
    if (name.starts_with(kSuitePrefix)) name.remove_prefix(kSuitePrefix.size());
    const auto or_default = [&](int usual) { return seeds > 0 ? seeds : usual; };
    Suite suite;
    if (name == "ditches") {
        suite.study = Study::kDitches;
        add_frames(kDitches, or_default(200), suite.frames);
    } else if (name == "free") {
        suite.study = Study::kFree;
        add_shared_frames(or_default(1000), suite.frames);
    } else if (name == "never") {
        suite.study = Study::kNever;
        add_frames(kNever, or_default(20), suite.frames);
    } else if (name.empty()) {
        add_frames(kScenes, or_default(20), suite.frames);
    } else {
        add_named(name, or_default(20), suite.frames);
    }
    return suite;
}

}  // namespace groundline::cli
