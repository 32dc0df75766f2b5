#include "io/pair_list.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <string_view>
#include <system_error>

#include "core/error.hpp"
#include "io/natural_order.hpp"
#include "io/stamps.hpp"

namespace groundline::io {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const std::string& sentence) {
    throw Refusal(ExitStatus::kInput, sentence);
}

bool has_image_extension(const fs::path& file) {
    static constexpr std::array<std::string_view, 9> kExtensions = {".png", ".jpg", ".jpeg", ".pgm", ".ppm",
                                                                    ".pnm", ".tif", ".tiff", ".bmp"};
    std::string extension = file.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

bool is_folder(const fs::path& path) {
    std::error_code error;
    return fs::is_directory(path, error);
}

bool is_file(const fs::path& path) {
    std::error_code error;
    return fs::is_regular_file(path, error);
}

// Names in `names` that `others` lacks.
std::vector<fs::path> missing_in(const std::vector<fs::path>& others, const std::vector<fs::path>& names) {
    std::vector<fs::path> single;
    for (const fs::path& name : names)
        if (!std::binary_search(others.begin(), others.end(), name, [](const fs::path& a, const fs::path& b) {
                return natural_less(a.native(), b.native());
            }))
            single.push_back(name);
    return single;
}

// The first few names and how many more, for a sentence.
std::string some_of(const std::vector<fs::path>& names) {
    constexpr std::size_t kShown = 3;
    std::string text;
    for (std::size_t i = 0; i < std::min(names.size(), kShown); ++i)
        text += (i == 0 ? "" : ", ") + names[i].string();
    if (names.size() > kShown) text += fmt::format(" and {} more", names.size() - kShown);
    return text;
}

PairList pair_by_name(const fs::path& left, const fs::path& right) {
    const std::vector<fs::path> left_names = images_in(left), right_names = images_in(right);
    if (left_names.empty() && right_names.empty())
        refuse(fmt::format(
            "the folders '{}' and '{}' hold no images; expected files with the same names in both",
            left.string(), right.string()));
    const std::vector<fs::path> left_only = missing_in(right_names, left_names);
    const std::vector<fs::path> right_only = missing_in(left_names, right_names);
    if (!left_only.empty() || !right_only.empty()) {
        std::string sentence = "the two sides do not have the same images:";
        if (!left_only.empty())
            sentence += fmt::format(" only in '{}': {};", left.string(), some_of(left_only));
        if (!right_only.empty())
            sentence += fmt::format(" only in '{}': {};", right.string(), some_of(right_only));
        refuse(sentence + " expected each name on both sides");
    }
    PairList list;
    for (const fs::path& name : left_names)
        list.pairs.push_back({left / name, right / name, 0, 0});
    return list;
}

// Stamps where every name is one.
void stamp_by_name(PairList& list) {
    for (const PairFiles& pair : list.pairs)
        if (!stamp_of_name(pair.left)) return;
    for (PairFiles& pair : list.pairs)
        pair.stamp_ns = *stamp_of_name(pair.left);
    list.stamped = true;
}

// KITTI numbers images from 0; the number is the line of the stamp file, so a part of a drive works too.
std::int64_t kitti_stamp(const std::vector<std::int64_t>& stamps, const fs::path& image,
                         const fs::path& stamp_file) {
    const std::string stem = image.stem().string();
    const bool number = !stem.empty() && stem.size() <= 10 &&
                        std::all_of(stem.begin(), stem.end(),
                                    [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; });
    const std::size_t index = number ? std::stoull(stem) : stamps.size();
    if (index >= stamps.size())
        refuse(fmt::format("'{}' has no line for the image '{}'; it has {} lines, the first for number 0",
                           stamp_file.string(), image.string(), stamps.size()));
    return stamps[index];
}

void stamp_by_kitti(PairList& list, const fs::path& left_file, const fs::path& right_file) {
    if (!is_file(left_file)) return stamp_by_name(list);
    const std::vector<std::int64_t> left = read_kitti_stamps(left_file);
    const std::vector<std::int64_t> right = is_file(right_file) ? read_kitti_stamps(right_file) : left;
    for (PairFiles& pair : list.pairs) {
        pair.stamp_ns = kitti_stamp(left, pair.left, left_file);
        pair.skew_ns = kitti_stamp(right, pair.right, right_file) - pair.stamp_ns;
    }
    list.stamped = true;
}

PairList pair_by_stamp(const fs::path& left, const fs::path& right) {
    const std::vector<StampedFile> lefts = read_euroc_csv(left / "data.csv");
    const std::vector<StampedFile> rights = read_euroc_csv(right / "data.csv");
    PairList list;
    std::size_t i = 0, j = 0;
    while (i < lefts.size() && j < rights.size()) {
        const std::int64_t skew_ns = rights[j].stamp_ns - lefts[i].stamp_ns;
        if (skew_ns > kMaxSkewNs) {
            ++i;
        } else if (skew_ns < -kMaxSkewNs) {
            ++j;
        } else {
            list.pairs.push_back(
                {left / "data" / lefts[i].name, right / "data" / rights[j].name, lefts[i].stamp_ns, skew_ns});
            ++i, ++j;
        }
    }
    if (list.pairs.empty())
        refuse(
            fmt::format("no image of '{}' has one in '{}' within 5 ms; expected two cameras exposed together",
                        (left / "data.csv").string(), (right / "data.csv").string()));
    const std::size_t single_left = lefts.size() - list.pairs.size();
    const std::size_t single_right = rights.size() - list.pairs.size();
    if (single_left + single_right > 0)
        list.note =
            fmt::format("{} left and {} right images of '{}' have no partner within 5 ms and are left out",
                        single_left, single_right, left.parent_path().string());
    list.stamped = true;
    return list;
}

// The one image file NAME.* of a folder.
std::optional<fs::path> image_called(const fs::path& folder, std::string_view name) {
    std::vector<fs::path> found;
    for (const fs::path& file : images_in(folder))
        if (file.stem().string() == name) found.push_back(file);
    if (found.empty()) return std::nullopt;
    if (found.size() > 1)
        refuse(fmt::format("the folder '{}' holds {}; expected one image called {}", folder.string(),
                           some_of(found), name));
    return folder / found.front();
}

enum class Kind { kFolders, kImages, kKitti, kEuroc };

struct Layout {
    Kind kind;
    const char* left;
    const char* right;
    bool colour_pair = false;
};

constexpr std::array<Layout, 10> kLayouts = {{
    {Kind::kFolders, "left", "right"},
    {Kind::kImages, "left", "right"},
    {Kind::kImages, "im0", "im1"},
    {Kind::kKitti, "image_00/data", "image_01/data"},
    {Kind::kKitti, "image_02/data", "image_03/data", true},
    {Kind::kKitti, "image_0", "image_1"},
    {Kind::kKitti, "image_2", "image_3", true},
    {Kind::kKitti, "colored_0", "colored_1", true},
    {Kind::kEuroc, "mav0/cam0", "mav0/cam1"},
    {Kind::kEuroc, "cam0", "cam1"},
}};

bool has_side(const fs::path& folder, const Layout& layout, const char* side) {
    switch (layout.kind) {
        case Kind::kImages:
            return image_called(folder, side).has_value();
        case Kind::kEuroc:
            return is_file(folder / side / "data.csv");
        default:
            return is_folder(folder / side);
    }
}

std::string side_name(const Layout& layout, const char* side) {
    switch (layout.kind) {
        case Kind::kImages:
            return fmt::format("an image called {}", side);
        case Kind::kEuroc:
            return fmt::format("{}/data.csv", side);
        default:
            return fmt::format("{}/", side);
    }
}

PairList list_layout(const fs::path& folder, const Layout& layout) {
    const fs::path left = folder / layout.left, right = folder / layout.right;
    PairList list;
    switch (layout.kind) {
        case Kind::kFolders:
            list = pair_by_name(left, right);
            stamp_by_name(list);
            break;
        case Kind::kImages:
            list.pairs.push_back(
                {*image_called(folder, layout.left), *image_called(folder, layout.right), 0, 0});
            break;
        case Kind::kKitti: {
            list = pair_by_name(left, right);
            const bool raw = left.filename() == "data";
            stamp_by_kitti(list, raw ? left.parent_path() / "timestamps.txt" : folder / "times.txt",
                           raw ? right.parent_path() / "timestamps.txt" : folder / "times.txt");
            break;
        }
        case Kind::kEuroc:
            list = pair_by_stamp(left, right);
            break;
    }
    list.layout = fmt::format("{} and {}", layout.left, layout.right);
    list.folder = folder;
    list.colour_pair = layout.colour_pair;
    return list;
}

}  // namespace

std::vector<fs::path> images_in(const fs::path& folder) {
    std::vector<fs::path> names;
    std::error_code error;
    fs::directory_iterator entries(folder, error);
    if (error) refuse(fmt::format("cannot read the folder '{}': {}", folder.string(), error.message()));
    for (; entries != fs::directory_iterator(); entries.increment(error)) {
        const fs::path name = entries->path().filename();
        if (name.native().front() != '.' && has_image_extension(name)) names.push_back(name);
    }
    if (error) refuse(fmt::format("cannot read the folder '{}': {}", folder.string(), error.message()));
    std::sort(names.begin(), names.end(),
              [](const fs::path& a, const fs::path& b) { return natural_less(a.native(), b.native()); });
    return names;
}

std::string accepted_layouts() {
    return "a folder with left/ and right/, with left.png and right.png, or in KITTI (image_0, image_2, "
           "image_00/data), EuRoC (mav0/cam0) or Middlebury (im0.png) layout; a left and a right image; or a "
           "side-by-side video";
}

PairList list_pairs(const fs::path& folder) {
    for (const Layout& layout : kLayouts)
        if (has_side(folder, layout, layout.left) && has_side(folder, layout, layout.right))
            return list_layout(folder, layout);
    for (const Layout& layout : kLayouts) {
        const bool left = has_side(folder, layout, layout.left);
        const bool right = has_side(folder, layout, layout.right);
        if (left || right)
            refuse(fmt::format("the folder '{}' has {} but not {}; expected both sides of a pair",
                               folder.string(), side_name(layout, left ? layout.left : layout.right),
                               side_name(layout, left ? layout.right : layout.left)));
    }
    refuse(fmt::format("the folder '{}' holds no stereo pairs in a known layout; expected {}",
                       folder.string(), accepted_layouts()));
}

PairList list_two_images(const fs::path& left, const fs::path& right) {
    PairList list;
    list.layout = "two images";
    list.pairs.push_back({left, right, 0, 0});
    const auto folder_of = [](const fs::path& image) {
        return fs::absolute(image).lexically_normal().parent_path();
    };
    const fs::path left_folder = folder_of(left), right_folder = folder_of(right);
    if (left_folder == right_folder)
        list.folder = left.has_parent_path() ? left.parent_path() : ".";
    else if (left_folder.filename() == "left" && right_folder.filename() == "right" &&
             left_folder.parent_path() == right_folder.parent_path())
        list.folder = left_folder.parent_path();
    stamp_by_name(list);
    return list;
}

}  // namespace groundline::io
