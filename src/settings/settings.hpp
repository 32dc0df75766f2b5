// Everything that can be configured, and the ways it is set: a file, key=value words, defaults.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "capture/camera_setup.hpp"
#include "stereo/matcher.hpp"
#include "terrain/config.hpp"
#include "terrain/elevation_grid.hpp"
#include "verdict/overload.hpp"
#include "verdict/verdict.hpp"

namespace groundline::capture {
struct CameraSourceConfig;
}

namespace groundline::settings {

// How the camera sits on the robot, where it was measured. Body frame: x forward, y left.
struct MountSettings {
    std::optional<double> height_m;
    std::optional<double> pitch_deg;  // nose down is positive
    std::optional<double> roll_deg;
    double x_m = 0.0;
    double y_m = 0.0;
    double yaw_deg = 0.0;   // positive to the left
    std::string body_mask;  // polygons or the path of a picture, see io/body_mask.hpp; empty: none
};

enum class CaptureDriver : std::uint8_t { kV4l2, kLibcamera, kFiles, kSynthetic };

// Where the daemon's pairs come from; `groundline replay` names its source on the command line.
struct CaptureSettings {
    CaptureDriver driver = CaptureDriver::kFiles;
    std::string source;       // what the driver opens
    std::string calibration;  // one file, or two with a comma between; empty: looked for beside the pictures
    bool loop = true;         // recorded and rendered pairs begin again at their end

    capture::CameraSetup camera;  // of the live drivers, like what follows
    bool follow_exposure = false;
    double pair_tolerance_ms = 10.0;
    double start_timeout_s = 10.0;
    double stall_timeout_s = 2.0;
};

// What the daemon asks of the machine.
struct RealtimeSettings {
    bool on = true;
    int sinks_priority = 10;
    int process_priority = 20;
    int capture_priority = 30;
    std::string sinks_cpus;  // lists such as 0,2-3; empty: any
    std::string process_cpus;
    std::string capture_cpus;
    bool lock_memory = true;
};

struct ProcessSettings {
    int threads = 0;  // that share a frame; 0: one a processor
};

struct OverloadSettings {
    verdict::HalfResolution half_resolution = verdict::HalfResolution::kWhenOverloaded;
};

struct PublishSettings {
    std::string url;                    // empty: LCM_DEFAULT_URL, else the library's default
    std::string prefix = "GROUNDLINE";  // channels are PREFIX_MASK, PREFIX_SECTORS, ...
    bool v_disparity = false;
    bool preview = false;
    bool obstacles = false;
};

// What another sensor of the robot tells.
struct AttitudeSettings {
    bool input = false;
    double max_gap_ms = 100.0;
};

// Const while a pipeline runs. Defaults are the member initialisers here and in the rooms' own structs.
struct Settings {
    stereo::MatcherConfig matcher;
    bool auto_disparities = true;    // stereo.disparities: auto
    terrain::TerrainConfig terrain;  // without the mount: see terrain_config()
    terrain::GridConfig grid;
    MountSettings mount;
    PublishSettings publish;
    AttitudeSettings attitude;
    CaptureSettings capture;
    ProcessSettings process;
    OverloadSettings overload;
    RealtimeSettings realtime;
};

// Reads a YAML file of keys, nested (`stereo: {matcher: paper}`) or dotted (`stereo.matcher: paper`), over
// what `settings` holds. Throws Refusal: kInput when the file cannot be read; kConfig with file, line and the
// nearest known key for an unknown key, the accepted range for a bad value, and for malformed YAML.
void load_file(Settings& settings, const std::filesystem::path& file);

// Sets one key from a `key=value` word of the command line. Throws Refusal(kConfig) likewise.
void set_word(Settings& settings, std::string_view word);

// What the rooms get: the terrain with the mount and its gate, the verdict's limits that fit the matcher.
// Throws Refusal(kConfig) for half a mount (height without pitch or the other way round).
terrain::TerrainConfig terrain_config(const Settings& settings);
verdict::Limits verdict_limits(const Settings& settings);

// What a live source gets (capture/camera_source.hpp); its driver gets settings.capture.camera. Throws
// Refusal(kConfig) where the cameras are not named: either one device for both eyes, or a left and a right
// one; and for a capture.stall_timeout_s below three periods. The tolerance is at most half a period: beyond
// that a picture would belong to two pairs.
capture::CameraSourceConfig camera_source_config(const Settings& settings);

// What of `wanted` a running daemon can take over, and what it cannot.
struct Reload {
    Settings settings;  // `running` with the reloadable keys of `wanted`
    std::vector<std::string> taken;
    std::vector<std::string> need_restart;
};
Reload reload(const Settings& running, const Settings& wanted);

// Every key with its value in force, in the table's order.
std::vector<std::pair<std::string, std::string>> in_force(const Settings& settings);

// The sample configuration: every key commented out at its default, with help, unit and range.
std::string sample_file();

}  // namespace groundline::settings
