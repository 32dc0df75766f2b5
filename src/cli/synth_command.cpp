#include "cli/synth_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>
#include <system_error>
#include <thread>

#include "cli/interrupt.hpp"
#include "core/arena.hpp"
#include "core/deterministic_math.hpp"
#include "core/error.hpp"
#include "io/atomic_file.hpp"
#include "io/png.hpp"
#include "pipeline/worker_pool.hpp"
#include "synth/renderer.hpp"

namespace groundline::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::string_view kFolders[] = {"left", "right", "disp", "occluded", "class", "height"};

// All that one frame becomes, allocated once.
struct Images {
    Arena arena;
    Luma left, right;
    BgrView left_bgr;
    synth::Truth truth;
    ImageView<std::uint16_t> disparity_q8;
    ImageView<std::uint16_t> height_mm;

    Images(int width, int height)
        : left(arena.image<std::uint8_t>(width, height)),
          right(arena.image<std::uint8_t>(width, height)),
          left_bgr(arena.bgr_image(width, height)),
          truth(synth::Truth::make(arena, width, height)),
          disparity_q8(arena.image<std::uint16_t>(width, height)),
          height_mm(arena.image<std::uint16_t>(width, height)) {}

    // Truth in the units of the files.
    void encode() {
        constexpr double kMost = 65535.0;
        for (int v = 0; v < truth.seen.height; ++v)
            for (int u = 0; u < truth.seen.width; ++u) {
                const double disparity = std::floor(truth.disparity_px.at(u, v) * 256.0 + 0.5);
                const double height = std::floor(truth.height_m.at(u, v) * 1000.0 + 0.5) + 32768.0;
                const bool seen = truth.seen.at(u, v) != 0;
                const bool fits = disparity >= 0.0 && disparity <= kMost;
                disparity_q8.at(u, v) = fits ? static_cast<std::uint16_t>(disparity) : 0;
                height_mm.at(u, v) = seen ? static_cast<std::uint16_t>(std::clamp(height, 1.0, kMost)) : 0;
                truth.occluded.at(u, v) = truth.occluded.at(u, v) != 0 ? 255 : 0;
            }
    }
    void write(const fs::path& folder, std::int64_t frame) const {
        const std::string name = fmt::format("{:06}.png", frame);
        io::write_png(folder / "left" / name, left_bgr);
        io::write_png(folder / "right" / name, ConstLuma(right));
        io::write_png(folder / "disp" / name, ConstImageView<std::uint16_t>(disparity_q8));
        io::write_png(folder / "occluded" / name, ConstLuma(truth.occluded));
        io::write_png(folder / "class" / name, ConstMask(truth.terrain));
        io::write_png(folder / "height" / name, ConstImageView<std::uint16_t>(height_mm));
    }
};

void claim_folder(const fs::path& folder) {
    const auto refuse = [&](const std::string& why) {
        throw Refusal(ExitStatus::kInput, fmt::format("the output folder '{}' {}", folder.string(), why));
    };
    std::error_code problem;
    if (fs::exists(folder, problem)) {
        if (!fs::is_directory(folder, problem)) refuse("is a file; name a folder that is empty or new");
        const bool empty = fs::is_empty(folder, problem);
        if (problem) refuse("cannot be read: " + problem.message());
        if (!empty) refuse("holds something already; name one that is empty or new");
    }
    for (const std::string_view name : kFolders) {
        fs::create_directories(folder / name, problem);
        if (problem) refuse("cannot be made: " + problem.message());
    }
}

// KITTI's form: row-major 3x4, baseline = (P0[3] - P1[3]) / f.
std::string calibration_text(const RectifiedRig& rig) {
    const auto row = [&](std::string_view name, double cx, double shift) {
        return fmt::format("{}: {} 0 {} {} 0 {} {} 0 0 0 1 0\n", name, rig.focal_px, cx, shift, rig.focal_px,
                           rig.cy_px);
    };
    return row("P0", rig.cx_px, 0.0) + row("P1", rig.cx_right_px, -rig.focal_px * rig.baseline_m);
}

ordered_json scene_json(const synth::Scene& scene, const SynthOptions& options) {
    const RectifiedRig& rig = scene.rig;
    return {{"scene", options.spec},
            {"seed", scene.seed},
            {"rate_hz", scene.rate_hz},
            {"tolerance_m", options.tolerance_m},
            {"rig",
             {{"width", rig.width},
              {"height", rig.height},
              {"focal_px", rig.focal_px},
              {"cx_px", rig.cx_px},
              {"cy_px", rig.cy_px},
              {"baseline_m", rig.baseline_m}}},
            {"frames", ordered_json::array()}};
}

ordered_json frame_json(const synth::Renderer& renderer, std::int64_t frame) {
    const synth::CameraPose camera = synth::camera_at(renderer.scene(), frame);
    const DisparityPlane plane = renderer.plane(frame);
    return {{"frame", frame},
            {"plane", {plane.du, plane.dv, plane.d0}},
            {"pitch_deg", det::degrees(camera.pose.pitch_rad)},
            {"roll_deg", det::degrees(camera.pose.roll_rad)},
            {"height_m", camera.pose.height_m},
            {"forward_m", camera.forward_m}};
}

}  // namespace

int run_synth(const SynthOptions& options) {
    synth::Scene scene = synth::scene_by_name(options.spec);
    const std::int64_t frames = options.frames.value_or(scene.frames);
    if (frames < 1) throw Refusal(ExitStatus::kUsage, "--frames must be at least 1");
    if (!(options.tolerance_m > 0.0)) throw Refusal(ExitStatus::kUsage, "--tolerance-m must be above 0");
    const synth::Renderer renderer(std::move(scene));
    const RectifiedRig& rig = renderer.scene().rig;
    Images images(rig.width, rig.height);
    claim_folder(options.out);

    const std::atomic<bool>& stop = stop_on_signals();
    pipeline::WorkerPool pool(static_cast<int>(std::max(1U, std::thread::hardware_concurrency())));
    io::write_file_whole(options.out / "calib.txt", calibration_text(rig));
    ordered_json summary = scene_json(renderer.scene(), options);
    std::int64_t frame = 0;
    for (; frame < frames && !stop.load(); ++frame) {
        renderer.render(frame, pool, images.left, images.left_bgr, images.right);
        renderer.render_truth(frame, pool, options.tolerance_m, images.truth);
        images.encode();
        images.write(options.out, frame);
        summary["frames"].push_back(frame_json(renderer, frame));
        if ((frame + 1) % 10 == 0) fmt::print(stderr, "{} of {} frames\n", frame + 1, frames);
    }
    io::write_file_whole(options.out / "truth.json", summary.dump(1) + "\n");
    fmt::print("{} frame{} of '{}' with truth in {}\n", frame, frame == 1 ? "" : "s", renderer.scene().name,
               options.out.string());
    return static_cast<int>(frame == frames ? ExitStatus::kDone : ExitStatus::kInterrupted);
}

}  // namespace groundline::cli
