#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "io/calibration/formats.hpp"

namespace groundline::io {
namespace {

using rig::transposed;
using rig::operator*;  // NOLINT(misc-unused-using-decls): used between matrices

// A rigid motion X -> rotation X + translation.
struct Motion {
    rig::Matrix3 rotation;
    rig::Vector3 translation;
};

Motion motion_of(const YamlField& field) {
    const std::vector<double> m = field.matrix(4, 4);
    if (m[12] != 0.0 || m[13] != 0.0 || m[14] != 0.0 || m[15] != 1.0)
        field.refuse("its last row is not 0 0 0 1");
    const Motion motion{{m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}, {m[3], m[7], m[11]}};
    if (!rig::is_rotation(motion.rotation)) field.refuse("its upper left 3 x 3 is not a rotation");
    return motion;
}

// What Kalibr and EuRoC files share.
rig::CameraModel intrinsics_camera(const YamlField& file, const std::string& coefficients) {
    rig::CameraModel camera;
    const YamlField model = file.at("camera_model");
    if (model.text() != "pinhole")
        model.refuse(fmt::format("\"{}\" is not supported, expected pinhole", model.text()));
    const std::vector<double> k = file.at("intrinsics").numbers(4);
    camera.fx = k[0];
    camera.fy = k[1];
    camera.cx = k[2];
    camera.cy = k[3];
    const YamlField size = file.at("resolution");
    camera.width = size.item(0).whole_number();
    camera.height = size.item(1).whole_number();
    set_lens(camera, file.at("distortion_model").text(), file.at(coefficients));
    return camera;
}

}  // namespace

void set_matrix(rig::CameraModel& camera, const YamlField& field) {
    const std::vector<double> k = field.matrix(3, 3);
    camera.fx = k[0];
    camera.fy = k[4];
    camera.cx = k[2];
    camera.cy = k[5];
    if (k[1] != 0.0 || k[3] != 0.0 || k[6] != 0.0 || k[7] != 0.0 || k[8] != 1.0)
        field.refuse("is not of the form fx 0 cx, 0 fy cy, 0 0 1");
}

void set_lens(rig::CameraModel& camera, const std::string& model, const YamlField& coefficients) {
    constexpr std::array<std::string_view, 7> kPolynomial = {
        "plumb_bob", "rational_polynomial", "radtan", "radial-tangential", "brown", "pinhole", "none"};
    constexpr std::array<std::string_view, 4> kEquidistant = {"equidistant", "equi", "fisheye",
                                                              "kannala_brandt"};
    const auto is_one_of = [&](const auto& names) {
        return std::find(names.begin(), names.end(), model) != names.end();
    };
    const bool equidistant = is_one_of(kEquidistant);
    if (!equidistant && !is_one_of(kPolynomial))
        coefficients.refuse(
            fmt::format("the distortion model \"{}\" is not supported, expected plumb_bob, "
                        "rational_polynomial, radtan or equidistant",
                        model));
    const std::vector<double> k = coefficients.vector();
    camera.lens = equidistant ? rig::Lens::kEquidistant : rig::Lens::kPinhole;
    if (equidistant && k.size() != 4)
        coefficients.refuse(fmt::format("has {} numbers, expected the 4 of an equidistant lens", k.size()));
    const bool usual =
        k.empty() || k.size() == 4 || k.size() == 5 || k.size() == 8 || k.size() == 12 || k.size() == 14;
    if (!usual) coefficients.refuse(fmt::format("has {} numbers, expected 4, 5 or 8", k.size()));
    if (std::any_of(k.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(k.size(), 8)), k.end(),
                    [](double value) { return value != 0.0; }))
        coefficients.refuse("thin-prism and tilt coefficients are not supported, expected at most 8 numbers");
    std::copy_n(k.begin(), std::min<std::size_t>(k.size(), 8), camera.distortion.begin());
}

rig::StereoCalibration read_ros_pair(const YamlField& left, const YamlField& right) {
    rig::StereoCalibration calibration;
    calibration.format = "ROS camera_info";
    rig::GivenRectification given;
    const auto read = [](const YamlField& file, rig::CameraModel& camera, rig::Matrix3& rotation,
                         std::array<double, 12>& projection) {
        camera.width = file.at("image_width").whole_number();
        camera.height = file.at("image_height").whole_number();
        set_matrix(camera, file.at("camera_matrix"));
        set_lens(camera, file.at("distortion_model").text(), file.at("distortion_coefficients"));
        const std::vector<double> r = file.at("rectification_matrix").matrix(3, 3);
        std::copy(r.begin(), r.end(), rotation.begin());
        const std::vector<double> p = file.at("projection_matrix").matrix(3, 4);
        std::copy(p.begin(), p.end(), projection.begin());
        if (p[0] <= 0.0) file.at("projection_matrix").refuse("its focal length is not positive");
    };
    read(left, calibration.left, given.rotation_left, given.projection_left);
    read(right, calibration.right, given.rotation_right, given.projection_right);
    set_pose_from_rectification(calibration, given);
    return calibration;
}

void set_pose_from_rectification(rig::StereoCalibration& calibration, const rig::GivenRectification& given) {
    const rig::Matrix3 back = transposed(given.rotation_right);
    const double baseline_m =
        (given.projection_left[3] - given.projection_right[3]) / given.projection_left[0];
    calibration.rotation = back * given.rotation_left;
    calibration.translation_m = back * rig::Vector3{-baseline_m, 0.0, 0.0};
    calibration.rectification = given;
}

rig::StereoCalibration read_kalibr(const YamlField& chain) {
    rig::StereoCalibration calibration;
    calibration.format = "Kalibr camchain";
    const YamlField left = chain.at("cam0");
    const YamlField right = chain.at("cam1");
    calibration.left = intrinsics_camera(left, "distortion_coeffs");
    calibration.right = intrinsics_camera(right, "distortion_coeffs");
    const Motion motion = motion_of(right.at("T_cn_cnm1"));
    calibration.rotation = motion.rotation;
    calibration.translation_m = motion.translation;
    return calibration;
}

rig::StereoCalibration read_euroc_pair(const YamlField& left, const YamlField& right) {
    rig::StereoCalibration calibration;
    calibration.format = "EuRoC sensor.yaml";
    calibration.left = intrinsics_camera(left, "distortion_coefficients");
    calibration.right = intrinsics_camera(right, "distortion_coefficients");
    const Motion left_to_body = motion_of(left.at("T_BS"));
    const Motion right_to_body = motion_of(right.at("T_BS"));
    const rig::Matrix3 body_to_right = transposed(right_to_body.rotation);
    rig::Vector3 apart{};
    for (std::size_t i = 0; i < 3; ++i)
        apart[i] = left_to_body.translation[i] - right_to_body.translation[i];
    calibration.rotation = body_to_right * left_to_body.rotation;
    calibration.translation_m = body_to_right * apart;
    return calibration;
}

}  // namespace groundline::io
