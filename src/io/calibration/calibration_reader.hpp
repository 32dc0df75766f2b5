// Reads stereo calibrations: every format that calibrators and data sets commonly write.
#pragma once

#include <filesystem>
#include <vector>

#include "rig/calibration.hpp"

namespace groundline::io {

// One file, or two where a format keeps the cameras (left first) or intrinsics and extrinsics apart. Content
// decides the format: OpenCV stereo YAML, XML or JSON; ROS camera_info pair; Kalibr camchain; EuRoC
// sensor.yaml pair; KITTI P0/P1, P2/P3 or P_rect_0x; Middlebury. `width` and `height` are those of the
// pictures. `colour_pair`: prefer KITTI's colour cameras (2 and 3) where the file has both pairs. Throws
// Refusal: kInput where a file cannot be read, kConfig naming file, line and what was expected where the
// content is malformed or does not fit the pictures (rig::require_usable). For start-up.
rig::StereoCalibration read_calibration(const std::vector<std::filesystem::path>& files, int width,
                                        int height, bool colour_pair = false);

// The calibration that belongs to a source folder: calibration.yaml, else calib.txt, else the place of the
// data set's own (KITTI calib_cam_to_cam.txt there or up to two folders higher; ROS left.yaml and right.yaml;
// EuRoC sensor.yaml of cam0 and cam1; Kalibr camchain.yaml; intrinsics.yml and extrinsics.yml). Half a pair
// is returned too, so that reading it tells what is missing. Empty if there is none.
std::vector<std::filesystem::path> find_calibration(const std::filesystem::path& source_folder);

}  // namespace groundline::io
