// The rectified pair's geometry: what turns disparity into metres.
#pragma once

#include "core/image.hpp"

namespace groundline {

// Both views after rectification: same focal length, same rows. Measured disparity u_L - u_R of a point at
// depth Z is f b / Z + offset(), offset = cx - cx_right: 0 for most rigs, not for Middlebury's.
// Without calibration only the size is known and `calibrated` is false; f, c and b must not be used then.
struct RectifiedRig {
    int width = 0;
    int height = 0;
    bool calibrated = false;
    double focal_px = 0.0;
    double cx_px = 0.0;
    double cy_px = 0.0;
    double cx_right_px = 0.0;
    double baseline_m = 0.0;

    double offset_px() const { return cx_px - cx_right_px; }
};

}  // namespace groundline
