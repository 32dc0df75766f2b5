#include "io/truth.hpp"

#include <fmt/core.h>

#include <fstream>
#include <iterator>
#include <stdexcept>
#include <system_error>

#include "core/error.hpp"
#include "io/pair_list.hpp"

namespace groundline::io {
namespace {

namespace fs = std::filesystem;

bool is_file(const fs::path& path) {
    std::error_code error;
    return fs::is_regular_file(path, error);
}

void require_size(int width, int height, const Image16& disparity, const fs::path& path,
                  const fs::path& disparity_path) {
    if (width == disparity.width && height == disparity.height) return;
    throw std::runtime_error(fmt::format("the truth image '{}' has {}x{} pixels; expected {}x{} like '{}'",
                                         path.string(), width, height, disparity.width, disparity.height,
                                         disparity_path.string()));
}

}  // namespace

Truth::Truth(const fs::path& folder) {
    std::error_code error;
    const bool many = fs::is_directory(folder / "disp", error);
    if (!many && !is_file(folder / "disp.png"))
        throw Refusal(
            ExitStatus::kInput,
            fmt::format("the folder '{}' holds no truth; expected disp.png or disp/ in it", folder.string()));
    const std::vector<fs::path> names = many ? images_in(folder / "disp") : std::vector<fs::path>{"disp.png"};
    if (names.empty())
        throw Refusal(ExitStatus::kInput,
                      fmt::format("the folder '{}' holds no images; expected 16-bit disparity truth",
                                  (folder / "disp").string()));
    for (const fs::path& name : names)
        disparity_.push_back(many ? folder / "disp" / name : folder / name);

    const auto beside = [&](const std::string& kind) {
        std::vector<fs::path> files;
        if (!many) {
            if (is_file(folder / fmt::format("{}.png", kind)))
                files.push_back(folder / fmt::format("{}.png", kind));
            return files;
        }
        if (!fs::is_directory(folder / kind, error)) return files;
        for (const fs::path& name : names) {
            files.push_back(folder / kind / name);
            if (!is_file(files.back()))
                throw Refusal(
                    ExitStatus::kInput,
                    fmt::format("the truth image '{}' is missing; expected one for each image of disp/",
                                files.back().string()));
        }
        return files;
    };
    classes_ = beside("class");
    heights_ = beside("height");
    occluded_ = beside("occluded");

    std::ifstream json(folder / "truth.json", std::ios::binary);
    json_text_.assign(std::istreambuf_iterator<char>(json), {});
}

TruthFrame Truth::read(int position) const {
    const auto at = static_cast<std::size_t>(position);
    TruthFrame frame;
    frame.disparity_q8 = read_png16(disparity_.at(at));
    if (has_classes()) {
        frame.classes = read_luma_png(classes_[at]);
        require_size(frame.classes.width, frame.classes.height, frame.disparity_q8, classes_[at],
                     disparity_[at]);
    }
    if (has_heights()) {
        frame.height_mm = read_png16(heights_[at]);
        require_size(frame.height_mm.width, frame.height_mm.height, frame.disparity_q8, heights_[at],
                     disparity_[at]);
    }
    if (has_occlusion()) {
        frame.occluded = read_luma_png(occluded_[at]);
        require_size(frame.occluded.width, frame.occluded.height, frame.disparity_q8, occluded_[at],
                     disparity_[at]);
    }
    return frame;
}

}  // namespace groundline::io
