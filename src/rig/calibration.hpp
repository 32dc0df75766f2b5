// What a calibration says about the two cameras, whatever file it came from.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "rig/matrix3.hpp"

namespace groundline::rig {

enum class Lens : std::uint8_t {
    kPinhole,      // k1 k2 p1 p2 k3 k4 k5 k6: OpenCV's polynomial and rational model (plumb_bob, radtan)
    kEquidistant,  // k1 k2 k3 k4: OpenCV's fisheye, Kalibr's equidistant
};

// One camera as it delivers pictures. Pixel centres are whole numbers; all lengths in px.
struct CameraModel {
    using Lens = rig::Lens;
    int width = 0;  // 0: the file does not say
    int height = 0;
    double fx = 0.0;
    double fy = 0.0;
    double cx = 0.0;
    double cy = 0.0;
    Lens lens = Lens::kPinhole;
    std::array<double, 8> distortion{};
};

// A rectification computed by another program: rotations from the camera frames into the common frame, and
// the 3x4 projections of the common frame (row-major; fourth column in px times metres).
struct GivenRectification {
    Matrix3 rotation_left = kIdentity3;
    Matrix3 rotation_right = kIdentity3;
    std::array<double, 12> projection_left{};
    std::array<double, 12> projection_right{};
};

struct StereoCalibration {
    CameraModel left;
    CameraModel right;
    // The pictures are rectified already: fx, fy, cx, cy are those of the rectified views, lens and rotation
    // mean nothing, and the baseline is -translation_m[0].
    bool rectified = false;
    // A point X of the left camera frame is rotation * X + translation_m in the right one (x right, y down,
    // z forward), so translation_m[0] is negative where the right camera stands to the right.
    Matrix3 rotation = kIdentity3;
    Vector3 translation_m{};
    std::optional<GivenRectification> rectification;
    std::string source;        // file names, for messages
    std::string format;        // what kind of file, for messages
    int disparities_hint = 0;  // Middlebury's ndisp; 0: none
};

// Orthonormal and right-handed within what files round to (0.002 in each element).
bool is_rotation(const Matrix3& matrix);

// Throws Refusal(kConfig), naming calibration.source, unless pictures of width x height can be rectified with
// it: the size agrees (or, where the file gives none, each principal point lies within a quarter of the width
// from the middle), everything is finite, focal lengths are positive, rotations are rotations, the cameras
// look the same way and stand side by side with the right one on the right, 1 mm to 5 m apart, and a given
// rectification belongs to rotation and translation.
void require_usable(const StereoCalibration& calibration, int width, int height);

}  // namespace groundline::rig
