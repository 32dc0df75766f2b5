#include "terrain/outline.hpp"

#include <algorithm>

namespace groundline::terrain {
namespace {

using Bytes = ImageView<std::uint8_t>;

// out = in widened by reach px to both sides along the rows (1), or shrunk (0 widened).
void spread_rows(Bytes in, Bytes out, int reach, std::uint8_t value) {
    for (int v = 0; v < in.height; ++v) {
        const std::uint8_t* from = in.row(v);
        std::uint8_t* to = out.row(v);
        int last = -1000000;
        for (int u = 0; u < in.width; ++u) {
            if (from[u] == value) last = u;
            to[u] = u - last <= reach ? value : static_cast<std::uint8_t>(1 - value);
        }
        int next = 1000000;
        for (int u = in.width - 1; u >= 0; --u) {
            if (from[u] == value) next = u;
            if (next - u <= reach) to[u] = value;
        }
    }
}

void spread_columns(Bytes in, Bytes out, int reach, std::uint8_t value) {
    for (int v = 0; v < in.height; ++v) {
        std::uint8_t* to = out.row(v);
        std::copy_n(in.row(v), in.width, to);
        for (int w = std::max(0, v - reach); w <= std::min(in.height - 1, v + reach); ++w) {
            const std::uint8_t* from = in.row(w);
            if (value == 1)
                for (int u = 0; u < in.width; ++u)
                    to[u] = static_cast<std::uint8_t>(to[u] | from[u]);
            else
                for (int u = 0; u < in.width; ++u)
                    to[u] = static_cast<std::uint8_t>(to[u] & from[u]);
        }
    }
}

}  // namespace

void Outline::take(Arena& arena, int width, int height) {
    width_ = width;
    height_ = height;
    marks_ = arena.image<std::uint8_t>(width, height);
    across_ = arena.image<std::uint8_t>(width, height);
    along_ = arena.image<std::uint8_t>(width, height);
}

void Outline::apply(int gap_px, int blur_px, ConstImageView<Invalid> invalid, Mask mask) {
    for (int v = 0; v < height_; ++v)
        for (int u = 0; u < width_; ++u)
            marks_.at(u, v) = mask.at(u, v) == TerrainClass::kObstacle ? 1 : 0;
    spread_rows(marks_, across_, gap_px, 1);
    spread_rows(across_, along_, gap_px, 0);
    for (int v = 0; v < height_; ++v)
        for (int u = 0; u < width_; ++u)
            if (along_.at(u, v) == 1 && invalid.at(u, v) != Invalid::kNone &&
                mask.at(u, v) == TerrainClass::kUnknown)
                mask.at(u, v) = TerrainClass::kObstacle;
    spread_columns(marks_, across_, gap_px, 1);
    spread_columns(across_, along_, gap_px, 0);
    for (int v = 0; v < height_; ++v)
        for (int u = 0; u < width_; ++u)
            if (along_.at(u, v) == 1 && invalid.at(u, v) != Invalid::kNone &&
                mask.at(u, v) == TerrainClass::kUnknown)
                mask.at(u, v) = TerrainClass::kObstacle;
    for (int v = 0; v < height_; ++v)
        for (int u = 0; u < width_; ++u)
            marks_.at(u, v) =
                mask.at(u, v) == TerrainClass::kObstacle || mask.at(u, v) == TerrainClass::kDrop ? 1 : 0;
    spread_rows(marks_, across_, blur_px, 1);
    spread_columns(across_, along_, blur_px, 1);
    for (int v = 0; v < height_; ++v)
        for (int u = 0; u < width_; ++u)
            if (along_.at(u, v) == 1 && mask.at(u, v) == TerrainClass::kTraversable)
                mask.at(u, v) = TerrainClass::kUnknown;
}

}  // namespace groundline::terrain
