#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string_view>

#include "io/calibration/formats.hpp"

namespace groundline::io {
namespace {

// One thing that the file holds: what complaints call it, and the names that programs give it, in lower case,
// letters and digits only.
struct Entry {
    std::string_view shown;
    std::string_view names;  // each between blanks
};

constexpr Entry kMatrixLeft = {
    "M1 (the left camera matrix)",
    " m1 k1 cameramatrix1 cameramatrixl cameramatrixleft leftcameramatrix cm1 leftk "
    "kleft kl ml "};
constexpr Entry kMatrixRight = {"M2 (the right camera matrix)",
                                " m2 k2 cameramatrix2 cameramatrixr cameramatrixright rightcameramatrix cm2 "
                                "rightk kright kr mr "};
constexpr Entry kDistortionLeft = {
    "D1 (the left distortion)",
    " d1 distcoeffs1 distcoeff1 distcoeffsl distcoeffsleft leftdistcoeffs "
    "distortioncoefficients1 leftdistortioncoefficients dist1 leftd dleft dl "};
constexpr Entry kDistortionRight = {
    "D2 (the right distortion)",
    " d2 distcoeffs2 distcoeff2 distcoeffsr distcoeffsright rightdistcoeffs "
    "distortioncoefficients2 rightdistortioncoefficients dist2 rightd dright dr "};
constexpr Entry kRotation = {"R (the rotation from the left to the right camera)",
                             " r rotation rotationmatrix "};
constexpr Entry kTranslation = {"T (the translation from the left to the right camera, in metres)",
                                " t translation translationvector "};
constexpr Entry kRectifyLeft = {"R1", " r1 leftr rleft rl rect1 "};
constexpr Entry kRectifyRight = {"R2", " r2 rightr rright rr rect2 "};
constexpr Entry kProjectionLeft = {"P1", " p1 leftp pleft pl proj1 projmat1 "};
constexpr Entry kProjectionRight = {"P2", " p2 rightp pright pr proj2 projmat2 "};
constexpr Entry kSize = {"image_size", " imagesize size imgsize "};
constexpr Entry kWidth = {"image_width", " imagewidth width leftwidth "};
constexpr Entry kHeight = {"image_height", " imageheight height leftheight "};
constexpr Entry kModel = {"distortion_model", " distortionmodel lensmodel "};

bool is_called(std::string_view name, const Entry& entry) {
    std::string plain = " ";
    for (const char c : name)
        if (std::isalnum(static_cast<unsigned char>(c)))
            plain.push_back(static_cast<char>(std::tolower(static_cast<unsigned char>(c))));
    plain.push_back(' ');
    return plain.size() > 2 && entry.names.find(plain) != std::string_view::npos;
}

// Intrinsics and extrinsics seen as one file.
class Entries {
  public:
    explicit Entries(const std::vector<YamlField>& files) : files_(files) {}

    std::optional<YamlField> find(const Entry& entry) const {
        std::optional<YamlField> found;
        for (const YamlField& file : files_)
            for (const std::string& key : file.keys()) {
                if (!is_called(key, entry)) continue;
                if (found)
                    file.at(key).refuse(
                        fmt::format("{} is given twice, and it is not clear which one holds", entry.shown));
                found = file.at(key);
            }
        return found;
    }
    YamlField at(const Entry& entry) const {
        std::optional<YamlField> field = find(entry);
        if (!field)
            refuse(fmt::format("{} is missing{}", entry.shown, files_.size() > 1 ? " in both files" : ""));
        return *field;
    }
    [[noreturn]] void refuse(const std::string& what) const { files_.back().refuse(what); }

  private:
    const std::vector<YamlField>& files_;
};

template <typename Array>
void copy_matrix(const YamlField& field, int rows, int columns, Array& to) {
    const std::vector<double> values = field.matrix(rows, columns);
    std::copy(values.begin(), values.end(), to.begin());
}

void set_size(rig::CameraModel& camera, const Entries& entries) {
    if (const auto size = entries.find(kSize)) {
        camera.width = size->item(0).whole_number();
        camera.height = size->item(1).whole_number();
        return;
    }
    const auto width = entries.find(kWidth);
    const auto height = entries.find(kHeight);
    if (width) camera.width = width->whole_number();
    if (height) camera.height = height->whole_number();
}

}  // namespace

bool looks_like_opencv(const YamlField& file) {
    const std::vector<std::string> keys = file.keys();
    return std::any_of(keys.begin(), keys.end(), [](const std::string& key) {
        for (const Entry& entry :
             {kMatrixLeft, kMatrixRight, kDistortionLeft, kDistortionRight, kRotation, kTranslation,
              kRectifyLeft, kRectifyRight, kProjectionLeft, kProjectionRight})
            if (is_called(key, entry)) return true;
        return false;
    });
}

rig::StereoCalibration read_opencv(const std::vector<YamlField>& files) {
    const Entries entries(files);
    rig::StereoCalibration calibration;
    calibration.format = "OpenCV stereo";
    set_matrix(calibration.left, entries.at(kMatrixLeft));
    set_matrix(calibration.right, entries.at(kMatrixRight));
    const auto model_field = entries.find(kModel);
    const std::string model = model_field ? model_field->text() : "plumb_bob";
    set_lens(calibration.left, model, entries.at(kDistortionLeft));
    set_lens(calibration.right, model, entries.at(kDistortionRight));
    set_size(calibration.left, entries);
    calibration.right.width = calibration.left.width;
    calibration.right.height = calibration.left.height;

    const auto r1 = entries.find(kRectifyLeft);
    const auto r2 = entries.find(kRectifyRight);
    const auto p1 = entries.find(kProjectionLeft);
    const auto p2 = entries.find(kProjectionRight);
    const bool any = r1 || r2 || p1 || p2;
    const bool all = r1 && r2 && p1 && p2;
    if (any && !all) entries.refuse("has only some of R1 R2 P1 P2, expected all or none");
    rig::GivenRectification given;
    if (all) {
        copy_matrix(*r1, 3, 3, given.rotation_left);
        copy_matrix(*r2, 3, 3, given.rotation_right);
        copy_matrix(*p1, 3, 4, given.projection_left);
        copy_matrix(*p2, 3, 4, given.projection_right);
        if (given.projection_left[0] <= 0.0) p1->refuse("its focal length is not positive");
        calibration.rectification = given;
    }
    const auto rotation = entries.find(kRotation);
    const auto translation = entries.find(kTranslation);
    if (all && !rotation && !translation) {
        set_pose_from_rectification(calibration, given);
    } else {
        copy_matrix(entries.at(kRotation), 3, 3, calibration.rotation);
        copy_matrix(entries.at(kTranslation), 3, 1, calibration.translation_m);
    }
    return calibration;
}

}  // namespace groundline::io
