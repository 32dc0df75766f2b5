// Everything that can be wrong with a calibration file, what is said about it, and that nothing else happens.
#include <gtest/gtest.h>

#include <random>

#include "core/error.hpp"
#include "io/calibration/calibration_reader.hpp"
#include "unit/calibration_support.hpp"

namespace groundline::io {
namespace {

using test::changed;
using test::Folder;
using Paths = std::vector<std::filesystem::path>;

struct Complaint {
    ExitStatus status = ExitStatus::kDone;
    std::string text;
};

Complaint complaint(const Paths& files, int width, int height, bool colour_pair = false) {
    try {
        read_calibration(files, width, height, colour_pair);
    } catch (const Refusal& refusal) {
        return {refusal.status(), refusal.what()};
    }
    return {};
}

// One sentence that begins with the file, of status kConfig, and says `says`.
void expect_refused(const Paths& files, int width, int height, const std::string& says,
                    bool colour_pair = false) {
    const Complaint said = complaint(files, width, height, colour_pair);
    EXPECT_EQ(said.status, ExitStatus::kConfig) << "expected: " << says << "\nsaid: " << said.text;
    EXPECT_NE(said.text.find(says), std::string::npos) << "expected: " << says << "\nsaid: " << said.text;
    bool names_file = false;
    for (const auto& file : files)
        names_file = names_file || said.text.rfind(file.string(), 0) == 0;
    EXPECT_TRUE(names_file) << said.text;
    EXPECT_EQ(said.text.find('\n'), std::string::npos) << said.text;
}

struct Change {
    const char* from;
    const char* to;
    const char* says;
};

TEST(MalformedCalibration, Middlebury) {
    const Folder folder;
    for (const Change& change :
         {Change{"cam1=[994.978 0 342.279; 0 994.978 254.877; 0 0 1]\n", "", "cam1 is missing"},
          Change{"doffs=31.086\n", "", "doffs is missing"},
          Change{"baseline=193.001\n", "", "baseline is missing"},
          Change{"baseline=193.001", "baseline=0", "baseline is"},
          Change{"baseline=193.001", "baseline=nan", ":4: baseline: \"nan\" is not a finite number"},
          Change{"baseline=193.001", "baseline=193.001 mm", ":4: baseline: \"mm\""},
          Change{"baseline=193.001", "baseline=", ":4: baseline: has 0 numbers"},
          Change{"baseline=193.001", "baseline=193001", "at most 5 m"},
          Change{"baseline=193.001", "baseline=-193.001", "exchange"},
          Change{"[994.978 0 311.193;", "[994.978 0;", ":1: cam0: has 8 numbers, expected 9"},
          Change{"[994.978 0 311.193;", "[1e999 0 311.193;", ":1: cam0: \"1e999\""},
          Change{"[994.978 0 311.193;", "[0 0 311.193;", "focal length"},
          Change{"[994.978 0 311.193;", "[994.978 2 311.193;", ":1: cam0: expected [f 0 cx"},
          Change{"0 0 1]\ncam1", "0 0 1\ncam1", ":1: cam0: expected a matrix in square brackets"},
          Change{"width=741", "width=1482", "calibrated for pictures of 1482 x 497, but they are 741 x 497"},
          Change{"width=741", "width=741.5", ":5: width: 741.5 is not a number of pixels"},
          Change{"width=741", "width=-741", ":5: width:"},
          Change{"ndisp=70", "ndisp=many", ":7: ndisp: \"many\""},
          Change{"doffs=31.086", "doffs=3.1086", ":3: doffs: 3.1086 is not the difference"},
          Change{"isint=0", "isint", ":8: \"isint\" has no '='"},
          Change{"isint=0", "width=741", ":8: width was given in line 5 already"}})
        expect_refused({folder.write("calib.txt", changed(test::kMiddlebury, change.from, change.to))}, 741,
                       497, change.says);
}

TEST(MalformedCalibration, Kitti) {
    const Folder folder;
    const std::string p1 =
        "P1: 7.215377e+02 0 6.095593e+02 -3.875744e+02 0 7.215377e+02 1.728540e+02 0 0 0 1 0\n";
    for (const Change& change :
         {Change{p1.c_str(), "", "P1 is missing"},
          Change{p1.c_str(), "P1:\n", ":2: P1: has 0 numbers, expected 12"},
          Change{"0 0 0 1 0\nP1", "0 0 0 1\nP1", ":1: P0: has 11 numbers, expected 12"},
          Change{"P1: 7.215377e+02", "P1: nan", ":2: P1: \"nan\" is not a finite number"},
          Change{"P1: 7.215377e+02", "P1: 7.2153.77", ":2: P1: \"7.2153.77\""},
          Change{"P1: 7.215377e+02", "P1: 800", "focal lengths"},
          Change{"P0: 7.215377e+02", "P0: 0", ":1: P0: the focal length is 0"},
          Change{"P0: 7.215377e+02 0", "P0: 7.215377e+02 1", ":1: P0: is not the projection"},
          Change{"-3.875744e+02", "0", "baseline is 0 m"},
          Change{"-3.875744e+02", "-3.875744e+05", "at most 5 m"},
          Change{"-3.875744e+02", "3.875744e+02", "exchange"},
          Change{"-3.875744e+02 0 7.215377e+02 1.728540e+02 0", "0 0 7.215377e+02 1.728540e+02 -387",
                 ":2: P1: the cameras stand one above the other"},
          Change{"R0_rect: 1", "R0_rect 1", ":5: \"R0_rect 1"},
          Change{"P3:", "P0:", ":4: P0 was given in line 1 already"}})
        expect_refused({folder.write("calib.txt", changed(test::kKitti, change.from, change.to))}, 1242, 375,
                       change.says);
    const auto good = folder.write("calib.txt", test::kKitti);
    expect_refused({good}, 640, 480, "quarter of the width");
    expect_refused({good}, 2484, 750, "quarter of the width");
    const auto half = folder.write("half.txt", test::kKitti.substr(0, test::kKitti.find("P3:")));
    expect_refused({half}, 1242, 375, "P3 is missing", true);
    const auto raw = folder.write("raw.txt", test::kKittiRaw);
    expect_refused({raw}, 1392, 512, "calibrated for pictures of 1242 x 375, but they are 1392 x 512");
    expect_refused(
        {folder.write("raw2.txt", changed(test::kKittiRaw, "S_rect_00: 1.242000e+03", "S_rect_00:"))}, 1242,
        375, ":5: S_rect_00: has 1 numbers, expected 2");
}

TEST(MalformedCalibration, OpenCv) {
    const Folder folder;
    for (const Change& change :
         {Change{"cameraMatrix1", "cameraMatrixOne", "M1 (the left camera matrix) is missing"},
          Change{"distCoeffs2", "distCoeffsTwo", "D2 (the right distortion) is missing"},
          Change{"\nT: ", "\nTr: ",
                 "T (the translation from the left to the right camera, in metres) is missing"},
          Change{"\nP2: ", "\nPP: ", "some of R1 R2 P1 P2"},
          Change{"data: [ 534.5, 0.,", "data: [ 0.,",
                 "cameraMatrix1: says 3 x 3, but its data has 8 numbers"},
          Change{"data: [ 534.5, 0.,", "data: [ .Nan, 0.,",
                 "cameraMatrix1.data: \".Nan\" is not a finite number"},
          Change{"data: [ 534.5, 0.,", "data: [ 534.5, 3.,", "cameraMatrix1: is not of the form"},
          Change{"data: [ 534.5, 0.,", "data: [ -534.5, 0.,", "focal length"},
          Change{"data: [ 534.5, 0.,", "data: [ 534.5, 0.;", "\"0.; 322.5\" is not a finite number"},
          Change{"rows: 3\n   cols: 3", "rows: 9\n   cols: 1", ":3: cameraMatrix1: is 9 x 1, expected 3 x 3"},
          Change{"   rows: 3\n", "", "cameraMatrix1: \"rows\" is missing"},
          Change{"rows: 3\n", "rows: -3\n", "says -3 x 3"},
          Change{"rows: 3\n", "rows: 3000000000\n", "small whole number"},
          Change{"data: [ -0.0832, 0., 0. ]", "data: [ 0., 0., 0. ]", "baseline is 0 m"},
          Change{"data: [ -0.0832, 0., 0. ]", "data: [ -83.2, 0., 0. ]", "divide them by 1000"},
          Change{"data: [ -0.0832, 0., 0. ]", "data: [ 0., -0.0832, 0. ]", "one above the other"},
          Change{"data: [ -0.0832, 0., 0. ]", "data: [ -0.0832, 0. ]", "T: says 3 x 1, but its data has 2"},
          Change{"data: [ -0.0832, 0., 0. ]", "data: [ -0.1, 0., 0. ]", "0.0832 m in P2 but 0.1 m in T"},
          Change{"-43.264", "0.", "baseline is 0 m"},
          Change{"data: [ 1., 0., 0., 0., 1.", "data: [ 1., 0., 0., 0., 2.", "not a rotation matrix"},
          Change{"imageSize: [ 640, 480 ]", "imageSize: [ 1280, 960 ]", "but they are 640 x 480"},
          Change{"imageSize: [ 640, 480 ]", "imageSize: 640", "imageSize: expected a list"},
          Change{"imageSize: [ 640, 480 ]", "imageSize: [ 640, 480 ", "not readable as YAML"},
          Change{"imageSize: [ 640, 480 ]", "distortion_model: fov", "\"fov\" is not supported"},
          Change{"imageSize: [ 640, 480 ]", "distortion_model: equidistant",
                 "expected the 4 of an equidistant lens"},
          Change{"imageSize: [ 640, 480 ]", "M1: [ 1, 0, 0, 0, 1, 0, 0, 0, 1 ]", "given twice"}}) {
        expect_refused({folder.write("stereo.yml", changed(test::kOpenCvStereo, change.from, change.to))},
                       640, 480, change.says);
    }
    const auto intrinsics = folder.write("intrinsics.yml", test::kOpenCvIntrinsics);
    expect_refused({intrinsics}, 640, 480, "R (the rotation from the left to the right camera) is missing");
    expect_refused({intrinsics, intrinsics}, 640, 480, "given twice");
    expect_refused({folder.write("d7.yml", changed(test::kOpenCvIntrinsics,
                                                   "cols: 5\n   dt: d\n   data: [ -2.8e-01, 9.5e-02,",
                                                   "cols: 6\n   dt: d\n   data: [ 0., -2.8e-01, 9.5e-02,")),
                    folder.write("extrinsics.yml", test::kOpenCvExtrinsics)},
                   640, 480, "D1: has 6 numbers, expected 4, 5 or 8");
    expect_refused(
        {folder.write("t.yml",
                      changed(test::kOpenCvIntrinsics,
                              "cols: 5\n   dt: d\n   data: [ -2.8e-01, 9.5e-02, 1.25e-03, -6.5e-04, 0.01 ]",
                              "cols: 12\n   dt: d\n   data: [ 0, 0, 0, 0, 0, 0, 0, 0, 0.1, 0, 0, 0 ]")),
         folder.write("extrinsics.yml", test::kOpenCvExtrinsics)},
        640, 480, "thin-prism");
}

TEST(MalformedCalibration, OpenCvXml) {
    const Folder folder;
    expect_refused({folder.write("a.xml",
                                 "<?xml version=\"1.0\"?>\n<opencv_storage>\n<M1 type_id=\"opencv-matrix\">"
                                 "<rows>3</rows>")},
                   640, 480, ":3: not readable as XML");
    expect_refused({folder.write("b.xml", "<html><body>404</body></html>")}, 640, 480, "not OpenCV XML");
    expect_refused(
        {folder.write(
            "c.xml",
            "<?xml version=\"1.0\"?>\n<opencv_storage>\n<M1 type_id=\"opencv-matrix\"><rows>3</rows>"
            "<cols>3</cols><dt>d</dt><data>1 0 .Nan 0 1 1 0 0 1</data></M1>\n</opencv_storage>\n")},
        640, 480, "M1.data: \".Nan\" is not a finite number");
    expect_refused({folder.write("d.xml",
                                 "<?xml version=\"1.0\"?>\n<opencv_storage>\n<board_width>9</board_width>\n"
                                 "</opencv_storage>\n")},
                   640, 480, "none of the known calibration formats");
}

TEST(MalformedCalibration, Ros) {
    const Folder folder;
    const auto left = folder.write("left.yaml", test::kRosLeft);
    const auto right = folder.write("right.yaml", test::kRosRight);
    expect_refused({left}, 752, 480, "calibration of one camera");
    expect_refused({right, left}, 752, 480, "exchange");
    expect_refused({left, left}, 752, 480, "baseline is 0 m");
    expect_refused({left, right}, 640, 480, "calibrated for pictures of 752 x 480, but they are 640 x 480");
    for (const Change& change :
         {Change{"image_width: 752\n", "", "\"image_width\" is missing"},
          Change{"image_width: 752", "image_width: wide", ":1: image_width: \"wide\" is not a finite number"},
          Change{"projection_matrix", "projection", "\"projection_matrix\" is missing"},
          Change{"[436.2, 0,", "[0, 0,", "projection_matrix: its focal length is not positive"},
          Change{"[436.2, 0,", "[436.2, .nan,", "projection_matrix.data: \".nan\" is not a finite number"},
          Change{"distortion_model: plumb_bob", "distortion_model: omni", "\"omni\" is not supported"},
          Change{"[461.5, 0,", "[0.0, 0,", "focal length"},
          Change{"data: [461.5", "data: [461.5]\n  date: [461.5", "says 3 x 3, but its data has 1 numbers"}})
        expect_refused({left, folder.write("bad.yaml", changed(test::kRosRight, change.from, change.to))},
                       752, 480, change.says);
}

TEST(MalformedCalibration, Kalibr) {
    const Folder folder;
    for (const Change& change :
         {Change{"cam1:", "cam2:", "\"cam1\" is missing"},
          Change{"T_cn_cnm1:", "T_cam_imu:", "cam1: \"T_cn_cnm1\" is missing"},
          Change{"\n  - [0.0, 0.0, 0.0, 1.0]", "", "T_cn_cnm1: is 3 x 4, expected 4 x 4"},
          Change{"- [0.0, 1.0, 0.0, 0.0019]", "- [0.0, 1.0, 0.0019]", "rows have different lengths"},
          Change{"- [0.0, 1.0, 0.0, 0.0019]", "- [0.5, 1.0, 0.0, 0.0019]", "not a rotation"},
          Change{"- [0.0, 0.0, 0.0, 1.0]", "- [0.0, 0.0, 0.0, 0.0]", "last row is not 0 0 0 1"},
          Change{"camera_model: pinhole", "camera_model: omni",
                 ":3: cam0.camera_model: \"omni\" is not supported"},
          Change{"intrinsics: [380.81, ", "intrinsics: [", "cam0.intrinsics: has 3 numbers, expected 4"},
          Change{"resolution: [1024, 1024]", "resolution: [1024]",
                 "cam0.resolution: expected a list of at least 2"},
          Change{"resolution: [1024, 1024]", "resolution: [1024, x]", "\"x\" is not a finite number"},
          Change{"distortion_coeffs: [-0.0138,", "distortion_coeffs: [-0.0138, 1,",
                 "expected the 4 of an equidistant"},
          Change{"-0.1009", "0.1009", "exchange"}})
        expect_refused({folder.write("camchain.yaml", changed(test::kKalibr, change.from, change.to))}, 1024,
                       1024, change.says);
    const auto good = folder.write("camchain.yaml", test::kKalibr);
    expect_refused({good, good}, 1024, 1024, "holds both cameras");
}

TEST(MalformedCalibration, Euroc) {
    const Folder folder;
    const auto left = folder.write("cam0.yaml", test::kEurocLeft);
    const auto right = folder.write("cam1.yaml", test::kEurocRight);
    expect_refused({left}, 752, 480, "two files");
    expect_refused({right, left}, 752, 480, "exchange");
    expect_refused({left, folder.write("ros.yaml", test::kRosRight)}, 752, 480, "of another format");
    for (const Change& change :
         {Change{"T_BS:", "T_BC:", "\"T_BS\" is missing"},
          Change{"0.0, 0.0, 0.0, 1.0]", "0.0, 0.0, 1.0]", "T_BS: says 4 x 4, but its data has 15 numbers"},
          Change{"0.0125552670891", "0.9", "T_BS: its upper left 3 x 3 is not a rotation"},
          Change{"intrinsics: [457.587", "intrinsics: [inf", "intrinsics: \"inf\" is not a finite number"},
          Change{"radial-tangential", "atan", "\"atan\" is not supported"}})
        expect_refused({left, folder.write("bad.yaml", changed(test::kEurocRight, change.from, change.to))},
                       752, 480, change.says);
}

TEST(MalformedCalibration, WhatIsNoCalibrationAtAll) {
    const Folder folder;
    const auto refused = [&](const char* name, const std::string& text, const char* says) {
        expect_refused({folder.write(name, text)}, 640, 480, says);
    };
    refused("empty.yaml", "", "empty");
    refused("blank.yaml", "\n  \n", "empty");
    refused("list.yaml", "- 1\n- 2\n", "none of the known calibration formats");
    refused("word.txt", "hello\n", "none of the known calibration formats");
    refused("other.yaml", "name: value\n", "none of the known calibration formats");
    refused("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n", "none of the known calibration formats");
    refused("left.png", std::string("\x89PNG\r\n\x1a\n\0\0", 10), "not a text file");
    refused("big.yaml", std::string((1 << 20) + 1, ' '), "too many for a calibration");
    refused("deep.yaml", std::string(100000, '['), "not readable as YAML");
    refused("laughs.yaml",
            "a: &a [0, 0, 0, 0, 0, 0, 0, 0, 0, 0]\nb: &b [*a, *a, *a, *a, *a, *a, *a, *a, *a, *a]\n"
            "c: &c [*b, *b, *b, *b, *b, *b, *b, *b, *b, *b]\nd: &d [*c, *c, *c, *c, *c, *c, *c, *c, *c, *c]\n"
            "M1: [*d, *d, *d, *d, *d, *d, *d, *d, *d, *d]\n",
            "M1: has more than 10000 elements");
    std::string nested = "<opencv_storage>";
    for (int i = 0; i < 100000; ++i)
        nested += "<a><!-- </a> -->";
    refused("nested.xml", nested.substr(0, 1 << 20), "more than 2000 elements");
    refused("tab.yaml", "cam0:\n\tintrinsics: 3\n", "not readable as YAML");
}

TEST(MalformedCalibration, MissingAndUnreadableFilesAreInputErrors) {
    const Folder folder;
    const Complaint missing = complaint({folder.path() / "absent.yaml"}, 640, 480);
    EXPECT_EQ(missing.status, ExitStatus::kInput);
    EXPECT_NE(missing.text.find("absent.yaml: no such"), std::string::npos) << missing.text;
    const Complaint directory = complaint({folder.path()}, 640, 480);
    EXPECT_EQ(directory.status, ExitStatus::kInput);
    EXPECT_EQ(complaint({folder.write("a.txt", test::kKitti), folder.path() / "absent"}, 1242, 375).status,
              ExitStatus::kInput);
}

TEST(MalformedCalibration, OneOrTwoFiles) {
    const Folder folder;
    const auto file = folder.write("calib.txt", test::kKitti);
    EXPECT_EQ(complaint({}, 1242, 375).status, ExitStatus::kConfig);
    EXPECT_EQ(complaint({file, file, file}, 1242, 375).status, ExitStatus::kConfig);
    EXPECT_NE(complaint({file, file}, 1242, 375).text.find("holds both cameras"), std::string::npos);
}

// Cut anywhere, or with bytes changed at random: read or refused, never anything else.
TEST(MalformedCalibration, DamagedFilesAreReadOrRefused) {
    const Folder folder;
    const std::string matrix =
        " type_id=\"opencv-matrix\">\n  <rows>3</rows>\n  <cols>3</cols>\n  <dt>d</dt>\n  <data>\n"
        "    534. 0. 322. 0. 535. 241. 0. 0. 1.</data>";
    std::string xml = "<?xml version=\"1.0\"?>\n<opencv_storage>\n";
    for (const char* name : {"M1", "M2"})
        xml.append("<").append(name).append(matrix).append("</").append(name).append(">\n");
    xml.append("<image_size>\n  640 480</image_size>\n</opencv_storage>\n");
    struct Sample {
        std::string text;
        std::string other;  // the second file of a pair
        int width, height;
    };
    const std::vector<Sample> samples = {{test::kOpenCvStereo, "", 640, 480},
                                         {test::kRosRight, test::kRosLeft, 752, 480},
                                         {test::kKalibr, "", 1024, 1024},
                                         {test::kEurocRight, test::kEurocLeft, 752, 480},
                                         {test::kKitti, "", 1242, 375},
                                         {test::kMiddlebury, "", 741, 497},
                                         {test::kOpenCvExtrinsics, test::kOpenCvIntrinsics, 640, 480},
                                         {xml, "", 640, 480}};
    std::mt19937 random(51);
    int refused = 0, read = 0;
    for (const Sample& sample : samples) {
        Paths files;
        if (!sample.other.empty()) files.push_back(folder.write("first", sample.other));
        files.push_back(folder.path() / "damaged");
        const auto attempt = [&](const std::string& text) {
            folder.write("damaged", text);
            try {
                const rig::StereoCalibration c = read_calibration(files, sample.width, sample.height);
                EXPECT_GT(c.left.fx, 0.0);
                ++read;
            } catch (const Refusal& refusal) {
                EXPECT_EQ(refusal.status(), ExitStatus::kConfig) << refusal.what();
                ++refused;
            }
        };
        for (std::size_t length = 0; length < sample.text.size(); length += 11)
            attempt(sample.text.substr(0, length));
        for (int i = 0; i < 200; ++i) {
            std::string text = sample.text;
            for (std::uint32_t changes = 1 + random() % 4; changes > 0; --changes) {
                const std::size_t at = random() % text.size();
                switch (random() % 3) {
                    case 0:
                        text[at] = static_cast<char>(random() % 256);
                        break;
                    case 1:
                        text.erase(at, 1 + random() % 8);
                        break;
                    default:
                        text.insert(at, 1, "0-.:[]{}<>=,!&*\"'#%\n\t "[random() % 23]);
                        break;
                }
                if (text.empty()) text.assign(1, '0');
            }
            attempt(text);
        }
    }
    EXPECT_GT(refused, 1000);
    EXPECT_GT(read, 100) << "changed digits in the tail of a number leave a file that can be read";
}

}  // namespace
}  // namespace groundline::io
