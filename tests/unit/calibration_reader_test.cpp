// Every calibration format: a sample as such files are, and what it means.
#include "io/calibration/calibration_reader.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "core/arena.hpp"
#include "rig/rectifier.hpp"
#include "unit/calibration_support.hpp"

namespace groundline::io {
namespace {

using rig::Lens;
using rig::StereoCalibration;
using test::changed;
using test::Folder;

// The sample of calibration_support.hpp in one file with R1 R2 P1 P2.
void expect_sample_stereo(const StereoCalibration& c) {
    EXPECT_EQ(c.left.fx, 534.5);
    EXPECT_EQ(c.left.fy, 535.25);
    EXPECT_EQ(c.left.cx, 322.5);
    EXPECT_EQ(c.left.cy, 241.0);
    EXPECT_EQ(c.left.lens, Lens::kPinhole);
    EXPECT_EQ(c.left.distortion, (std::array<double, 8>{-0.28, 0.095, 0.00125, -0.00065, 0.01}));
    EXPECT_EQ(c.right.fx, 537.5);
    EXPECT_EQ(c.right.distortion, (std::array<double, 8>{-0.29, 0.11, 0.001, 0.00025}));
    EXPECT_EQ(c.left.width, 640);
    EXPECT_EQ(c.right.height, 480);
    EXPECT_FALSE(c.rectified);
    EXPECT_EQ(c.rotation, rig::kIdentity3);
    EXPECT_EQ(c.translation_m, (rig::Vector3{-0.0832, 0, 0}));
    ASSERT_TRUE(c.rectification);
    EXPECT_EQ(c.rectification->projection_left[0], 520.0);
    EXPECT_EQ(c.rectification->projection_right[3], -43.264);
    EXPECT_EQ(c.disparities_hint, 0);
}

TEST(OpenCvFormat, OneYamlFile) {
    const Folder folder;
    const auto path = folder.write("stereo.yml", test::kOpenCvStereo);
    const StereoCalibration c = read_calibration({path}, 640, 480);
    expect_sample_stereo(c);
    EXPECT_EQ(c.source, path.string());
    EXPECT_EQ(c.format, "OpenCV stereo");
    // OpenCV before 3.2 wrote no "---".
    const auto old = folder.write("old.yml", changed(test::kOpenCvStereo, "---\n", ""));
    expect_sample_stereo(read_calibration({old}, 640, 480));
}

// What OpenCV itself writes, in each of its three syntaxes.
TEST(OpenCvFormat, AsOpenCvWritesIt) {
    const Folder folder;
    const cv::Matx33d eye = cv::Matx33d::eye();
    for (const char* name : {"stereo.yml", "stereo.yaml", "stereo.xml", "stereo.json"}) {
        const auto path = folder.path() / name;
        cv::FileStorage file(path.string(), cv::FileStorage::WRITE);
        file << "M1" << cv::Mat(cv::Matx33d(534.5, 0, 322.5, 0, 535.25, 241.0, 0, 0, 1));
        file << "D1" << cv::Mat(cv::Matx<double, 1, 5>(-0.28, 0.095, 0.00125, -0.00065, 0.01));
        file << "M2" << cv::Mat(cv::Matx33d(537.5, 0, 327.5, 0, 536.75, 249.5, 0, 0, 1));
        file << "D2" << cv::Mat(cv::Matx41d(-0.29, 0.11, 0.001, 0.00025));
        file << "image_size" << cv::Size(640, 480);
        file << "R" << cv::Mat(eye) << "T" << cv::Mat(cv::Matx31d(-0.0832, 0, 0));
        file << "R1" << cv::Mat(eye) << "R2" << cv::Mat(eye);
        file << "P1" << cv::Mat(cv::Matx34d(520, 0, 325, 0, 0, 520, 245, 0, 0, 0, 1, 0));
        file << "P2" << cv::Mat(cv::Matx34d(520, 0, 325, -43.264, 0, 520, 245, 0, 0, 0, 1, 0));
        file << "Q" << cv::Mat::eye(4, 4, CV_64F);
        file.release();
        SCOPED_TRACE(name);
        expect_sample_stereo(read_calibration({path}, 640, 480));
    }
}

TEST(OpenCvFormat, IntrinsicsAndExtrinsicsInEitherOrder) {
    const Folder folder;
    const auto intrinsics = folder.write("intrinsics.yml", test::kOpenCvIntrinsics);
    const auto extrinsics = folder.write("extrinsics.yml", test::kOpenCvExtrinsics);
    for (const bool swapped : {false, true}) {
        const StereoCalibration c = swapped ? read_calibration({extrinsics, intrinsics}, 640, 480)
                                            : read_calibration({intrinsics, extrinsics}, 640, 480);
        EXPECT_EQ(c.left.fx, 534.5);
        EXPECT_EQ(c.right.distortion,
                  (std::array<double, 8>{-0.29, 0.11, 0.001, 0.00025, 0, 0.5, 0.25, 0.125}));
        EXPECT_EQ(c.translation_m, (rig::Vector3{-0.0832, 0.00093, 0.00036}));
        EXPECT_FALSE(c.rectification);
        EXPECT_NE(c.source.find("intrinsics.yml"), std::string::npos);
        EXPECT_NE(c.source.find("extrinsics.yml"), std::string::npos);
    }
}

TEST(OpenCvFormat, UnderOtherCommonNames) {
    const Folder folder;
    // As ORB-SLAM's EuRoC settings: no R and T, they follow from the rectification.
    std::string text = test::kOpenCvStereo;
    for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
             {"cameraMatrix1", "LEFT.K"},
             {"distCoeffs1", "LEFT.D"},
             {"cameraMatrix2", "RIGHT.K"},
             {"distCoeffs2", "RIGHT.D"},
             {"imageSize: [ 640, 480 ]", "LEFT.width: 640\nLEFT.height: 480"},
             {"\nR1:", "\nLEFT.R:"},
             {"\nR2:", "\nRIGHT.R:"},
             {"\nP1:", "\nLEFT.P:"},
             {"\nP2:", "\nRIGHT.P:"}})
        text = changed(text, from, to);
    const std::size_t pose = text.find("R: !!opencv-matrix");
    text.erase(pose, text.find("LEFT.R:") - pose);
    const StereoCalibration c = read_calibration({folder.write("orb.yaml", text)}, 640, 480);
    EXPECT_EQ(c.left.fx, 534.5);
    EXPECT_NEAR(c.translation_m[0], -0.0832, 1e-12);
    EXPECT_EQ(c.rotation, rig::kIdentity3);
    // K1 D1 and plain lists instead of matrices with rows and columns.
    const StereoCalibration plain =
        read_calibration({folder.write("plain.yaml",
                                       "K1: [[534.5, 0, 322.5], [0, 535.25, 241], [0, 0, 1]]\n"
                                       "D1: [-0.28, 0.095, 0.00125, -0.00065]\n"
                                       "K2: [537.5, 0, 327.5, 0, 536.75, 249.5, 0, 0, 1]\n"
                                       "D2: [[-0.29, 0.11, 0.001, 0.00025]]\n"
                                       "R: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nT: [-0.0832, 0, 0]\n")},
                         640, 480);
    EXPECT_EQ(plain.left.fy, 535.25);
    EXPECT_EQ(plain.left.width, 0);
    EXPECT_EQ(plain.right.distortion[3], 0.00025);
    EXPECT_EQ(plain.translation_m[0], -0.0832);
}

TEST(OpenCvFormat, FisheyeIsSaidInTheFile) {
    const Folder folder;
    std::string text = changed(test::kOpenCvStereo, "imageSize", "distortion_model: fisheye\nimageSize");
    text = changed(text, "rows: 5\n   cols: 1\n   dt: d\n   data: [ -0.28, 0.095, 0.00125, -0.00065, 0.01 ]",
                   "rows: 4\n   cols: 1\n   dt: d\n   data: [ -0.02, 0.01, 0.002, -0.001 ]");
    const StereoCalibration c = read_calibration({folder.write("fisheye.yml", text)}, 640, 480);
    EXPECT_EQ(c.left.lens, Lens::kEquidistant);
    EXPECT_EQ(c.right.lens, Lens::kEquidistant);
    EXPECT_EQ(c.left.distortion, (std::array<double, 8>{-0.02, 0.01, 0.002, -0.001}));
}

TEST(RosFormat, PairOfCameraInfo) {
    const Folder folder;
    const StereoCalibration c = read_calibration(
        {folder.write("left.yaml", test::kRosLeft), folder.write("right.yaml", test::kRosRight)}, 752, 480);
    EXPECT_EQ(c.format, "ROS camera_info");
    EXPECT_EQ(c.left.fx, 461.5);
    EXPECT_EQ(c.left.width, 752);
    EXPECT_EQ(c.left.distortion, (std::array<double, 8>{-0.27, 0.06, 0.0002, 0.0001, 0}));
    ASSERT_TRUE(c.rectification);
    EXPECT_NEAR(c.translation_m[0], -47.982 / 436.2, 1e-12);
    Arena arena;
    const rig::Rectifier rectifier(c, 752, 480, arena);
    EXPECT_EQ(rectifier.rig().focal_px, 436.2);
    EXPECT_NEAR(rectifier.rig().baseline_m, 0.11, 1e-12);
    EXPECT_EQ(rectifier.rig().cx_px, 364.4);
}

TEST(KalibrFormat, Camchain) {
    const Folder folder;
    const StereoCalibration c = read_calibration({folder.write("camchain.yaml", test::kKalibr)}, 1024, 1024);
    EXPECT_EQ(c.format, "Kalibr camchain");
    EXPECT_EQ(c.left.lens, Lens::kEquidistant);
    EXPECT_EQ(c.left.fx, 380.81);
    EXPECT_EQ(c.left.cy, 514.33);
    EXPECT_EQ(c.left.height, 1024);
    EXPECT_EQ(c.right.distortion, (std::array<double, 8>{-0.0120, 0.0180, -0.0110, 0.0020}));
    EXPECT_EQ(c.translation_m, (rig::Vector3{-0.1009, 0.0019, 0.0012}));
    EXPECT_EQ(c.rotation, rig::kIdentity3);
}

TEST(KalibrFormat, Radtan) {
    const Folder folder;
    std::string text = changed(test::kKalibr, "equidistant", "radtan");
    const StereoCalibration c = read_calibration({folder.write("camchain.yaml", text)}, 1024, 1024);
    EXPECT_EQ(c.left.lens, Lens::kPinhole);
    EXPECT_EQ(c.right.lens, Lens::kEquidistant);
}

TEST(EurocFormat, PairOfSensorYaml) {
    const Folder folder;
    const StereoCalibration c = read_calibration({folder.write("cam0/sensor.yaml", test::kEurocLeft),
                                                  folder.write("cam1/sensor.yaml", test::kEurocRight)},
                                                 752, 480);
    EXPECT_EQ(c.format, "EuRoC sensor.yaml");
    EXPECT_EQ(c.left.fx, 458.654);
    EXPECT_EQ(c.right.cx, 379.999);
    EXPECT_EQ(c.right.distortion[2], -0.00010473);
    // Published for this rig: baseline 0.11008 m, right camera to the right.
    EXPECT_NEAR(rig::norm(c.translation_m), 0.11008, 1e-5);
    EXPECT_NEAR(c.translation_m[0], -0.11007, 2e-5);
    // A body point through both T_BS must land where rotation and translation say: the body origin.
    const rig::Vector3 left_origin = {0.0, 0.0, 0.0};
    const rig::Vector3 seen = rig::operator*(c.rotation, left_origin);
    EXPECT_EQ(seen, left_origin);
    EXPECT_TRUE(rig::is_rotation(c.rotation));
    EXPECT_NEAR(c.rotation[0], 0.9999972, 1e-5);
}

TEST(KittiFormat, GreyPairByDefaultColourPairOnRequest) {
    const Folder folder;
    const auto path = folder.write("calib.txt", test::kKitti);
    const StereoCalibration grey = read_calibration({path}, 1242, 375);
    EXPECT_TRUE(grey.rectified);
    EXPECT_EQ(grey.format, "KITTI");
    EXPECT_EQ(grey.left.fx, 721.5377);
    EXPECT_EQ(grey.left.cx, 609.5593);
    EXPECT_EQ(grey.left.cy, 172.854);
    EXPECT_NEAR(-grey.translation_m[0], 387.5744 / 721.5377, 1e-15);
    const StereoCalibration colour = read_calibration({path}, 1242, 375, true);
    EXPECT_NEAR(-colour.translation_m[0], (44.85728 + 339.5242) / 721.5377, 1e-15);
}

TEST(KittiFormat, ColourFolderWithTheFirstPairOnly) {
    const Folder folder;
    const std::string text = test::kKitti.substr(0, test::kKitti.find("P2:"));
    const StereoCalibration c = read_calibration({folder.write("calib.txt", text)}, 1242, 375, true);
    EXPECT_NEAR(-c.translation_m[0], 0.5371506, 1e-6);
}

TEST(KittiFormat, PrincipalPointsMayDiffer) {
    const Folder folder;
    const StereoCalibration c =
        read_calibration({folder.write("calib.txt",
                                       "P0: 994.978 0 311.193 0 0 994.978 254.877 0 0 0 1 0\n"
                                       "P1: 994.978 0 342.279 -192.031749 0 994.978 254.877 0 0 0 1 0\n")},
                         741, 500);
    Arena arena;
    const rig::Rectifier rectifier(c, 741, 500, arena);
    EXPECT_TRUE(rectifier.identity());
    EXPECT_NEAR(rectifier.rig().offset_px(), -31.086, 1e-9);
    EXPECT_NEAR(rectifier.rig().baseline_m, 0.193001, 1e-9);
}

TEST(KittiFormat, RawCamToCam) {
    const Folder folder;
    const auto path = folder.write("calib_cam_to_cam.txt", test::kKittiRaw);
    const StereoCalibration grey = read_calibration({path}, 1242, 375);
    EXPECT_EQ(grey.left.width, 1242);
    EXPECT_EQ(grey.right.height, 375);
    EXPECT_NEAR(-grey.translation_m[0], 387.5744 / 721.5377, 1e-15);
    EXPECT_NEAR(-read_calibration({path}, 1242, 375, true).translation_m[0], 384.38148 / 721.5377, 1e-12);
}

TEST(MiddleburyFormat, DoffsAndMillimetres) {
    const Folder folder;
    const StereoCalibration c = read_calibration({folder.write("calib.txt", test::kMiddlebury)}, 741, 497);
    EXPECT_TRUE(c.rectified);
    EXPECT_EQ(c.format, "Middlebury");
    EXPECT_EQ(c.left.fx, 994.978);
    EXPECT_EQ(c.right.cx, 342.279);
    EXPECT_EQ(c.left.width, 741);
    EXPECT_EQ(c.right.height, 497);
    EXPECT_NEAR(-c.translation_m[0], 0.193001, 1e-15);
    EXPECT_EQ(c.disparities_hint, 70);
    Arena arena;
    // Z = f b / (d + doffs)
    EXPECT_NEAR(rig::Rectifier(c, 741, 497, arena).rig().offset_px(), -31.086, 1e-9);
}

TEST(TextFormats, WindowsLineEndsAndCommentsAreFine) {
    const Folder folder;
    for (const auto& [name, sample] :
         {std::pair{"kitti.txt", test::kKitti}, std::pair{"mb.txt", test::kMiddlebury}}) {
        std::string text = "# made by hand\r\n\r\n";
        for (const char c : sample)
            text += c == '\n' ? std::string("\r\n") : std::string(1, c);
        const bool middlebury = std::string(name) == "mb.txt";
        const auto path = folder.write(name, text);
        EXPECT_GT(read_calibration({path}, middlebury ? 741 : 1242, middlebury ? 497 : 375).left.fx, 0.0);
    }
}

}  // namespace
}  // namespace groundline::io
