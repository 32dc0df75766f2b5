#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>

#include "core/edit_distance.hpp"
#include "core/error.hpp"
#include "core/result.hpp"
#include "settings/cpu_list.hpp"
#include "settings/key.hpp"
#include "settings/settings.hpp"

namespace groundline::settings {
namespace {

bool parse_number(std::string_view text, double& value) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc{} && end == text.data() + text.size() && std::isfinite(value);
}

bool parse_whole(std::string_view text, int& value) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc{} && end == text.data() + text.size();
}

// In each builder `member` maps Settings& to the member's reference, const or not.
template <typename Member>
Key number(std::string name, double low, double high, std::string help, Member member) {
    Key key{std::move(name), fmt::format("{} .. {}", low, high), std::move(help)};
    key.parse = [=](Settings& settings, std::string_view text) {
        double value = 0.0;
        if (!parse_number(text, value) || value < low || value > high) return false;
        member(settings) = value;
        return true;
    };
    key.print = [=](const Settings& settings) { return fmt::format("{}", member(settings)); };
    return key;
}

template <typename Member>
Key whole(std::string name, int low, int high, std::string help, Member member) {
    Key key{std::move(name), fmt::format("{} .. {}", low, high), std::move(help)};
    key.parse = [=](Settings& settings, std::string_view text) {
        int value = 0;
        if (!parse_whole(text, value) || value < low || value > high) return false;
        member(settings) = value;
        return true;
    };
    key.print = [=](const Settings& settings) { return fmt::format("{}", member(settings)); };
    return key;
}

// One of a few words, each standing for a value.
template <typename Value, typename Member>
Key choice(std::string name, std::vector<std::pair<std::string, Value>> words, std::string help,
           Member member) {
    std::string range;
    for (const auto& [word, value] : words)
        range += (range.empty() ? "" : " | ") + word;
    Key key{std::move(name), range, std::move(help)};
    key.parse = [=](Settings& settings, std::string_view text) {
        const auto found =
            std::find_if(words.begin(), words.end(), [&](const auto& w) { return w.first == text; });
        if (found == words.end()) return false;
        member(settings) = found->second;
        return true;
    };
    key.print = [=](const Settings& settings) {
        const auto found = std::find_if(words.begin(), words.end(),
                                        [&](const auto& w) { return w.second == member(settings); });
        return found == words.end() ? std::string{} : found->first;
    };
    return key;
}

template <typename Member>
Key on_off(std::string name, std::string help, Member member) {
    Key key = choice<bool>(std::move(name), {{"on", true}, {"off", false}}, std::move(help), member);
    // YAML writes the same two words in several ways.
    const auto words = key.parse;
    key.parse = [words](Settings& settings, std::string_view text) {
        if (text == "true" || text == "yes") return words(settings, "on");
        if (text == "false" || text == "no") return words(settings, "off");
        return words(settings, text);
    };
    return key;
}

template <typename Member>
Key text(std::string name, std::string range, std::string help, Member member) {
    Key key{std::move(name), std::move(range), std::move(help)};
    key.parse = [=](Settings& settings, std::string_view value) {
        member(settings) = std::string(value);
        return true;
    };
    key.print = [=](const Settings& settings) { return member(settings); };
    return key;
}

// A number that may be left open; `open` is its printed and accepted word for that.
template <typename Member>
Key optional_number(std::string name, double low, double high, std::string help, Member member,
                    std::string open = "unset") {
    Key key{std::move(name), fmt::format("{} | {} .. {}", open, low, high), std::move(help)};
    key.parse = [=](Settings& settings, std::string_view word) {
        if (word == open) {
            member(settings).reset();
            return true;
        }
        double value = 0.0;
        if (!parse_number(word, value) || value < low || value > high) return false;
        member(settings) = value;
        return true;
    };
    key.print = [=](const Settings& settings) {
        return member(settings) ? fmt::format("{}", *member(settings)) : open;
    };
    return key;
}

Key disparities_key() {
    Key key{"stereo.disparities", "auto | a multiple of 16 from 16 to 256",
            "Disparities searched; auto: the data set's own count if given, else a sixth of the width."};
    key.parse = [](Settings& settings, std::string_view word) {
        settings.auto_disparities = word == "auto";
        if (settings.auto_disparities) return true;
        int value = 0;
        if (!parse_whole(word, value) || value < 16 || value > 256 || value % 16 != 0) return false;
        settings.matcher.disparities = value;
        return true;
    };
    key.print = [](const Settings& settings) {
        return settings.auto_disparities ? std::string("auto")
                                         : fmt::format("{}", settings.matcher.disparities);
    };
    return key;
}

// A whole number that may be left to the matcher.
template <typename Member>
Key matchers_own(std::string name, int low, int high, std::string help, Member member) {
    constexpr int kOwn = stereo::CheckLimits::kMatchersOwn;
    Key key = whole(std::move(name), low, high, std::move(help), member);
    key.range = "auto | " + key.range;
    key.parse = [=, parse = key.parse](Settings& settings, std::string_view word) {
        if (word != "auto") return parse(settings, word);
        member(settings) = kOwn;
        return true;
    };
    key.print = [=, print = key.print](const Settings& settings) {
        return member(settings) == kOwn ? std::string("auto") : print(settings);
    };
    return key;
}

Key tolerance_key() {
    Key key = number(
        "terrain.tolerance_m", 0.01, 2.0, "Height and depth that the robot drives over.",
        [](auto& settings) -> auto& { return settings.terrain.tolerance_up_m; });
    const auto parse_up = key.parse;
    key.parse = [parse_up](Settings& settings, std::string_view word) {
        if (!parse_up(settings, word)) return false;
        settings.terrain.tolerance_down_m = settings.terrain.tolerance_up_m;
        return true;
    };
    return key;
}

Key reloadable(Key key) {
    key.reloadable = true;
    return key;
}

template <typename Member>
Key cpus(std::string name, std::string help, Member member) {
    Key key = text(std::move(name), "processors such as 0,2-3; empty: any", std::move(help), member);
    key.parse = [parse = key.parse](Settings& settings, std::string_view list) {
        return parse_cpu_list(list).has_value() && parse(settings, list);
    };
    return key;
}

Key pixel_format_key() {
    std::vector<std::pair<std::string, std::optional<capture::PixelFormat>>> words = {{"auto", std::nullopt}};
    for (int i = 0; i < capture::kPixelFormats; ++i) {
        const auto format = static_cast<capture::PixelFormat>(i);
        words.emplace_back(std::string(capture::name_of(format)), format);
    }
    return choice<std::optional<capture::PixelFormat>>(
        "capture.format", words,
        "Cameras: pixel format; auto takes the first of these that gives the size at the rate.",
        [](auto& settings) -> auto& { return settings.capture.camera.format; });
}

// Written once for const and mutable settings.
#define GROUNDLINE_MEMBER(path) ([](auto& settings) -> auto& { return settings.path; })

void add_capture_keys(std::vector<Key>& keys) {
    keys.push_back(choice<CaptureDriver>(
        "capture.driver",
        {{"v4l2", CaptureDriver::kV4l2},
         {"libcamera", CaptureDriver::kLibcamera},
         {"files", CaptureDriver::kFiles},
         {"synthetic", CaptureDriver::kSynthetic}},
        "Daemon: where pairs come from: cameras through V4L2 or libcamera, recordings, or rendered scenes.",
        GROUNDLINE_MEMBER(capture.driver)));
    keys.push_back(
        text("capture.source", "a folder, a video, two pictures with a comma between, or a scene",
             "Daemon: what files or synthetic opens, as groundline replay does; a scene is NAME[?seed=N].",
             GROUNDLINE_MEMBER(capture.source)));
    keys.push_back(text("capture.calibration", "a file, or two with a comma between",
                        "Daemon: calibration of the pair; empty: looked for beside the pictures.",
                        GROUNDLINE_MEMBER(capture.calibration)));
    keys.push_back(on_off("capture.loop",
                          "Daemon: recorded and rendered pairs begin again at their end; off, the program "
                          "ends with them.",
                          GROUNDLINE_MEMBER(capture.loop)));

    using capture::Flip;
    const std::string names = "/dev/... | videoN | by-id/... | by-path/... | serial:...";
    keys.push_back(text("capture.device", names,
                        "Cameras: the one that gives both eyes side by side, left eye on the left.",
                        GROUNDLINE_MEMBER(capture.camera.device)));
    keys.push_back(text("capture.left", names,
                        "Cameras: the left one; by-path names a port, by-id and serial the camera itself.",
                        GROUNDLINE_MEMBER(capture.camera.left)));
    keys.push_back(
        text("capture.right", names, "Cameras: the right one.", GROUNDLINE_MEMBER(capture.camera.right)));
    keys.push_back(whole("capture.width", 16, 8192,
                         "Cameras: width of one eye's picture; the calibration must be for this size.",
                         GROUNDLINE_MEMBER(capture.camera.width)));
    keys.push_back(
        whole("capture.height", 16, 8192, "Cameras: its height.", GROUNDLINE_MEMBER(capture.camera.height)));
    keys.push_back(pixel_format_key());
    keys.push_back(number("capture.rate_hz", 0.1, 1000.0,
                          "Cameras: pictures a second; the nearest that the camera has is taken.",
                          GROUNDLINE_MEMBER(capture.camera.rate_hz)));
    keys.push_back(optional_number("capture.exposure_us", 1.0, 1e6,
                                   "Cameras: exposure time; auto leaves it to each camera.",
                                   GROUNDLINE_MEMBER(capture.camera.exposure_us), "auto"));
    keys.push_back(optional_number("capture.gain", 0.0, 1e6,
                                   "Cameras: gain in the camera's own units; auto leaves it to each camera.",
                                   GROUNDLINE_MEMBER(capture.camera.gain), "auto"));
    keys.push_back(choice<Flip>("capture.flip",
                                {{"none", Flip::kNone},
                                 {"horizontal", Flip::kHorizontal},
                                 {"vertical", Flip::kVertical},
                                 {"both", Flip::kBoth}},
                                "Cameras: what each is told to mirror; both is a camera mounted upside down.",
                                GROUNDLINE_MEMBER(capture.camera.flip)));
    keys.push_back(
        on_off("capture.follow_exposure",
               "Cameras: the right one takes over exposure and gain that the left one says it uses; not "
               "for cameras whose automatic does not say.",
               GROUNDLINE_MEMBER(capture.follow_exposure)));
    keys.push_back(number(
        "capture.pair_tolerance_ms", 0.01, 1000.0,
        "Cameras: exposures further apart, or by more than half a period, are no pair; beyond 2 ms the "
        "verdict is degraded.",
        GROUNDLINE_MEMBER(capture.pair_tolerance_ms)));
    keys.push_back(number("capture.start_timeout_s", 0.5, 600.0,
                          "Cameras: opened again when no picture has come for this long after a start.",
                          GROUNDLINE_MEMBER(capture.start_timeout_s)));
    keys.push_back(
        number("capture.stall_timeout_s", 0.1, 60.0,
               "Cameras: opened again when an eye gave no picture for this long; 3 periods or more.",
               GROUNDLINE_MEMBER(capture.stall_timeout_s)));
}

void add_daemon_keys(std::vector<Key>& keys) {
    keys.push_back(whole("process.threads", 0, 256,
                         "Daemon: threads that share a frame; 0 is one for each processor.",
                         GROUNDLINE_MEMBER(process.threads)));
    using verdict::HalfResolution;
    keys.push_back(choice<HalfResolution>(
        "overload.half_resolution",
        {{"auto", HalfResolution::kWhenOverloaded},
         {"never", HalfResolution::kNever},
         {"always", HalfResolution::kAlways}},
        "Half the resolution, which degrades the verdict: auto is for as long as a daemon that skips pairs "
        "still does not keep up, and never in a replay; always is every pair, to look at the result.",
        GROUNDLINE_MEMBER(overload.half_resolution)));
    keys.push_back(on_off("realtime.scheduling",
                          "Daemon: run capture, processing and sinks as SCHED_FIFO where that is permitted.",
                          GROUNDLINE_MEMBER(realtime.on)));
    keys.push_back(whole("realtime.capture_priority", 1, 49,
                         "Priority of the capture thread; interrupt threads of the kernel run at 50.",
                         GROUNDLINE_MEMBER(realtime.capture_priority)));
    keys.push_back(whole("realtime.process_priority", 1, 49,
                         "Priority of the processing thread and its workers.",
                         GROUNDLINE_MEMBER(realtime.process_priority)));
    keys.push_back(whole("realtime.sinks_priority", 1, 49, "Priority of the thread that publishes.",
                         GROUNDLINE_MEMBER(realtime.sinks_priority)));
    keys.push_back(cpus("realtime.capture_cpus", "Where the capture thread may run.",
                        GROUNDLINE_MEMBER(realtime.capture_cpus)));
    keys.push_back(cpus("realtime.process_cpus", "Where the processing thread and its workers may run.",
                        GROUNDLINE_MEMBER(realtime.process_cpus)));
    keys.push_back(cpus("realtime.sinks_cpus", "Where the thread that publishes may run.",
                        GROUNDLINE_MEMBER(realtime.sinks_cpus)));
    keys.push_back(on_off("realtime.lock_memory",
                          "Daemon: keep memory from being swapped out where that is permitted.",
                          GROUNDLINE_MEMBER(realtime.lock_memory)));
}

std::vector<Key> make_keys() {
    using stereo::MatcherKind;
    using stereo::RuleOne;
    using stereo::RuleTwo;
    using stereo::Window;
    using terrain::Band;
    using terrain::LineMode;
    std::vector<Key> keys;
    add_capture_keys(keys);

    keys.push_back(choice<MatcherKind>("stereo.matcher",
                                       {{"census_pyramid", MatcherKind::kCensusPyramid},
                                        {"census", MatcherKind::kCensus},
                                        {"paper", MatcherKind::kPaper}},
                                       "How the pair is matched: census words and semi-global paths at half "
                                       "the resolution, then refined; the same at full resolution; or the "
                                       "paper's way.",
                                       GROUNDLINE_MEMBER(matcher.kind)));
    keys.push_back(disparities_key());
    keys.push_back(whole("stereo.min_disparity", -128, 256, "Smallest disparity searched.",
                         GROUNDLINE_MEMBER(matcher.min_disparity)));
    keys.push_back(choice<bool>("stereo.normalise", {{"off", false}, {"local_mean", true}},
                                "Paper only: what is taken out of both views before matching; without it "
                                "that matcher fails where the cameras differ in brightness.",
                                GROUNDLINE_MEMBER(matcher.normalise_local_mean)));
    keys.push_back(
        on_off("stereo.checks",
               "Validity checks; off, every pixel is answered (the paper's in whole pixels, its pure form).",
               GROUNDLINE_MEMBER(matcher.checks)));
    keys.push_back(on_off("stereo.subpixel", "Refine to 1/16 px; the paper's matcher with checks only.",
                          GROUNDLINE_MEMBER(matcher.limits.subpixel)));
    keys.push_back(
        whole("stereo.texture", 0, 100000,
              "With checks: least sum of horizontal grey-level steps in the 11x11 window; 0 is off.",
              GROUNDLINE_MEMBER(matcher.limits.texture)));
    keys.push_back(
        matchers_own("stereo.saturated_percent", 0, 100,
                     "With checks: most percent of the window at black or white; 100 is off; auto: 25 "
                     "for the paper, else 75.",
                     GROUNDLINE_MEMBER(matcher.limits.saturated_percent)));
    keys.push_back(
        whole("stereo.cost_percent", 0, 100,
              "Paper only, with checks: highest cost of an answer, percent of the truncation; 100 is off.",
              GROUNDLINE_MEMBER(matcher.limits.cost_percent)));
    keys.push_back(
        matchers_own("stereo.uniqueness_percent", -1, 100,
                     "With checks: by how much the second-best match must be worse; -1 is off; auto: "
                     "5 for the paper, else off.",
                     GROUNDLINE_MEMBER(matcher.limits.uniqueness_percent)));
    keys.push_back(whole("stereo.left_right_px", -1, 16,
                         "With checks: most difference to the match from the right view; -1 is off.",
                         GROUNDLINE_MEMBER(matcher.limits.left_right_px)));
    keys.push_back(whole("stereo.speckle_px", 0, 100000,
                         "With checks: patches with fewer pixels are not believed; 0 is off.",
                         GROUNDLINE_MEMBER(matcher.limits.speckle_px)));
    keys.push_back(whole("stereo.alike_percent", 0, 100,
                         "With checks: least percent of the pairs of pixels in a patch that both views order "
                         "alike; 0 is off.",
                         GROUNDLINE_MEMBER(matcher.limits.alike_percent)));
    keys.push_back(on_off("stereo.median", "With checks: smooth what is left by a 3x3 median.",
                          GROUNDLINE_MEMBER(matcher.limits.median)));
    keys.push_back(choice<RuleOne>(
        "stereo.rule_one", {{"mean9", RuleOne::kMean9}, {"sum9", RuleOne::kSum9}, {"off", RuleOne::kOff}},
        "Paper only: reading of the paper's first rule.", GROUNDLINE_MEMBER(matcher.paper.rule_one)));
    keys.push_back(choice<RuleTwo>("stereo.rule_two",
                                   {{"seven_of_eight", RuleTwo::kSevenOfEight},
                                    {"seven_of_nine", RuleTwo::kSevenOfNine},
                                    {"off", RuleTwo::kOff}},
                                   "Paper only: reading of the paper's second rule.",
                                   GROUNDLINE_MEMBER(matcher.paper.rule_two)));
    keys.push_back(
        on_off("stereo.rules_at_once",
               "Paper only: the second rule judges the costs from before the first, not from after it.",
               GROUNDLINE_MEMBER(matcher.paper.rules_at_once)));
    keys.push_back(choice<Window>(
        "stereo.window", {{"gauss5", Window::kGauss5}, {"gauss5.5", Window::kGauss55}, {"box", Window::kBox}},
        "Paper only: weights of the 11x11 window: sigma 5/3 (the paper's), 5.5/3, or equal.",
        GROUNDLINE_MEMBER(matcher.paper.window)));
    keys.push_back(
        whole("stereo.truncation", 1, 28,
              "Paper only: most grey levels that one pixel adds to a cost; the paper's 4 % are 10.",
              GROUNDLINE_MEMBER(matcher.paper.truncation)));

    keys.push_back(reloadable(tolerance_key()));
    keys.push_back(
        reloadable(number("terrain.tolerance_ratio", 0.01, 0.9,
                          "The same as a share of the camera height, used where there is no calibration.",
                          GROUNDLINE_MEMBER(terrain.tolerance_ratio))));
    keys.push_back(reloadable(number("terrain.clearance_m", 0.1, 100.0,
                                     "What hangs wholly above this height is no obstacle.",
                                     GROUNDLINE_MEMBER(terrain.clearance_m))));
    keys.push_back(choice<Band>("terrain.band",
                                {{"off", Band::kOff},
                                 {"50rows", Band::k50Rows},
                                 {"50px", Band::k50Px},
                                 {"50disp8", Band::k50Disparity8}},
                                "The paper's parallel band instead of a height in metres, and its unit.",
                                GROUNDLINE_MEMBER(terrain.band)));
    keys.push_back(
        choice<LineMode>("terrain.line", {{"votes", LineMode::kVotes}, {"longest", LineMode::kLongest}},
                         "How the ground line is chosen: most votes, or the paper's longest segment.",
                         GROUNDLINE_MEMBER(terrain.line)));
    keys.push_back(
        reloadable(number("terrain.stopping_distance_m", 0.0, 100.0, "Distance the robot needs to stop.",
                          GROUNDLINE_MEMBER(terrain.stopping_distance_m))));
    keys.push_back(whole("terrain.sectors", 1, static_cast<int>(kMaxSectors),
                         "Bearing sectors the field of view is cut into.",
                         GROUNDLINE_MEMBER(terrain.sectors)));
    keys.push_back(
        whole("terrain.clear_frames", 1, 32,
              "Frames without an obstacle or drop, of the last clear_window, that clear its sector.",
              GROUNDLINE_MEMBER(terrain.clear_frames)));
    keys.push_back(whole("terrain.clear_window", 1, 32, "Frames that clear_frames are counted among.",
                         GROUNDLINE_MEMBER(terrain.clear_window)));

    keys.push_back(optional_number("mount.height_m", 0.05, 20.0,
                                   "Height of the left camera above the ground.",
                                   GROUNDLINE_MEMBER(mount.height_m)));
    keys.push_back(optional_number("mount.pitch_deg", -30.0, 80.0, "Pitch of the camera, positive nose down.",
                                   GROUNDLINE_MEMBER(mount.pitch_deg)));
    keys.push_back(optional_number("mount.roll_deg", -45.0, 45.0,
                                   "Roll of the camera, positive where the ground leans to the right.",
                                   GROUNDLINE_MEMBER(mount.roll_deg)));
    keys.push_back(number("mount.x_m", -50.0, 50.0, "Left camera before the robot's origin.",
                          GROUNDLINE_MEMBER(mount.x_m)));
    keys.push_back(number("mount.y_m", -50.0, 50.0, "Left camera to the left of the robot's origin.",
                          GROUNDLINE_MEMBER(mount.y_m)));
    keys.push_back(number("mount.yaw_deg", -180.0, 180.0, "Where the camera looks, positive to the left.",
                          GROUNDLINE_MEMBER(mount.yaw_deg)));
    keys.push_back(text("mount.body_mask", "polygons 'x,y x,y x,y; ...' or the path of a picture",
                        "The robot's own parts in the rectified left picture, in its pixels, or a picture of "
                        "its size that is not black there: left out everywhere.",
                        GROUNDLINE_MEMBER(mount.body_mask)));

    keys.push_back(text("publish.url", "an LCM URL",
                        "LCM provider; empty: LCM_DEFAULT_URL, else the library's.",
                        GROUNDLINE_MEMBER(publish.url)));
    keys.push_back(text("publish.prefix", "a word", "Channels are PREFIX_MASK, PREFIX_SECTORS and so on.",
                        GROUNDLINE_MEMBER(publish.prefix)));
    keys.push_back(reloadable(on_off("publish.v_disparity", "Publish the v-disparity image too.",
                                     GROUNDLINE_MEMBER(publish.v_disparity))));
    keys.push_back(reloadable(on_off("publish.preview", "Publish a small picture of the left view too.",
                                     GROUNDLINE_MEMBER(publish.preview))));
    keys.push_back(on_off("publish.obstacles", "Publish the things in the mask as a list too.",
                          GROUNDLINE_MEMBER(publish.obstacles)));

    keys.push_back(on_off("attitude.input",
                          "Take the camera's attitude from the channel PREFIX_ATTITUDE: a step of the ground "
                          "that it made too is believed.",
                          GROUNDLINE_MEMBER(attitude.input)));
    keys.push_back(number("attitude.max_gap_ms", 1.0, 1000.0,
                          "How far from a picture's exposure, or apart about it, attitudes may be to count.",
                          GROUNDLINE_MEMBER(attitude.max_gap_ms)));

    keys.push_back(on_off("grid.publish",
                          "Grade the ground cell by cell (elevation, slope, roughness, step, traversability "
                          "index) and publish that too.",
                          GROUNDLINE_MEMBER(grid.on)));
    keys.push_back(number("grid.cell_m", 0.02, 2.0, "Edge of a cell; one message holds 6500 cells.",
                          GROUNDLINE_MEMBER(grid.cell_m)));
    keys.push_back(number("grid.forward_m", 0.1, 200.0,
                          "How far the cells reach ahead of the robot's origin.",
                          GROUNDLINE_MEMBER(grid.forward_m)));
    keys.push_back(number("grid.side_m", 0.1, 200.0, "How far they reach to either side of it.",
                          GROUNDLINE_MEMBER(grid.side_m)));
    keys.push_back(number("grid.steep_deg", 2.0, 60.0, "A slope from which on a cell's index is 0.",
                          GROUNDLINE_MEMBER(grid.steep_deg)));

    add_daemon_keys(keys);
    return keys;
}

#undef GROUNDLINE_MEMBER

}  // namespace

const std::vector<Key>& keys() {
    static const std::vector<Key> table = make_keys();
    return table;
}

const Key* find_key(std::string_view name) {
    const auto found =
        std::find_if(keys().begin(), keys().end(), [&](const Key& key) { return key.name == name; });
    return found == keys().end() ? nullptr : &*found;
}

std::string nearest_key(std::string_view name) {
    const auto nearest = std::min_element(keys().begin(), keys().end(), [&](const Key& a, const Key& b) {
        return edit_distance(a.name, name) < edit_distance(b.name, name);
    });
    return nearest->name;
}

}  // namespace groundline::settings
