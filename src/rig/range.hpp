// Disparity and metres: depth, its deviation, and how near and how far a rig can see.
#pragma once

#include "core/rectified_rig.hpp"

namespace groundline::rig {

// All functions need a calibrated rig. Disparities are measured ones, u_L - u_R in px, offset included.

// Depth along the optical axis: Z = f b / (d - offset). Infinity where d - offset <= 0.
double depth_m(const RectifiedRig& rig, double disparity_px);
// Its inverse, for depth_m > 0.
double disparity_px(const RectifiedRig& rig, double depth_m);
// One sigma of depth from one sigma of disparity: Z^2 sigma_d / (f b), to first order.
double depth_sigma_m(const RectifiedRig& rig, double depth_m, double disparity_sigma_px);

// What the geometry allows before any picture is seen.
struct RangeLimits {
    double near_m = 0.0;  // depth at the largest disparity searched: nearer things are not matched
    double far_m = 0.0;   // depth at the smallest disparity searched; infinity where that reaches the horizon
    double tenth_m = 0.0;          // the depth at which a quarter pixel is 10 % of it
    double step_at_tenth_m = 0.0;  // depth between two disparity values (1/16 px) there
    double step_at_5_m = 0.0;      // the same at 5 m
};

// For the search range min_disparity .. min_disparity + disparities - 1.
RangeLimits range_limits(const RectifiedRig& rig, int min_disparity, int disparities);

// The search range where none is configured: `hint` (0: none), else a sixth of the width, rounded up to a
// multiple of 16, within 32 .. 256.
int auto_disparities(int width, int hint);

}  // namespace groundline::rig
