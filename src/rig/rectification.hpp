// The common frame of a pair: two rotations and one pinhole geometry.
#pragma once

#include "core/rectified_rig.hpp"
#include "rig/calibration.hpp"

namespace groundline::rig {

// Both rectified views share focal length and rows; columns differ by the principal points.
struct Rectification {
    Matrix3 rotation_left = kIdentity3;  // from the left camera frame into the common frame
    Matrix3 rotation_right = kIdentity3;
    double fx = 0.0;
    double fy = 0.0;  // equal to fx unless a given rectification says otherwise
    double cx_left = 0.0;
    double cx_right = 0.0;
    double cy = 0.0;
    double baseline_m = 0.0;
};

// A given rectification is taken as it is. Otherwise: x along the baseline; z the mean of the two optical
// axes made perpendicular to it; one principal point for both views, so that infinity has disparity 0, placed
// to keep the middles of the two pictures about the middle; the smallest focal length (widest view) at which
// every rectified pixel has a source in both, but not below 0.4 of the mean source focal length: beyond that
// the middle would lose more than half its detail, so very wide lenses lose their rim instead.
// `calibration` is not rectified and has passed require_usable() for this size; throws Refusal(kConfig) where
// the pictures do not overlap. Deterministic arithmetic.
Rectification rectification_of(const StereoCalibration& calibration, int width, int height);

}  // namespace groundline::rig
