// What a rendered scene consists of: the rig, the way it moves, the ground, what stands on it, the light.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "core/fixed_vector.hpp"
#include "core/ground.hpp"
#include "core/rectified_rig.hpp"

namespace groundline::synth {

// World axes in metres: x right, y down, z forward along the drive; y = 0 is the mean ground plane, so that
// height above the ground is -y.

// One sinusoidal undulation of the ground, its crests across the heading (0 = straight ahead).
struct Wave {
    double amplitude_m = 0.0;
    double length_m = 4.0;
    double heading_rad = 0.0;
    double phase_rad = 0.0;
};

// The ground lies depth_m lower for near_m <= z < far_m, between upright sides, across the whole width.
// Without an end it is a step down.
struct Trench {
    double near_m = 0.0;
    double far_m = std::numeric_limits<double>::infinity();
    double depth_m = 0.0;
};

// A wall across the view, from below the ground up to height_m.
struct Wall {
    double z_m = 0.0;
    double height_m = 0.0;
};

using Colour = std::array<double, 3>;  // blue, green, red in grey levels under full light

enum class Shape : std::uint8_t { kBox, kPole, kRock };

// Something that stands on the ground at (x_m, z_m); its foot goes on below the ground. A pole is an upright
// cylinder of radius half_x_m, a rock the upper half of an ellipsoid with half axes half_x, height, half_z.
struct Thing {
    Shape shape = Shape::kBox;
    double x_m = 0.0;
    double z_m = 0.0;
    double yaw_rad = 0.0;
    double half_x_m = 0.0;
    double half_z_m = 0.0;
    double height_m = 0.0;
    Colour colour{};
};

// The right image is gain * luma + offset; noise is added to both views, independently, after that.
struct Photometric {
    double right_gain = 1.0;
    double right_offset = 0.0;
    double noise_sigma = 0.0;   // grey levels
    double exposure = 1.0;      // brightness of everything; above 1.5 or so the ground saturates
    double sky_exposure = 1.0;  // of the sky alone
};

// Where the camera is and how it looks: the pose is against the mean ground plane.
struct CameraPose {
    GroundPose pose;
    double forward_m = 0.0;  // world z
};

struct Scene {
    std::string name;
    RectifiedRig rig;
    std::int64_t frames = 1;
    double rate_hz = 10.0;
    std::uint32_t seed = 1;

    GroundPose mount;  // pose at rest
    double speed_mps = 0.0;
    double sway = 0.0;  // 1: pitch +-0.8 deg, roll +-1.2 deg, height +-1 cm while driving

    FixedVector<Wave, 3> waves;
    std::vector<Trench> trenches;  // ordered along z, apart from each other
    double trench_period_m = 0.0;  // above 0: the trenches come again with this distance
    double wall_z_m = 0.0;         // 0: no wall
    double wall_height_m = 2.5;
    std::vector<Thing> things;
    bool strewn = false;  // boxes, poles and rocks without end along the drive, its path kept clear

    double contrast = 1.0;  // of the texture
    Photometric photometric;
};

// The scene that NAME[?key=value[&key=value...]] describes; a leading "synthetic:" is allowed.
// Throws Refusal(kUsage) for an unknown name or key (naming the nearest one and all there are), a value that
// is no number, a value out of its range, or a key given twice.
Scene scene_by_name(std::string_view spec);
// All names and keys with their meaning and range, one per line: the help text.
std::string scene_help();

// Camera of one frame, from 0; frames beyond scene.frames continue the drive.
CameraPose camera_at(const Scene& scene, std::int64_t frame);

}  // namespace groundline::synth
