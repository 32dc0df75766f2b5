// How the left camera hangs against gravity, as another sensor of the robot says: an input of a frame.
#pragma once

namespace groundline {

// At the exposure of the frame. Signs as GroundPose: pitch positive nose down, roll positive when the plumb
// line leans to the right of the image. Part of what a replay must be given again.
struct AttitudeInput {
    bool valid = false;
    double pitch_rad = 0.0;
    double roll_rad = 0.0;
    double sigma_rad = 0.0;  // one standard deviation of either
};

}  // namespace groundline
