// vm_frames SCENE COUNT FOLDER: a rendered drive as pictures for the loopback cameras, numbered where a body
// mask hides it.
//
// FOLDER gets left/ and right/ with one 8-bit PGM a frame, jpeg/left/ and jpeg/right/ with the same as JPEG,
// and calib.txt (KITTI's form). The frame's number stands in the upper left corner of both views: eight
// squares of 16 px, white for 1, lowest bit first; so it survives JPEG and shrinking, and whoever sees any
// picture of it knows which frame it was.
#include <fmt/format.h>

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "capture/open.hpp"
#include "core/arena.hpp"
#include "core/error.hpp"
#include "io/atomic_file.hpp"

namespace {

namespace fs = std::filesystem;
using namespace groundline;

constexpr int kBits = 8;
constexpr int kSquarePx = 16;

void number(Luma picture, int frame) {
    for (int v = 0; v < kSquarePx; ++v)
        for (int u = 0; u < kBits * kSquarePx; ++u)
            picture.at(u, v) = (frame >> (u / kSquarePx) & 1) != 0 ? 255 : 0;
}

void write(const fs::path& folder, const char* view, int frame, ConstLuma picture) {
    std::string pgm = fmt::format("P5\n{} {}\n255\n", picture.width, picture.height);
    for (int v = 0; v < picture.height; ++v)
        for (int u = 0; u < picture.width; ++u)
            pgm += static_cast<char>(picture.at(u, v));
    io::write_file_whole(folder / view / fmt::format("{:03}.pgm", frame), pgm);
    // OpenCV's matrix has no const form; it is only read.
    const cv::Mat matrix(picture.height, picture.width, CV_8UC1, const_cast<std::uint8_t*>(picture.data),
                         static_cast<std::size_t>(picture.stride));
    if (!cv::imwrite(folder / "jpeg" / view / fmt::format("{:03}.jpg", frame), matrix))
        throw Refusal(ExitStatus::kFailed, "a JPEG cannot be written");
}

// Rectified as rendered: P0 and P1 with baseline = (P0[3] - P1[3]) / f.
std::string calibration(const RectifiedRig& rig) {
    const auto row = [&](const char* name, double cx, double shift) {
        return fmt::format("{}: {} 0 {} {} 0 {} {} 0 0 0 1 0\n", name, rig.focal_px, cx, shift, rig.focal_px,
                           rig.cy_px);
    };
    return row("P0", rig.cx_px, 0.0) + row("P1", rig.cx_right_px, -rig.focal_px * rig.baseline_m);
}

void run(const std::string& scene, int count, const fs::path& folder) {
    const capture::OpenedSource opened = capture::open_source({"synthetic:" + scene});
    const SourceInfo& info = opened.source->info();
    Arena arena;
    StereoFrame pair = StereoFrame::make(arena, info.width, info.height, info.colour);
    for (const char* view : {"left", "right", "jpeg/left", "jpeg/right"})
        fs::create_directories(folder / view);
    for (int frame = 0; frame < count && opened.source->next(pair) == Pull::kFrame; ++frame) {
        number(pair.left, frame);
        number(pair.right, frame);
        write(folder, "left", frame, pair.left);
        write(folder, "right", frame, pair.right);
    }
    io::write_file_whole(folder / "calib.txt", calibration(*opened.rig));
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) return static_cast<int>(ExitStatus::kUsage);
    try {
        run(argv[1], std::stoi(argv[2]), argv[3]);
    } catch (const std::exception& failure) {
        fmt::print(stderr, "vm_frames: {}\n", failure.what());
        return 1;
    }
    return 0;
}
