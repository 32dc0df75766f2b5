#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <vector>

#include "core/deterministic_math.hpp"
#include "core/edit_distance.hpp"
#include "core/error.hpp"
#include "synth/scatter.hpp"
#include "synth/scene.hpp"
#include "synth/texture.hpp"

namespace groundline::synth {
namespace {

// What the keys set; each scene starts from these and changes some.
struct Wish {
    double seed = 1;
    double frames = 1;
    double rate_hz = 10;
    double width = 640;
    double height = 480;
    double focal = 0;  // 0: not given
    double baseline = 0.12;
    double pitch_deg = 12;
    double roll_deg = 0;
    double camera_height_m = 1;
    double speed_mps = 0;
    double sway = 0;
    double gain = 1;
    double offset = 0;
    double noise = 0;
    double contrast = 1;
    double exposure = 1;
    double sky_exposure = 1;
    double undulation_m = 0;
    double undulation_length_m = 4;
    double boxes = 0;
    double box_height_m = 0.4;
    double poles = 0;
    double rocks = 0;
    double wall_m = 0;
    double wall_height_m = 2.5;
    double ditch_m = 0;
    double ditch_width_m = 0.6;
    double ditch_depth_m = 0.6;
    double step_m = 0;
    double step_depth_m = 0.3;
    bool varied_boxes = false;
    bool strewn = false;
};

struct Key {
    std::string_view name;
    double Wish::*value;
    double least;
    double most;
    bool whole;
    std::string_view help;
};
constexpr Key kKeys[] = {
    {"seed", &Wish::seed, 0, 4294967295.0, true, "of the texture, the places of things and the noise"},
    {"frames", &Wish::frames, 1, 1e9, true, "number of frames"},
    {"rate_hz", &Wish::rate_hz, 0.1, 1000, false, "frames per second"},
    {"speed_mps", &Wish::speed_mps, 0, 20, false, "forward speed"},
    {"sway", &Wish::sway, 0, 5, false, "1: pitch +-0.8 deg, roll +-1.2 deg, height +-1 cm on the way"},
    {"width", &Wish::width, 16, 8192, true, "of the images, px"},
    {"height", &Wish::height, 16, 8192, true, "of the images, px"},
    {"focal", &Wish::focal, 10, 20000, false, "focal length, px (500 at a width of 640 if not given)"},
    {"baseline", &Wish::baseline, 0.005, 5, false, "distance of the cameras, m"},
    {"pitch_deg", &Wish::pitch_deg, -80, 80, false, "of the camera, nose down positive"},
    {"roll_deg", &Wish::roll_deg, -45, 45, false, "of the camera"},
    {"camera_height_m", &Wish::camera_height_m, 0.05, 20, false, "above the mean ground"},
    {"gain", &Wish::gain, 0.1, 10, false, "right image = gain * luma + offset"},
    {"offset", &Wish::offset, -255, 255, false, "right image = gain * luma + offset"},
    {"noise", &Wish::noise, 0, 60, false, "deviation of the noise in both images, grey levels"},
    {"contrast", &Wish::contrast, 0, 3, false, "of the texture, 1 as usual"},
    {"exposure", &Wish::exposure, 0, 20, false, "brightness, 1 as usual"},
    {"sky_exposure", &Wish::sky_exposure, 0, 20, false, "brightness of the sky alone"},
    {"undulation_m", &Wish::undulation_m, 0, 2, false, "amplitude of the ground's waves"},
    {"undulation_length_m", &Wish::undulation_length_m, 0.5, 100, false, "length of the ground's waves"},
    {"boxes", &Wish::boxes, 0, 32, true, "number of boxes in view"},
    {"box_height_m", &Wish::box_height_m, 0.02, 3, false, "height of these boxes"},
    {"poles", &Wish::poles, 0, 32, true, "number of poles in view"},
    {"rocks", &Wish::rocks, 0, 64, true, "number of rocks in view"},
    {"wall_m", &Wish::wall_m, 0, 1000, false, "distance of a wall across the view, 0 none"},
    {"wall_height_m", &Wish::wall_height_m, 0.1, 1000, false, "its height"},
    {"ditch_m", &Wish::ditch_m, 0, 1000, false, "distance of a ditch across the view, 0 none"},
    {"ditch_width_m", &Wish::ditch_width_m, 0.01, 100, false, "its width"},
    {"ditch_depth_m", &Wish::ditch_depth_m, 0.01, 20, false, "its depth"},
    {"step_m", &Wish::step_m, 0, 1000, false, "distance of a step down, 0 none"},
    {"step_depth_m", &Wish::step_depth_m, 0.01, 20, false, "its depth"},
};

struct Name {
    std::string_view name;
    std::string_view help;
    void (*wish)(Wish&);
};
constexpr Name kNames[] = {
    {"plane", "flat ground under the sky", [](Wish&) {}},
    {"boxes", "three boxes of 0.4 m on flat ground", [](Wish& w) { w.boxes = 3; }},
    {"poles", "four thin poles on flat ground", [](Wish& w) { w.poles = 4; }},
    {"ditch", "a ditch across flat ground", [](Wish& w) { w.ditch_m = 2.4; }},
    {"step", "a step down, as at a kerb or a loading dock", [](Wish& w) { w.step_m = 3; }},
    {"wall", "flat ground up to a wall", [](Wish& w) { w.wall_m = 6; }},
    {"undulating", "waves of +-10 cm every 4 m", [](Wish& w) { w.undulation_m = 0.10; }},
    {"clutter", "boxes, poles and rocks in front of a wall",
     [](Wish& w) {
         w.boxes = 9;
         w.poles = 5;
         w.rocks = 9;
         w.wall_m = 14;
         w.varied_boxes = true;
     }},
    {"low_texture", "boxes with a quarter of the contrast, noisy",
     [](Wish& w) {
         w.boxes = 3;
         w.contrast = 0.25;
         w.noise = 2;
     }},
    {"dark", "boxes at night: a twelfth of the light, noisy",
     [](Wish& w) {
         w.boxes = 3;
         w.exposure = 0.08;
         w.noise = 2;
     }},
    {"sky", "boxes under a large saturated sky",
     [](Wish& w) {
         w.boxes = 3;
         w.pitch_deg = 0;
         w.sky_exposure = 3;
     }},
    {"mismatch", "boxes, the right camera brighter: gain 1.06, offset 4",
     [](Wish& w) {
         w.boxes = 3;
         w.gain = 1.06;
         w.offset = 4;
         w.noise = 1;
     }},
    {"drive", "a drive over rough ground with boxes, poles, rocks and a ditch",
     [](Wish& w) {
         w.frames = 30;
         w.speed_mps = 0.5;
         w.sway = 1;
         w.noise = 1;
         w.undulation_m = 0.03;
         w.undulation_length_m = 5;
         w.ditch_m = 4;
         w.ditch_width_m = 0.8;
         w.varied_boxes = true;
         w.strewn = true;
     }},
};

[[noreturn]] void refuse(const std::string& sentence) {
    throw Refusal(ExitStatus::kUsage, sentence);
}

template <typename Entries>
const auto& find_or_refuse(std::string_view what, std::string_view wanted, const Entries& entries) {
    const auto* nearest = std::begin(entries);
    std::string all;
    for (const auto& entry : entries) {
        if (entry.name == wanted) return entry;
        if (edit_distance(wanted, entry.name) < edit_distance(wanted, nearest->name)) nearest = &entry;
        all += all.empty() ? "" : ", ";
        all += entry.name;
    }
    refuse("synthetic: unknown " + std::string(what) + " '" + std::string(wanted) + "', did you mean '" +
           std::string(nearest->name) + "'? There are: " + all);
}

std::string shown(double number) {
    char text[32];
    std::snprintf(text, sizeof text, "%.10g", number);
    return text;
}

double number_for(const Key& key, std::string_view text) {
    double number = 0.0;
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), number);
    const bool is_number =
        problem == std::errc() && end == text.data() + text.size() && std::isfinite(number);
    if (!is_number || number < key.least || number > key.most || (key.whole && number != std::floor(number)))
        refuse("synthetic: " + std::string(key.name) + "='" + std::string(text) + "' is not a " +
               (key.whole ? "whole " : "") + "number from " + shown(key.least) + " to " + shown(key.most));
    return number;
}

void read_keys(std::string_view keys, Wish& wish) {
    std::vector<std::string_view> given;
    while (!keys.empty()) {
        const std::string_view pair = keys.substr(0, keys.find('&'));
        keys.remove_prefix(std::min(keys.size(), pair.size() + 1));
        const std::size_t equals = pair.find('=');
        if (equals == std::string_view::npos)
            refuse("synthetic: '" + std::string(pair) + "' should be key=value, as in seed=1&frames=10");
        const Key& key = find_or_refuse("key", pair.substr(0, equals), kKeys);
        if (std::find(given.begin(), given.end(), key.name) != given.end())
            refuse("synthetic: " + std::string(key.name) + " is given twice");
        given.push_back(key.name);
        wish.*key.value = number_for(key, pair.substr(equals + 1));
    }
}

void place_things(const Wish& wish, Scene& scene) {
    // Things stand between the lower edge of the picture and the wall, but not farther than the eye tells.
    const double total = wish.boxes + wish.poles + wish.rocks;
    const double near = 2.2 * wish.camera_height_m;
    double far = near + 4.0 + 0.35 * total;
    if (wish.wall_m > 0.0) far = std::min(far, std::max(near, wish.wall_m - 0.6));
    const auto add = [&](Shape shape, double count) {
        for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(count); ++i) {
            const std::uint64_t key = mix(mix(scene.seed, static_cast<std::uint64_t>(shape)), i);
            Thing thing = random_thing(shape, key);
            if (shape == Shape::kBox && !wish.varied_boxes) thing.height_m = wish.box_height_m;
            // Each kind from near to far, one to a strip.
            const double share = (far - near) / count;
            const double from = near + share * static_cast<double>(i);
            place_apart(scene.things, thing, from, from + share, key);
        }
    };
    add(Shape::kBox, wish.boxes);
    add(Shape::kPole, wish.poles);
    add(Shape::kRock, wish.rocks);
}

void shape_ground(const Wish& wish, Scene& scene) {
    if (wish.undulation_m > 0.0) {
        scene.waves.push_back({wish.undulation_m, wish.undulation_length_m, 0.0, 0.0});
        // Rough ground has a second, shorter wave across the first.
        if (wish.strewn)
            scene.waves.push_back({0.5 * wish.undulation_m, 0.45 * wish.undulation_length_m, 0.9, 1.0});
    }
    if (wish.ditch_m > 0.0)
        scene.trenches.push_back({wish.ditch_m, wish.ditch_m + wish.ditch_width_m, wish.ditch_depth_m});
    if (wish.step_m > 0.0) {
        if (wish.ditch_m > 0.0 && wish.step_m <= wish.ditch_m + wish.ditch_width_m)
            refuse("synthetic: step_m must lie beyond the far side of the ditch");
        Trench step;
        step.near_m = wish.step_m;
        step.depth_m = wish.step_depth_m;
        scene.trenches.push_back(step);
    }
    if (wish.strewn && wish.step_m <= 0.0) scene.trench_period_m = 25.0;
}

}  // namespace

Scene scene_by_name(std::string_view spec) {
    constexpr std::string_view kPrefix = "synthetic:";
    if (spec.substr(0, kPrefix.size()) == kPrefix) spec.remove_prefix(kPrefix.size());
    const std::string_view name = spec.substr(0, spec.find('?'));
    const Name& entry = find_or_refuse("scene", name, kNames);
    Wish wish;
    entry.wish(wish);
    read_keys(spec.substr(std::min(spec.size(), name.size() + 1)), wish);
    if (wish.undulation_m * 4.0 > wish.camera_height_m)
        refuse("synthetic: undulation_m must be at most a quarter of camera_height_m");
    if (wish.strewn && wish.ditch_width_m > 20.0)
        refuse("synthetic: ditch_width_m must be at most 20 in a drive, whose ditches come again every 25 m");

    Scene scene;
    scene.name = entry.name;
    scene.seed = static_cast<std::uint32_t>(wish.seed);
    scene.frames = static_cast<std::int64_t>(wish.frames);
    scene.rate_hz = wish.rate_hz;
    scene.rig.width = static_cast<int>(wish.width);
    scene.rig.height = static_cast<int>(wish.height);
    scene.rig.calibrated = true;
    scene.rig.focal_px = wish.focal > 0.0 ? wish.focal : wish.width * (500.0 / 640.0);
    scene.rig.cx_px = scene.rig.cx_right_px = (wish.width - 1.0) / 2.0;
    scene.rig.cy_px = (wish.height - 1.0) / 2.0;
    scene.rig.baseline_m = wish.baseline;
    scene.mount = {det::radians(wish.pitch_deg), det::radians(wish.roll_deg), wish.camera_height_m};
    scene.speed_mps = wish.speed_mps;
    scene.sway = wish.sway;
    scene.wall_z_m = wish.wall_m;
    scene.wall_height_m = wish.wall_height_m;
    scene.strewn = wish.strewn;
    scene.contrast = wish.contrast;
    scene.photometric = {wish.gain, wish.offset, wish.noise, wish.exposure, wish.sky_exposure};
    shape_ground(wish, scene);
    place_things(wish, scene);
    return scene;
}

std::string scene_help() {
    std::string text = "Scenes:\n";
    const auto line = [&](std::string_view name, std::string_view help) {
        text += "  " + std::string(name);
        text.append(name.size() < 22 ? 22 - name.size() : 1, ' ');
        text += help;
        text += '\n';
    };
    for (const Name& entry : kNames)
        line(entry.name, entry.help);
    text += "Keys:\n";
    for (const Key& key : kKeys)
        line(key.name, std::string(key.help) + " [" + shown(key.least) + " .. " + shown(key.most) + "]");
    return text;
}

}  // namespace groundline::synth
