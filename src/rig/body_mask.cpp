#include "rig/body_mask.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>

namespace groundline::rig {
namespace {

constexpr std::string_view kBlanks = " \t\r\n";

// Takes everything up to `end` (or all) off the front of `text`.
std::string_view take_until(std::string_view& text, char end) {
    const std::size_t at = text.find(end);
    const std::string_view taken = text.substr(0, at);
    text.remove_prefix(at == std::string_view::npos ? text.size() : at + 1);
    return taken;
}

std::string_view take_word(std::string_view& text) {
    text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
    const std::string_view word = text.substr(0, text.find_first_of(kBlanks));
    text.remove_prefix(word.size());
    return word;
}

bool parse(std::string_view text, double& value) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc{} && end == text.data() + text.size() && std::isfinite(value);
}

}  // namespace

std::optional<std::vector<Polygon>> parse_polygons(std::string_view text) {
    std::vector<Polygon> polygons;
    while (!text.empty()) {
        std::string_view words = take_until(text, ';');
        Polygon polygon;
        for (std::string_view word = take_word(words); !word.empty(); word = take_word(words)) {
            Corner corner{};
            const std::string_view x = take_until(word, ',');
            if (!parse(x, corner.x) || !parse(word, corner.y)) return std::nullopt;
            polygon.push_back(corner);
        }
        if (polygon.size() < 3) return std::nullopt;
        polygons.push_back(std::move(polygon));
    }
    if (polygons.empty()) return std::nullopt;
    return polygons;
}

void fill_polygon(const Polygon& polygon, ImageView<std::uint8_t> mask) {
    std::vector<double> crossings;
    for (int y = 0; y < mask.height; ++y) {
        crossings.clear();
        for (std::size_t i = 0; i < polygon.size(); ++i) {
            const Corner& a = polygon[i];
            const Corner& b = polygon[(i + 1) % polygon.size()];
            if ((a.y <= y) == (b.y <= y)) continue;
            crossings.push_back(a.x + (y - a.y) * (b.x - a.x) / (b.y - a.y));
        }
        std::sort(crossings.begin(), crossings.end());
        for (std::size_t i = 0; i + 1 < crossings.size(); i += 2) {
            const int first = static_cast<int>(std::clamp(std::ceil(crossings[i]), 0.0, 1.0 * mask.width));
            const int end = static_cast<int>(std::clamp(std::ceil(crossings[i + 1]), 0.0, 1.0 * mask.width));
            std::fill(mask.row(y) + first, mask.row(y) + std::max(first, end), std::uint8_t{1});
        }
    }
}

}  // namespace groundline::rig
