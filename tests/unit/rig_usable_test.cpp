// What a calibration must be to be used: one change at a time to a good one, and what is said about it.
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "core/error.hpp"
#include "rig/calibration.hpp"
#include "unit/rig_support.hpp"

namespace groundline::rig {
namespace {

StereoCalibration good() {
    StereoCalibration rig;
    for (CameraModel* camera : {&rig.left, &rig.right}) {
        camera->width = 640;
        camera->height = 480;
        camera->fx = camera->fy = 500;
        camera->cx = 320;
        camera->cy = 240;
    }
    rig.translation_m = {-0.12, 0.001, 0.002};
    rig.source = "rig.yml";
    return rig;
}

StereoCalibration good_given() {
    StereoCalibration rig = good();
    rig.translation_m = {-0.12, 0, 0};
    GivenRectification given;
    given.projection_left = {480, 0, 320, 0, 0, 480, 240, 0, 0, 0, 1, 0};
    given.projection_right = {480, 0, 320, -57.6, 0, 480, 240, 0, 0, 0, 1, 0};
    rig.rectification = given;
    return rig;
}

StereoCalibration good_rectified() {
    StereoCalibration rig = good();
    rig.rectified = true;
    return rig;
}

std::string complaint(const StereoCalibration& rig, int width = 640, int height = 480) {
    try {
        require_usable(rig, width, height);
    } catch (const Refusal& refusal) {
        EXPECT_EQ(refusal.status(), ExitStatus::kConfig);
        return refusal.what();
    }
    return "";
}

TEST(Usable, GoodOnesPass) {
    EXPECT_EQ(complaint(good()), "");
    EXPECT_EQ(complaint(good_given()), "");
    EXPECT_EQ(complaint(good_rectified()), "");
    test::Random random(41);
    for (int i = 0; i < 200; ++i)
        EXPECT_EQ(complaint(test::sample_rig(random, Lens::kPinhole, 640, 480)), "");
}

TEST(Usable, EachFaultIsNamed) {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    constexpr double kInf = std::numeric_limits<double>::infinity();
    struct Fault {
        const char* says;
        StereoCalibration (*base)();
        std::function<void(StereoCalibration&)> make;
    };
    const std::vector<Fault> faults = {
        {"not a finite number", good, [](auto& r) { r.left.cx = kNan; }},
        {"not a finite number", good, [](auto& r) { r.right.distortion[7] = kInf; }},
        {"not a finite number", good, [](auto& r) { r.translation_m[1] = kNan; }},
        {"focal length", good, [](auto& r) { r.left.fx = 0; }},
        {"focal length", good, [](auto& r) { r.right.fy = -3; }},
        {"calibrated for pictures of 1280 x 960", good,
         [](auto& r) { r.left.width = 1280, r.left.height = 960; }},
        {"right camera was calibrated", good, [](auto& r) { r.right.height = 240; }},
        {"quarter of the width", good,
         [](auto& r) {
             r.left.width = r.left.height = 0;
             r.left.cx = 640;
         }},
        {"not a rotation", good, [](auto& r) { r.rotation[0] = 1.01; }},
        {"not a rotation", good, [](auto& r) { r.rotation[4] = -1; }},
        {"not a rotation", good, [](auto& r) { r.rotation[8] = kNan; }},
        {"baseline is", good,
         [](auto& r) {
             r.translation_m = {0, 0, 0};
         }},
        {"baseline is", good,
         [](auto& r) {
             r.translation_m = {-0.0005, 0, 0};
         }},
        {"divide them by 1000", good,
         [](auto& r) {
             r.translation_m = {-120, 1, 2};
         }},
        {"exchange", good, [](auto& r) { r.translation_m[0] = 0.12; }},
        {"one above the other", good,
         [](auto& r) {
             r.translation_m = {-0.05, 0.12, 0};
         }},
        {"one behind the other", good,
         [](auto& r) {
             r.translation_m = {-0.05, 0, 0.12};
         }},
        {"60 degrees", good,
         [](auto& r) {
             r.rotation = {0, 0, -1, 0, 1, 0, 1, 0, 0};
             r.translation_m = {0.01, 0, -0.12};
         }},
        {"R1, R2", good_given, [](auto& r) { r.rectification->rotation_left[0] = 1.1; }},
        {"P1, P2", good_given, [](auto& r) { r.rectification->projection_left[0] = 0; }},
        {"P1, P2", good_given, [](auto& r) { r.rectification->projection_right[1] = 2; }},
        {"P1, P2", good_given, [](auto& r) { r.rectification->projection_right[2] = kNan; }},
        {"P1 and P2 differ", good_given, [](auto& r) { r.rectification->projection_right[6] = 245; }},
        {"P1 and P2 differ", good_given, [](auto& r) { r.rectification->projection_right[0] = 490; }},
        {"one above the other", good_given,
         [](auto& r) {
             r.rectification->projection_right[3] = 0, r.rectification->projection_right[7] = -57.6;
         }},
        {"0.06 m in P2 but 0.12 m in T", good_given,
         [](auto& r) { r.rectification->projection_right[3] = -28.8; }},
        {"rows of the two cameras parallel", good_given,
         [](auto& r) { r.rectification->rotation_left = test::turned(0.02, 0, 0); }},
        {"rows of the two cameras parallel", good_given,
         [](auto& r) {
             r.translation_m = {-0.12, 0.002, 0};
         }},
        {"baseline is", good_rectified, [](auto& r) { r.translation_m[0] = 0; }},
        {"exchange", good_rectified, [](auto& r) { r.translation_m[0] = 0.12; }},
        {"not a finite number", good_rectified, [](auto& r) { r.translation_m[0] = kNan; }},
        {"at most 5 m", good_rectified, [](auto& r) { r.translation_m[0] = -120; }},
        {"focal lengths", good_rectified, [](auto& r) { r.right.fx = 510; }},
        {"middle rows", good_rectified, [](auto& r) { r.right.cy = 243; }},
    };
    for (const Fault& fault : faults) {
        StereoCalibration rig = fault.base();
        fault.make(rig);
        const std::string said = complaint(rig);
        EXPECT_NE(said.find(fault.says), std::string::npos)
            << "expected: " << fault.says << "\nsaid: " << said;
        EXPECT_EQ(said.rfind("rig.yml: ", 0), 0U) << said;
        EXPECT_EQ(said.find('\n'), std::string::npos) << said;
    }
}

TEST(Usable, RectifiedPicturesNeedNoRotation) {
    StereoCalibration rig = good_rectified();
    rig.rotation = {};
    EXPECT_EQ(complaint(rig), "");
}

TEST(Usable, PrincipalPointsMayDiffer) {
    StereoCalibration rig = good_rectified();
    rig.right.cx = 351.086;
    EXPECT_EQ(complaint(rig), "");
}

TEST(Usable, PicturesHaveASize) {
    EXPECT_NE(complaint(good(), 0, 480), "");
    EXPECT_NE(complaint(good(), 640, 1), "");
    EXPECT_NE(complaint(good(), 40000, 480), "");
}

}  // namespace
}  // namespace groundline::rig
