#include "synth/scene.hpp"

#include "core/deterministic_math.hpp"

namespace groundline::synth {

CameraPose camera_at(const Scene& scene, std::int64_t frame) {
    const double seconds = static_cast<double>(frame) / scene.rate_hz;
    CameraPose camera{scene.mount, scene.speed_mps * seconds};
    if (scene.sway > 0.0) {
        // Three periods without a common multiple, so that pitch, roll and height go through all phases.
        const double turn = 2.0 * det::kPi * seconds;
        camera.pose.pitch_rad += scene.sway * det::radians(0.8) * det::sin(turn / 1.9);
        camera.pose.roll_rad += scene.sway * det::radians(1.2) * det::sin(turn / 2.7);
        camera.pose.height_m += scene.sway * 0.01 * det::sin(turn / 1.3);
    }
    return camera;
}

}  // namespace groundline::synth
