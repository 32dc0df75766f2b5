// What the operator can say about terrain and mount, and what else the room needs to be told.
#pragma once

#include <cstdint>

namespace groundline::terrain {

// The paper's strip of constant offset about the ground line, as a compatibility mode: its "50" has no unit,
// so each reading has a name. A strip tolerates heights that grow with range; kOff is the exact wedge.
enum class Band : std::uint8_t {
    kOff,
    k50Rows,        // 50 image rows along v: 50 dv px of disparity
    k50Px,          // 50 px of disparity
    k50Disparity8,  // 50 grey levels of a disparity image stretched to 0..255: 50/256 of the search range
};

// How one line is chosen among the Hough peaks.
enum class LineMode : std::uint8_t {
    kVotes,    // most votes inside the gate: 0.13 deg of pitch error in clutter
    kLongest,  // the paper's longest segment: 1.4 deg in the same clutter
};

// Which poses are possible. Defaults hold for any robot that looks ahead; a known mount narrows them.
struct Gate {
    double height_min_m = 0.2;
    double height_max_m = 2.5;
    double pitch_min_deg = -5.0;  // nose down is positive
    double pitch_max_deg = 40.0;
    double roll_deg = 0.0;       // middle of the roll gate
    double roll_max_deg = 12.0;  // either side of it
};

// Gate about a measured mount: 8 deg of pitch and roll (suspension and slopes), 30 % of height.
constexpr Gate gate_of_mount(double height_m, double pitch_deg, double roll_deg) {
    return {0.7 * height_m, 1.3 * height_m, pitch_deg - 8.0, pitch_deg + 8.0, roll_deg, 8.0};
}

struct TerrainConfig {
    double tolerance_up_m = 0.20;      // what the robot drives over
    double tolerance_down_m = 0.20;    // what it may fall
    double tolerance_ratio = 0.15;     // of the camera height, up and down, where the rig is not calibrated
    double clearance_m = 2.0;          // what hangs wholly above this lets the robot pass
    double stopping_distance_m = 2.0;  // what must be known to drive on; for those who judge sectors
    Band band = Band::kOff;
    LineMode line = LineMode::kVotes;
    Gate gate;  // used as it is: whoever knows the mount sets gate_of_mount(...) here

    bool mount_known = false;  // height, pitch and roll below were measured
    double mount_height_m = 0.0;
    double mount_pitch_deg = 0.0;
    double mount_roll_deg = 0.0;
    // The camera in the body frame (x forward, y left); yaw positive to the left. Sectors are about the
    // body's origin.
    double mount_x_m = 0.0;
    double mount_y_m = 0.0;
    double mount_yaw_deg = 0.0;
    int sectors = 32;  // 1..kMaxSectors; 32 over 80 deg are 2.5 deg each, a person at 15 m

    // What was seen in a sector is held until it was absent in so many of so many frames. 1 <= frames <=
    // window
    // <= 32; frames = 1 holds nothing.
    int clear_frames = 2;
    int clear_window = 3;

    // One sigma of a valid pixel's disparity: 0.25 px is what sub-pixel matching reaches on real pictures,
    // integer disparities have 0.3 px from rounding alone.
    double sigma_disparity_px = 0.25;
    // Sigmas of height a pixel must differ from the ground to be told from it.
    double sigmas = 3.0;
    // Least visible area of a thing: 0.1 m x 0.1 m of which 30 % matched.
    double min_area_m2 = 0.003;
    // Unmatched gaps up to twice this many px inside obstacles are obstacle: leaves, mesh and shadow leave
    // them.
    int gap_px = 8;
    // Ground nearer than this to a drop, or beside an obstacle, is unknown: the windows that match it see
    // both.
    int blur_px = 4;
    // The same beyond an obstacle, up the picture: its upper edge is often matched as the ground far behind,
    // and of obstacles called free most lie there.
    int blur_beyond_px = 8;
    // Fewest pixels of a thing at any range; chance clusters of 5 % outliers stay below 8.
    int min_pixels = 12;
    // The same beyond half the certified range, where a false match of a patch of ground at the horizon
    // stands up: on empty ground such patches have 12 to 38 px. A box of 0.3 m has 56 at 20 m (f = 500 px).
    int min_pixels_far = 40;

    // Takes over what may change between two frames: tolerances, clearance and stopping distance. No memory
    // and no map depends on them.
    constexpr void tune(const TerrainConfig& to) {
        tolerance_up_m = to.tolerance_up_m;
        tolerance_down_m = to.tolerance_down_m;
        tolerance_ratio = to.tolerance_ratio;
        clearance_m = to.clearance_m;
        stopping_distance_m = to.stopping_distance_m;
    }
};

}  // namespace groundline::terrain
