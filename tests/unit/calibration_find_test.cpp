// Where a source's calibration is looked for, and in which order.
#include <gtest/gtest.h>

#include "core/error.hpp"
#include "io/calibration/calibration_reader.hpp"
#include "unit/calibration_support.hpp"

namespace groundline::io {
namespace {

using test::Folder;
using Paths = std::vector<std::filesystem::path>;

TEST(FindCalibration, NothingIsNothing) {
    const Folder folder;
    EXPECT_TRUE(find_calibration(folder.path()).empty());
    EXPECT_TRUE(find_calibration(folder.path() / "absent").empty());
}

TEST(FindCalibration, InOrder) {
    const Folder folder;
    // From the last resort to the first choice: each one written hides those before it.
    const auto camchain = folder.write("camchain.yaml", "x");
    EXPECT_EQ(find_calibration(folder.path()), Paths{camchain});
    const auto intrinsics = folder.write("intrinsics.yml", "x");
    const auto extrinsics = folder.write("extrinsics.yml", "x");
    EXPECT_EQ(find_calibration(folder.path()), (Paths{intrinsics, extrinsics}));
    const auto cam0 = folder.write("mav0/cam0/sensor.yaml", "x");
    const auto cam1 = folder.write("mav0/cam1/sensor.yaml", "x");
    EXPECT_EQ(find_calibration(folder.path()), (Paths{cam0, cam1}));
    EXPECT_EQ(find_calibration(folder.path() / "mav0"), (Paths{cam0, cam1}));
    const auto left = folder.write("left.yaml", "x");
    const auto right = folder.write("right.yaml", "x");
    EXPECT_EQ(find_calibration(folder.path()), (Paths{left, right}));
    const auto kitti = folder.write("calib_cam_to_cam.txt", "x");
    EXPECT_EQ(find_calibration(folder.path()), Paths{kitti});
    const auto calib = folder.write("calib.txt", "x");
    EXPECT_EQ(find_calibration(folder.path()), Paths{calib});
    const auto own = folder.write("calibration.yaml", "x");
    EXPECT_EQ(find_calibration(folder.path()), Paths{own});
}

TEST(FindCalibration, KittiRawKeepsItAboveTheDrives) {
    const Folder folder;
    const auto kitti = folder.write("2011_09_26/calib_cam_to_cam.txt", "x");
    const auto drive = folder.path() / "2011_09_26" / "2011_09_26_drive_0001_sync";
    std::filesystem::create_directories(drive / "image_00");
    EXPECT_EQ(find_calibration(drive), Paths{kitti});
    EXPECT_EQ(find_calibration(drive / "image_00"), Paths{kitti});
    EXPECT_EQ(find_calibration(folder.path() / "2011_09_26"), Paths{kitti});
}

// Half a pair is not passed over in silence: reading it tells what is missing.
TEST(FindCalibration, HalfAPairIsFoundAndRefused) {
    for (const auto& [name, text, says] :
         {std::tuple{"left.yaml", test::kRosLeft, "expected ROS camera_info of both"},
          std::tuple{"mav0/cam1/sensor.yaml", test::kEurocRight, "two files"},
          std::tuple{"intrinsics.yml", test::kOpenCvIntrinsics, "rotation from the left to the right"}}) {
        const Folder folder;
        const auto path = folder.write(name, text);
        const Paths found = find_calibration(folder.path());
        ASSERT_EQ(found, Paths{path});
        try {
            read_calibration(found, 752, 480);
            FAIL() << name << " was accepted";
        } catch (const Refusal& refusal) {
            EXPECT_NE(std::string(refusal.what()).find(says), std::string::npos) << refusal.what();
        }
    }
}

}  // namespace
}  // namespace groundline::io
