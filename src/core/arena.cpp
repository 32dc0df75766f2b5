#include "core/arena.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>

namespace groundline {

void Arena::Free::operator()(std::byte* block) const {
    ::operator delete (block, std::align_val_t{kRowAlignment});
}

std::size_t Arena::padded_row_bytes(std::size_t row_bytes) {
    return (row_bytes + kRowPadding + kRowAlignment - 1) / kRowAlignment * kRowAlignment;
}

BgrView Arena::bgr_image(int width, int height) {
    const ImageView<std::uint8_t> bytes = image<std::uint8_t>(width * 3, height);
    return {bytes.data, width, height, bytes.stride};
}

void* Arena::take_bytes(std::size_t bytes) {
    if (sealed_) {
        std::fprintf(stderr, "groundline: memory asked for after start-up: a fault in this program\n");
        std::abort();
    }
    const std::size_t padded = padded_row_bytes(bytes);
    auto* block = static_cast<std::byte*>(::operator new (padded, std::align_val_t{kRowAlignment}));
    // Zeroing also faults the pages in, so the first frame pays no page fault.
    std::memset(block, 0, padded);
    blocks_.emplace_back(block);
    bytes_ += padded;
    return block;
}

}  // namespace groundline
