// The calibrations of real data sets: found, read, and as their about.txt says.
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <sstream>

#include "core/arena.hpp"
#include "core/error.hpp"
#include "io/calibration/calibration_reader.hpp"
#include "rig/rectifier.hpp"

namespace groundline::io {
namespace {

namespace fs = std::filesystem;

const fs::path kData = GROUNDLINE_SOURCE_DIR "/../shared/data";

// The lines "name number".
std::map<std::string, double> about(const fs::path& file) {
    std::map<std::string, double> figures;
    std::ifstream stream(file);
    for (std::string line; std::getline(stream, line);) {
        std::istringstream words(line);
        std::string name;
        double value = 0.0;
        if (words >> name >> value) figures[name] = value;
    }
    return figures;
}

TEST(RealCalibrations, AgreeWithTheFiguresBesideThem) {
    if (!fs::exists(kData)) GTEST_SKIP() << "no real data at " << kData;
    int compared = 0;
    for (const auto& folder : fs::directory_iterator(kData)) {
        if (!fs::exists(folder.path() / "calib.txt")) continue;
        const auto figures = about(folder.path() / "about.txt");
        if (!figures.count("fx") || !figures.count("width")) continue;
        SCOPED_TRACE(folder.path().filename().string());
        const auto files = find_calibration(folder.path());
        ASSERT_EQ(files, std::vector<fs::path>{folder.path() / "calib.txt"});
        const int width = static_cast<int>(figures.at("width"));
        const int height = static_cast<int>(figures.at("height"));
        Arena arena;
        const rig::Rectifier rectifier(read_calibration(files, width, height), width, height, arena);
        const RectifiedRig& rig = rectifier.rig();
        EXPECT_TRUE(rectifier.identity());
        EXPECT_NEAR(rig.focal_px, figures.at("fx"), 1e-3);
        if (figures.count("cx")) {  // some say "unknown", and the calibration takes the middle
            EXPECT_NEAR(rig.cx_px, figures.at("cx"), 1e-3);
            EXPECT_NEAR(rig.cy_px, figures.at("cy"), 1e-3);
        }
        EXPECT_NEAR(rig.baseline_m, figures.at("baseline_m"), 1e-4 * figures.at("baseline_m"));
        EXPECT_NEAR(rig.offset_px(), figures.count("doffs") ? -figures.at("doffs") : 0.0, 1e-3);
        ++compared;
    }
    EXPECT_GT(compared, 15);
}

TEST(RealCalibrations, KittiObjectFileHasGreyAndColour) {
    const fs::path file = kData / "kitti_object_lidar/calib_kitti_object.txt";
    if (!fs::exists(file)) GTEST_SKIP() << "no " << file;
    EXPECT_NEAR(-read_calibration({file}, 1242, 375).translation_m[0], 0.53715, 1e-5);
    EXPECT_NEAR(-read_calibration({file}, 1242, 375, true).translation_m[0], 0.53273, 1e-5);
}

TEST(RealCalibrations, IntrinsicsAloneAreRefused) {
    const fs::path folder = kData / "calib_opencv";
    if (!fs::exists(folder)) GTEST_SKIP() << "no " << folder;
    for (const char* name : {"intrinsics.yml", "left_intrinsics.yml", "stereo_calib.xml"})
        EXPECT_THROW(read_calibration({folder / name}, 640, 480), Refusal) << name;
}

}  // namespace
}  // namespace groundline::io
