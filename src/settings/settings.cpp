#include "settings/settings.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "capture/camera_source.hpp"
#include "core/error.hpp"
#include "settings/key.hpp"

namespace groundline::settings {
namespace {

[[noreturn]] void refuse(const std::string& sentence) {
    throw Refusal(ExitStatus::kConfig, sentence);
}

// `where` names the place the value was read from, for the operator.
void set_value(Settings& settings, const std::string& name, const std::string& text,
               const std::string& where) {
    const Key* key = find_key(name);
    if (key == nullptr)
        refuse(fmt::format("{}: unknown configuration key '{}'; did you mean '{}'?", where, name,
                           nearest_key(name)));
    if (!key->parse(settings, text))
        refuse(fmt::format("{}: '{}' is not a value for {}; expected {}", where, text, name, key->range));
}

std::string place(const std::filesystem::path& file, const YAML::Mark& mark) {
    return fmt::format("{}:{}", file.string(), mark.line + 1);
}

void load_map(Settings& settings, const YAML::Node& map, const std::string& prefix,
              const std::filesystem::path& file) {
    for (const auto& entry : map) {
        const std::string where = place(file, entry.first.Mark());
        if (!entry.first.IsScalar()) refuse(where + ": expected a configuration key");
        const std::string name = prefix + entry.first.Scalar();
        if (entry.second.IsMap()) {
            load_map(settings, entry.second, name + ".", file);
        } else if (entry.second.IsScalar() || entry.second.IsNull()) {
            set_value(settings, name, entry.second.IsScalar() ? entry.second.Scalar() : "", where);
        } else {
            refuse(fmt::format("{}: the value of {} must be a single word or number", where, name));
        }
    }
}

}  // namespace

void load_file(Settings& settings, const std::filesystem::path& file) {
    std::ifstream stream(file);
    std::stringstream text;
    // An empty file merely fails; what cannot be read is bad.
    if (!std::filesystem::is_regular_file(file) || !stream || (text << stream.rdbuf()).bad())
        throw Refusal(ExitStatus::kInput, fmt::format("{}: cannot read this configuration file; check the "
                                                      "path and its permissions",
                                                      file.string()));
    try {
        const YAML::Node root = YAML::Load(text.str());
        if (root.IsNull()) return;
        if (!root.IsMap())
            refuse(fmt::format("{}: expected configuration keys with values, one a line", file.string()));
        load_map(settings, root, "", file);
    } catch (const YAML::Exception& fault) {
        refuse(fmt::format("{}: not valid YAML: {}", place(file, fault.mark), fault.msg));
    }
}

void set_word(Settings& settings, std::string_view word) {
    const std::size_t equals = word.find('=');
    if (equals == std::string_view::npos || equals == 0)
        throw Refusal(ExitStatus::kUsage, fmt::format("--set {}: expected key=value", word));
    set_value(settings, std::string(word.substr(0, equals)), std::string(word.substr(equals + 1)), "--set");
}

terrain::TerrainConfig terrain_config(const Settings& settings) {
    terrain::TerrainConfig config = settings.terrain;
    const MountSettings& mount = settings.mount;
    // Whole disparities carry 0.3 px from rounding alone, on top of what the match is off.
    const bool can_refine = settings.matcher.checks || settings.matcher.kind != stereo::MatcherKind::kPaper;
    const bool subpixel = can_refine && settings.matcher.limits.subpixel;
    if (!subpixel) config.sigma_disparity_px = 0.5;
    config.mount_x_m = mount.x_m;
    config.mount_y_m = mount.y_m;
    config.mount_yaw_deg = mount.yaw_deg;
    if (!mount.height_m && !mount.pitch_deg && !mount.roll_deg) return config;
    if (!mount.height_m || !mount.pitch_deg)
        refuse("mount.height_m and mount.pitch_deg go together: set both, or neither");
    config.mount_known = true;
    config.mount_height_m = *mount.height_m;
    config.mount_pitch_deg = *mount.pitch_deg;
    config.mount_roll_deg = mount.roll_deg.value_or(0.0);
    config.gate =
        terrain::gate_of_mount(config.mount_height_m, config.mount_pitch_deg, config.mount_roll_deg);
    return config;
}

verdict::Limits verdict_limits(const Settings& settings) {
    verdict::Limits limits;
    const bool local =
        settings.matcher.normalise_local_mean || settings.matcher.kind != stereo::MatcherKind::kPaper;
    limits.photometric = local ? verdict::kLocalOrder : verdict::kRawDifferences;
    return limits;
}

Reload reload(const Settings& running, const Settings& wanted) {
    Reload result{running, {}, {}};
    for (const Key& key : keys()) {
        const std::string value = key.print(wanted);
        if (value == key.print(running)) continue;
        if (key.reloadable) key.parse(result.settings, value);
        (key.reloadable ? result.taken : result.need_restart).push_back(key.name);
    }
    return result;
}

capture::CameraSourceConfig camera_source_config(const Settings& settings) {
    const CaptureSettings& live = settings.capture;
    const capture::CameraSetup& camera = live.camera;
    if (camera.side_by_side() && (!camera.left.empty() || !camera.right.empty()))
        refuse(
            "capture.device is one camera that gives both eyes side by side: set it, or capture.left and "
            "capture.right, not all of them");
    if (!camera.side_by_side() && (camera.left.empty() || camera.right.empty()))
        refuse(
            "no cameras are named: set capture.left and capture.right, or capture.device for one camera that "
            "gives both eyes side by side");
    if (camera.left == camera.right && !camera.side_by_side())
        refuse(fmt::format("capture.left and capture.right are both '{}': name two cameras", camera.left));
    capture::CameraSourceConfig config;
    config.name = camera.side_by_side() ? camera.device : fmt::format("{} and {}", camera.left, camera.right);
    config.width = camera.width;
    config.height = camera.height;
    config.rate_hz = camera.rate_hz;
    config.side_by_side = camera.side_by_side();
    const double period_s = 1.0 / camera.rate_hz;
    if (live.stall_timeout_s < 3.0 * period_s)
        refuse(
            fmt::format("capture.stall_timeout_s {} is less than three pictures take at capture.rate_hz {}: "
                        "set it to {:.3g} or more",
                        live.stall_timeout_s, camera.rate_hz, std::ceil(300.0 * period_s) / 100.0));
    config.pairing.tolerance_ns =
        static_cast<std::int64_t>(std::min(live.pair_tolerance_ms * 1e6, period_s * 1e9 / 2.0));
    config.limits.start_ns = static_cast<std::int64_t>(live.start_timeout_s * 1e9);
    config.limits.stall_ns = static_cast<std::int64_t>(live.stall_timeout_s * 1e9);
    config.follow_exposure = live.follow_exposure;
    return config;
}

std::vector<std::pair<std::string, std::string>> in_force(const Settings& settings) {
    std::vector<std::pair<std::string, std::string>> values;
    values.reserve(keys().size());
    for (const Key& key : keys())
        values.emplace_back(key.name, key.print(settings));
    return values;
}

std::string sample_file() {
    const Settings defaults;
    std::string text =
        "# groundline configuration: every key at its default. Remove the # in front of a key to set it.\n"
        "# A running groundlined takes over keys marked (reload) on SIGHUP; the others need a restart.\n";
    std::string section;
    for (const Key& key : keys()) {
        const std::size_t dot = key.name.find('.');
        if (key.name.substr(0, dot) != section) {
            section = key.name.substr(0, dot);
            text += "\n";
        }
        const std::string value = key.print(defaults);
        text += fmt::format("# {} [{}]{}\n#{}: {}\n", key.help, key.range, key.reloadable ? " (reload)" : "",
                            key.name, value);
    }
    return text;
}

}  // namespace groundline::settings
