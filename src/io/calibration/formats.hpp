// One reader for each calibration format; which one is used is decided in calibration_reader.cpp.
#pragma once

#include <string>
#include <vector>

#include "io/calibration/source_text.hpp"
#include "io/calibration/yaml_field.hpp"
#include "rig/calibration.hpp"

namespace groundline::io {

// All throw Refusal(kConfig) with file and line. They fill everything but `source` and leave what can be
// judged without the file, such as the baseline, to rig::require_usable().

// M1 D1 M2 D2 R T and perhaps R1 R2 P1 P2, under the names in common use, in one file or two. Metres.
rig::StereoCalibration read_opencv(const std::vector<YamlField>& files);
bool looks_like_opencv(const YamlField& file);

// camera_info of the left and of the right camera; the baseline is -P[0,3]/fx of the right one.
rig::StereoCalibration read_ros_pair(const YamlField& left, const YamlField& right);

// cam0 and cam1 with T_cn_cnm1, as Kalibr writes them.
rig::StereoCalibration read_kalibr(const YamlField& chain);

// sensor.yaml of cam0 and of cam1, with T_BS (from the camera to the body).
rig::StereoCalibration read_euroc_pair(const YamlField& left, const YamlField& right);

// P0 P1 or P2 P3, or P_rect_00 P_rect_01 or P_rect_02 P_rect_03. Rectified.
rig::StereoCalibration read_kitti(const SourceText& file, bool colour_pair);
bool looks_like_kitti(const SourceText& file);

// cam0=[..] cam1=[..] doffs= baseline= (mm) width= height= ndisp=. Rectified.
rig::StereoCalibration read_middlebury(const SourceText& file);
bool looks_like_middlebury(const SourceText& file);

// Parts that formats share.
// fx, fy, cx, cy from a 3 x 3 matrix.
void set_matrix(rig::CameraModel& camera, const YamlField& field);
// Lens and distortion: `model` under any of its usual names, coefficients in OpenCV's order.
void set_lens(rig::CameraModel& camera, const std::string& model, const YamlField& coefficients);
// Rotation and translation between the cameras as a given rectification implies them. The left projection's
// focal length is positive.
void set_pose_from_rectification(rig::StereoCalibration& calibration, const rig::GivenRectification& given);

}  // namespace groundline::io
