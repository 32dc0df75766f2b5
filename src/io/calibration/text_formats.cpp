#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "io/calibration/formats.hpp"

namespace groundline::io {
namespace {

class KeyedFile {
  public:
    KeyedFile(const SourceText& source, char separator)
        : path_(source.path), lines_(keyed_lines(source, separator)) {}

    const KeyedLine* find(const std::string& key) const {
        const auto found = std::find_if(lines_.begin(), lines_.end(),
                                        [&](const KeyedLine& line) { return line.key == key; });
        return found == lines_.end() ? nullptr : &*found;
    }
    const KeyedLine& at(const std::string& key) const {
        const KeyedLine* line = find(key);
        if (!line) refuse(path_, 0, fmt::format("{} is missing", key));
        return *line;
    }
    // The numbers of a line; `brackets` takes Middlebury's [a b c; d e f].
    std::vector<double> numbers(const std::string& key, std::size_t count, bool brackets = false) const {
        std::string text = at(key).value;
        if (brackets) {
            if (text.size() < 2 || text.front() != '[' || text.back() != ']')
                refuse_line(key, "expected a matrix in square brackets");
            text = text.substr(1, text.size() - 2);
            std::replace(text.begin(), text.end(), ';', ' ');
        }
        std::vector<double> values;
        std::istringstream words(text);
        for (std::string word; words >> word;) {
            const std::optional<double> value = parse_number(word);
            if (!value) refuse_line(key, fmt::format("\"{}\" is not a finite number", word.substr(0, 40)));
            values.push_back(*value);
        }
        if (values.size() != count)
            refuse_line(key, fmt::format("has {} numbers, expected {}", values.size(), count));
        return values;
    }
    double number(const std::string& key) const { return numbers(key, 1).front(); }
    int pixels(const std::string& key, double value) const {
        if (value < 1.0 || value > 1e6 || value != std::floor(value))
            refuse_line(key, fmt::format("{} is not a number of pixels", value));
        return static_cast<int>(value);
    }
    [[noreturn]] void refuse_line(const std::string& key, const std::string& what) const {
        refuse(path_, at(key).line, fmt::format("{}: {}", key, what));
    }

  private:
    std::filesystem::path path_;
    std::vector<KeyedLine> lines_;
};

template <typename Predicate>
bool any_line(const SourceText& source, Predicate matches) {
    std::istringstream stream(source.text);
    for (std::string line; std::getline(stream, line);)
        if (matches(std::string_view(line))) return true;
    return false;
}

std::vector<double> kitti_projection(const KeyedFile& file, const std::string& key,
                                     rig::CameraModel& camera) {
    std::vector<double> p = file.numbers(key, 12);
    if (p[1] != 0.0 || p[4] != 0.0 || p[8] != 0.0 || p[9] != 0.0 || p[10] != 1.0)
        file.refuse_line(key,
                         "is not the projection of a rectified camera, expected f 0 cx a 0 f cy b 0 0 1 c");
    camera.fx = p[0];
    camera.fy = p[5];
    camera.cx = p[2];
    camera.cy = p[6];
    return p;
}

rig::CameraModel middlebury_camera(const KeyedFile& file, const std::string& key) {
    const std::vector<double> k = file.numbers(key, 9, true);
    if (k[1] != 0.0 || k[3] != 0.0 || k[6] != 0.0 || k[7] != 0.0 || k[8] != 1.0)
        file.refuse_line(key, "expected [f 0 cx; 0 f cy; 0 0 1]");
    rig::CameraModel camera;
    camera.fx = k[0];
    camera.fy = k[4];
    camera.cx = k[2];
    camera.cy = k[5];
    return camera;
}

}  // namespace

bool looks_like_kitti(const SourceText& file) {
    return any_line(file, [](std::string_view line) {
        if (!line.starts_with("P")) return false;
        line.remove_prefix(line.starts_with("P_rect_0") ? 8 : 1);
        if (line.size() < 2 || line[0] < '0' || line[0] > '3' || line[1] != ':') return false;
        const std::size_t value = line.find_first_not_of(" \t", 2);
        // OpenCV's YAML has a "P1:" too, followed by a tag or nothing.
        return value != std::string_view::npos &&
               std::string_view("!{[#\r").find(line[value]) == std::string_view::npos;
    });
}

rig::StereoCalibration read_kitti(const SourceText& source, bool colour_pair) {
    const KeyedFile file(source, ':');
    struct Names {
        const char* left;
        const char* right;
        const char* left_size;
        const char* right_size;
    };
    constexpr std::array<Names, 4> kPairs = {{{"P0", "P1", "", ""},
                                              {"P_rect_00", "P_rect_01", "S_rect_00", "S_rect_01"},
                                              {"P2", "P3", "", ""},
                                              {"P_rect_02", "P_rect_03", "S_rect_02", "S_rect_03"}}};
    const std::array<std::size_t, 4> order =
        colour_pair ? std::array<std::size_t, 4>{2, 3, 0, 1} : std::array<std::size_t, 4>{0, 1, 2, 3};
    // The first pair of which anything is there: half a pair is an error, not a reason to take another one.
    const auto chosen = std::find_if(order.begin(), order.end(), [&](std::size_t pair) {
        return file.find(kPairs[pair].left) || file.find(kPairs[pair].right);
    });
    if (chosen == order.end()) refuse(source.path, 0, "has no projections, expected P0 and P1, or P2 and P3");
    const Names& names = kPairs[*chosen];

    rig::StereoCalibration calibration;
    calibration.format = "KITTI";
    calibration.rectified = true;
    const std::vector<double> left = kitti_projection(file, names.left, calibration.left);
    const std::vector<double> right = kitti_projection(file, names.right, calibration.right);
    if (left[0] == 0.0) file.refuse_line(names.left, "the focal length is 0");
    if (std::abs(left[7] - right[7]) > std::abs(left[3] - right[3]))
        file.refuse_line(names.right, "the cameras stand one above the other, expected side by side");
    calibration.translation_m = {(right[3] - left[3]) / left[0], 0.0, 0.0};
    const auto read_size = [&](const std::string& key, rig::CameraModel& camera) {
        if (key.empty() || !file.find(key)) return;
        const std::vector<double> size = file.numbers(key, 2);
        camera.width = file.pixels(key, size[0]);
        camera.height = file.pixels(key, size[1]);
    };
    read_size(names.left_size, calibration.left);
    read_size(names.right_size, calibration.right);
    return calibration;
}

bool looks_like_middlebury(const SourceText& file) {
    return any_line(file, [](std::string_view line) {
        for (const std::string_view key : {"cam0", "cam1", "doffs"})
            if (line.starts_with(key)) {
                const std::size_t next = line.find_first_not_of(" \t", key.size());
                return next != std::string_view::npos && line[next] == '=';
            }
        return false;
    });
}

rig::StereoCalibration read_middlebury(const SourceText& source) {
    const KeyedFile file(source, '=');
    rig::StereoCalibration calibration;
    calibration.format = "Middlebury";
    calibration.rectified = true;
    calibration.left = middlebury_camera(file, "cam0");
    calibration.right = middlebury_camera(file, "cam1");
    const double doffs = file.number("doffs");
    // Files round doffs to a few digits.
    if (std::abs(calibration.right.cx - calibration.left.cx - doffs) > 0.1)
        file.refuse_line("doffs", fmt::format("{} is not the difference {:.6g} of cam1's and cam0's cx",
                                              doffs, calibration.right.cx - calibration.left.cx));
    calibration.translation_m = {-file.number("baseline") / 1000.0, 0.0, 0.0};
    for (const char* key : {"width", "height"}) {
        if (!file.find(key)) continue;
        const int pixels = file.pixels(key, file.number(key));
        const bool is_width = std::string_view(key) == "width";
        (is_width ? calibration.left.width : calibration.left.height) = pixels;
        (is_width ? calibration.right.width : calibration.right.height) = pixels;
    }
    if (file.find("ndisp")) calibration.disparities_hint = file.pixels("ndisp", file.number("ndisp"));
    return calibration;
}

}  // namespace groundline::io
