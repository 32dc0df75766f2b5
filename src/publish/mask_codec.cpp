#include "publish/mask_codec.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstring>

namespace groundline::publish {
namespace {

constexpr std::size_t cells_along(int pixels, int scale) {
    return (static_cast<std::size_t>(pixels) + static_cast<std::size_t>(scale) - 1) /
           static_cast<std::size_t>(scale);
}
constexpr std::size_t grid_bytes(int width, int height, int scale) {
    return (cells_along(width, scale) * cells_along(height, scale) + 3) / 4;
}

// Class of a cell from the set of classes in it, bit k for class k: the gravest.
constexpr std::array<std::uint8_t, 16> kGravest = [] {
    std::array<std::uint8_t, 16> table{};
    for (unsigned set = 1; set < table.size(); ++set) {
        int worst = -1;
        for (unsigned kind = 0; kind < 4; ++kind) {
            const int weight = gravity(static_cast<TerrainClass>(kind));
            if ((set >> kind & 1U) == 0 || weight <= worst) continue;
            worst = weight;
            table[set] = static_cast<std::uint8_t>(kind);
        }
    }
    return table;
}();

// Writes runs while they fit.
class RunWriter {
  public:
    explicit RunWriter(std::span<std::uint8_t> buffer) : buffer_(buffer) {}

    bool write(std::uint64_t length, std::uint8_t kind) {
        std::uint64_t number = (length - 1) << 2U | kind;
        do {
            if (size_ == buffer_.size()) return false;
            const bool more = number >= 0x80;
            buffer_[size_++] = static_cast<std::uint8_t>((number & 0x7f) | (more ? 0x80U : 0U));
            number >>= 7U;
        } while (number != 0);
        return true;
    }
    std::size_t size() const { return size_; }

  private:
    std::span<std::uint8_t> buffer_;
    std::size_t size_ = 0;
};

// First position from `from` on where `row` is not `kind`, or `width`. Eight pixels at a time: most of a mask
// is long runs.
int end_of_run(const std::uint8_t* row, int from, int width, std::uint8_t kind) {
    const std::uint64_t pattern = 0x0101010101010101ULL * kind;
    int x = from;
    for (; x + 8 <= width; x += 8) {
        std::uint64_t eight = 0;
        std::memcpy(&eight, row + x, sizeof eight);
        if (eight != pattern) break;
    }
    while (x < width && row[x] == kind)
        ++x;
    return x;
}

const std::uint8_t* bytes_of(ConstMask mask, int y) {
    static_assert(sizeof(TerrainClass) == 1);
    return reinterpret_cast<const std::uint8_t*>(mask.row(y));
}

}  // namespace

std::size_t pack_runs(ConstMask mask, std::span<std::uint8_t> buffer) {
    RunWriter writer(buffer);
    std::uint8_t kind = bytes_of(mask, 0)[0];
    std::uint64_t length = 0;
    for (int y = 0; y < mask.height; ++y) {
        const std::uint8_t* row = bytes_of(mask, y);
        for (int x = 0; x < mask.width;) {
            const int end = end_of_run(row, x, mask.width, kind);
            length += static_cast<std::uint64_t>(end - x);
            x = end;
            if (x == mask.width) break;
            if (length > 0 && !writer.write(length, kind)) return 0;
            kind = row[x];
            length = 0;
        }
    }
    return writer.write(length, kind) ? writer.size() : 0;
}

std::size_t pack_grid(ConstMask mask, int scale, std::span<std::uint8_t> buffer) {
    const std::size_t size = grid_bytes(mask.width, mask.height, scale);
    assert(size <= buffer.size());
    std::fill_n(buffer.begin(), size, std::uint8_t{0});
    std::size_t cell = 0;
    for (int top = 0; top < mask.height; top += scale) {
        const int bottom = std::min(top + scale, mask.height);
        for (int left = 0; left < mask.width; left += scale, ++cell) {
            const int right = std::min(left + scale, mask.width);
            unsigned seen = 0;
            for (int y = top; y < bottom; ++y) {
                const std::uint8_t* row = bytes_of(mask, y);
                for (int x = left; x < right; ++x)
                    seen |= 1U << row[x];
            }
            buffer[cell / 4] |= static_cast<std::uint8_t>(kGravest[seen] << (2 * (cell % 4)));
        }
    }
    return size;
}

int grid_scale(int width, int height) {
    int scale = 1;
    while (grid_bytes(width, height, scale) > kMaxMaskBytes)
        ++scale;
    return scale;
}

PackedMask pack_mask(ConstMask mask, std::span<std::uint8_t> buffer) {
    assert(!mask.empty() && buffer.size() >= kMaxMaskBytes);
    const std::span<std::uint8_t> room = buffer.first(kMaxMaskBytes);
    const std::size_t runs = pack_runs(mask, room);
    if (runs > 0) return {MaskEncoding::kRuns, 1, runs};
    const int scale = grid_scale(mask.width, mask.height);
    return {MaskEncoding::kGrid, scale, pack_grid(mask, scale, room)};
}

PackedMask pack_uniform(TerrainClass kind, int width, int height, std::span<std::uint8_t> buffer) {
    RunWriter writer(buffer);
    writer.write(static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height),
                 static_cast<std::uint8_t>(kind));
    return {MaskEncoding::kRuns, 1, writer.size()};
}

}  // namespace groundline::publish
