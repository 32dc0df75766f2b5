// A folder of its own for each test, and one good file of every calibration format.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace groundline::io::test {

namespace fs = std::filesystem;

class Folder {
  public:
    Folder() {
        const testing::TestInfo* test = testing::UnitTest::GetInstance()->current_test_info();
        std::string name = std::string("groundline_") + test->test_suite_name() + "_" + test->name();
        for (char& c : name)
            if (c == '/') c = '_';
        path_ = fs::path(testing::TempDir()) / name;
        fs::remove_all(path_);
        fs::create_directories(path_);
    }
    ~Folder() {
        std::error_code ignored;
        fs::remove_all(path_, ignored);
    }
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;

    const fs::path& path() const { return path_; }
    // Writes `text` to `name`, whose folders are made.
    fs::path write(const std::string& name, const std::string& text) const {
        fs::create_directories((path_ / name).parent_path());
        std::ofstream(path_ / name, std::ios::binary) << text;
        return path_ / name;
    }

  private:
    fs::path path_;
};

// `text` with its first `from` replaced by `to`; `from` must be there.
inline std::string changed(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << "the sample has no " << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

inline const std::string kOpenCvIntrinsics = R"(%YAML:1.0
---
image_width: 640
image_height: 480
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 534.5, 0., 322.5, 0., 535.25, 241., 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -2.8e-01, 9.5e-02, 1.25e-03, -6.5e-04, 0.01 ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 537.5, 0., 327.5, 0., 536.75, 249.5, 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 1
   cols: 8
   dt: d
   data: [ -0.29, 0.11, 1.0e-03, 2.5e-04, 0., 0.5, 0.25,
       0.125 ]
)";
inline const std::string kOpenCvExtrinsics = R"(%YAML:1.0
---
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -8.32e-02, 9.3e-04, 3.6e-04 ]
)";
// Both in one file, with the rectification that belongs to it.
inline const std::string kOpenCvStereo = R"(%YAML:1.0
---
cameraMatrix1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 534.5, 0., 322.5, 0., 535.25, 241., 0., 0., 1. ]
distCoeffs1: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.28, 0.095, 0.00125, -0.00065, 0.01 ]
cameraMatrix2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 537.5, 0., 327.5, 0., 536.75, 249.5, 0., 0., 1. ]
distCoeffs2: !!opencv-matrix
   rows: 1
   cols: 4
   dt: d
   data: [ -0.29, 0.11, 0.001, 0.00025 ]
imageSize: [ 640, 480 ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -0.0832, 0., 0. ]
R1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
R2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
P1: !!opencv-matrix
   rows: 3
   cols: 4
   dt: d
   data: [ 520., 0., 325., 0., 0., 520., 245., 0., 0., 0., 1., 0. ]
P2: !!opencv-matrix
   rows: 3
   cols: 4
   dt: d
   data: [ 520., 0., 325., -43.264, 0., 520., 245., 0., 0., 0., 1., 0. ]
)";

inline const std::string kRosLeft = R"(image_width: 752
image_height: 480
camera_name: left
camera_matrix:
  rows: 3
  cols: 3
  data: [461.5, 0, 363.0, 0, 460.0, 248.1, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.27, 0.06, 0.0002, 0.0001, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [436.2, 0, 364.4, 0, 0, 436.2, 256.9, 0, 0, 0, 1, 0]
)";
inline const std::string kRosRight = changed(changed(kRosLeft, "camera_name: left", "camera_name: right"),
                                             "364.4, 0, 0, 436.2", "364.4, -47.982, 0, 436.2");

inline const std::string kKalibr = R"(cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.0138, 0.0209, -0.0128, 0.0025]
  distortion_model: equidistant
  intrinsics: [380.81, 380.81, 510.29, 514.33]
  resolution: [1024, 1024]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.1009]
  - [0.0, 1.0, 0.0, 0.0019]
  - [0.0, 0.0, 1.0, 0.0012]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [-0.0120, 0.0180, -0.0110, 0.0020]
  distortion_model: equidistant
  intrinsics: [379.26, 379.25, 505.57, 509.91]
  resolution: [1024, 1024]
  rostopic: /cam1/image_raw
)";

// The figures of the EuRoC data set's own rig: 11.0 cm baseline.
inline const std::string kEurocLeft = R"(# General sensor definitions.
sensor_type: camera
comment: VI-Sensor cam0 (MT9M034)
T_BS:
  cols: 4
  rows: 4
  data: [0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975,
         0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768,
        -0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
)";
inline const std::string kEurocRight = R"(sensor_type: camera
comment: VI-Sensor cam1 (MT9M034)
T_BS:
  cols: 4
  rows: 4
  data: [0.0125552670891, -0.999755099723, 0.0182237714554, -0.0198435579556,
         0.999598781151, 0.0130119051815, 0.0251588363115, 0.0453689425024,
        -0.0253898008918, 0.0179005838253, 0.999517347078, 0.00786212447038,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [457.587, 456.134, 379.999, 255.238] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28368365,  0.07451284, -0.00010473, -3.55590700e-05]
)";

inline const std::string kKitti = R"(P0: 7.215377e+02 0 6.095593e+02 0 0 7.215377e+02 1.728540e+02 0 0 0 1 0
P1: 7.215377e+02 0 6.095593e+02 -3.875744e+02 0 7.215377e+02 1.728540e+02 0 0 0 1 0
P2: 7.215377e+02 0 6.095593e+02 4.485728e+01 0 7.215377e+02 1.728540e+02 2.163791e-01 0 0 1 2.745884e-03
P3: 7.215377e+02 0 6.095593e+02 -3.395242e+02 0 7.215377e+02 1.728540e+02 2.199936e+00 0 0 1 2.729905e-03
R0_rect: 1 0 0 0 1 0 0 0 1
)";

inline const std::string kKittiRaw = R"(calib_time: 09-Jan-2012 13:57:47
corner_dist: 9.950000e-02
S_00: 1.392000e+03 5.120000e+02
K_00: 9.842439e+02 0 6.900000e+02 0 9.808141e+02 2.331966e+02 0 0 1
S_rect_00: 1.242000e+03 3.750000e+02
P_rect_00: 7.215377e+02 0 6.095593e+02 0 0 7.215377e+02 1.728540e+02 0 0 0 1 0
S_rect_01: 1.242000e+03 3.750000e+02
P_rect_01: 7.215377e+02 0 6.095593e+02 -3.875744e+02 0 7.215377e+02 1.728540e+02 0 0 0 1 0
S_rect_02: 1.242000e+03 3.750000e+02
P_rect_02: 7.215377e+02 0 6.095593e+02 4.485728e+01 0 7.215377e+02 1.728540e+02 2.163791e-01 0 0 1 2.745884e-03
S_rect_03: 1.242000e+03 3.750000e+02
P_rect_03: 7.215377e+02 0 6.095593e+02 -3.395242e+02 0 7.215377e+02 1.728540e+02 2.199936e+00 0 0 1 2.729905e-03
)";

inline const std::string kMiddlebury = R"(cam0=[994.978 0 311.193; 0 994.978 254.877; 0 0 1]
cam1=[994.978 0 342.279; 0 994.978 254.877; 0 0 1]
doffs=31.086
baseline=193.001
width=741
height=497
ndisp=70
isint=0
vmin=6
vmax=62
dyavg=0
dymax=0
)";

}  // namespace groundline::io::test
