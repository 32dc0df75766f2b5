#include "io/body_mask.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <stdexcept>

#include "core/error.hpp"
#include "io/png.hpp"
#include "rig/body_mask.hpp"

namespace groundline::io {
namespace {

constexpr const char* kKey = "mount.body_mask";

Image8 read_picture(const std::string& path) {
    if (!std::filesystem::exists(path))
        throw Refusal(
            ExitStatus::kConfig,
            fmt::format("{}: '{}' is neither polygons ('x,y x,y x,y; ...') nor a picture that exists", kKey,
                        path));
    try {
        return read_luma_png(path);
    } catch (const std::runtime_error& fault) {
        throw Refusal(ExitStatus::kConfig, fmt::format("{}: {}", kKey, fault.what()));
    }
}

}  // namespace

ConstImageView<std::uint8_t> read_body_mask(const std::string& text, int width, int height, Arena& arena) {
    if (text.empty()) return {};
    const ImageView<std::uint8_t> mask = arena.image<std::uint8_t>(width, height);
    if (const auto polygons = rig::parse_polygons(text)) {
        for (const rig::Polygon& polygon : *polygons)
            rig::fill_polygon(polygon, mask);
    } else {
        const Image8 picture = read_picture(text);
        if (picture.width != width || picture.height != height)
            throw Refusal(ExitStatus::kConfig,
                          fmt::format("{}: {} is {} x {} px; the rectified left picture is {} x {}", kKey,
                                      text, picture.width, picture.height, width, height));
        copy_pixels<std::uint8_t>(picture.luma(), mask);
    }
    std::int64_t marked = 0;
    for (int y = 0; y < height; ++y)
        marked += width - std::count(mask.row(y), mask.row(y) + width, std::uint8_t{0});
    if (marked == 0 || marked == std::int64_t{width} * height)
        throw Refusal(ExitStatus::kConfig,
                      fmt::format("{}: '{}' marks {} of the {} x {} px: check its coordinates", kKey, text,
                                  marked == 0 ? "none" : "all", width, height));
    return mask;
}

}  // namespace groundline::io
