// Packs a mask into the bytes of a mask_t message. The format is specified in lcmtypes/mask_t.lcm, its
// inverse is include/groundline/mask_decoder.hpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/terrain_class.hpp"

namespace groundline::publish {

// A UDP datagram of LCM carries channel name, its NUL and message in 65499 bytes; names have at most 63. That
// leaves 435 bytes for the other fields of mask_t, whatever the channel is called: so the packing depends on
// the mask alone.
inline constexpr std::size_t kMaxMaskBytes = 65'000;

enum class MaskEncoding : std::uint8_t { kRuns = 1, kGrid = 2 };

struct PackedMask {
    MaskEncoding encoding = MaskEncoding::kRuns;
    int scale = 1;
    std::size_t size = 0;  // bytes used of the buffer
};

// Gravity of a class where several share a cell: obstacle > drop > unknown > traversable.
constexpr int gravity(TerrainClass kind) {
    switch (kind) {
        case TerrainClass::kObstacle:
            return 3;
        case TerrainClass::kDrop:
            return 2;
        case TerrainClass::kTraversable:
            return 0;
        default:
            return 1;
    }
}

// Smallest cell edge in px with which the grid form of a mask of that size takes at most kMaxMaskBytes.
int grid_scale(int width, int height);

// Runs at full resolution if they take at most kMaxMaskBytes, else the grid with grid_scale(). `buffer` has
// at least kMaxMaskBytes, the mask at least one pixel. No allocation; a function of the classes alone.
PackedMask pack_mask(ConstMask mask, std::span<std::uint8_t> buffer);

// The two forms by themselves; runs return 0 where they need more than the buffer holds.
std::size_t pack_runs(ConstMask mask, std::span<std::uint8_t> buffer);
std::size_t pack_grid(ConstMask mask, int scale, std::span<std::uint8_t> buffer);

// One run over the whole of a mask that is `kind` everywhere: what pack_mask makes of it.
PackedMask pack_uniform(TerrainClass kind, int width, int height, std::span<std::uint8_t> buffer);

}  // namespace groundline::publish
