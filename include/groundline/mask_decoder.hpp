// Turns the data of a mask_t message back into one class per pixel. Header only, needs nothing but the
// language.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace groundline {

// Refused above this: a damaged message must not make a receiver allocate without bound. 8192 x 8192.
inline constexpr std::int64_t kMaxDecodedPixels = std::int64_t{1} << 26;

namespace mask_decoder_detail {

inline constexpr int kRuns = 1;  // mask_t::ENCODING_RUNS
inline constexpr int kGrid = 2;  // mask_t::ENCODING_GRID

inline bool decode_runs(const std::uint8_t* data, std::size_t size, std::uint8_t* out, std::size_t pixels) {
    std::size_t done = 0;
    std::size_t at = 0;
    while (at < size) {
        std::uint64_t number = 0;
        for (int shift = 0;; shift += 7) {
            if (at == size || shift > 28) return false;
            const std::uint8_t byte = data[at++];
            number |= static_cast<std::uint64_t>(byte & 0x7fU) << static_cast<unsigned>(shift);
            if ((byte & 0x80U) == 0) break;
        }
        const std::uint64_t length = (number >> 2U) + 1;
        if (length > pixels - done) return false;
        const auto value = static_cast<std::uint8_t>(number & 3U);
        for (std::uint64_t i = 0; i < length; ++i)
            out[done++] = value;
    }
    return done == pixels;
}

inline bool decode_grid(std::size_t width, std::size_t height, std::size_t scale, const std::uint8_t* data,
                        std::size_t size, std::uint8_t* out) {
    const std::size_t columns = (width + scale - 1) / scale;
    const std::size_t rows = (height + scale - 1) / scale;
    if (size != (columns * rows + 3) / 4) return false;
    for (std::size_t y = 0; y < height; ++y) {
        const std::size_t first = (y / scale) * columns;
        for (std::size_t x = 0; x < width; ++x) {
            const std::size_t cell = first + x / scale;
            *out++ = static_cast<std::uint8_t>((data[cell / 4] >> (2 * (cell % 4))) & 3U);
        }
    }
    return true;
}

}  // namespace mask_decoder_detail

// Arguments as in mask_t: width, height, scale, encoding, data, size. Writes width * height classes (0
// unknown, 1 traversable, 2 obstacle, 3 drop), row after row, to `out`, which has room for `room` bytes; each
// pixel of a grid gets its cell's class. True only if the data is exactly one mask of that size. Otherwise
// false, and all `room` bytes are 0, unknown. Never reads or writes outside, whatever the arguments say; no
// allocation.
inline bool decode_mask(std::int32_t width, std::int32_t height, std::int32_t scale, std::int32_t encoding,
                        const std::uint8_t* data, std::size_t size, std::uint8_t* out, std::size_t room) {
    const std::int64_t pixels =
        width > 0 && height > 0 ? static_cast<std::int64_t>(width) * static_cast<std::int64_t>(height) : 0;
    bool good = pixels > 0 && pixels <= kMaxDecodedPixels && static_cast<std::uint64_t>(pixels) <= room;
    if (good && encoding == mask_decoder_detail::kRuns) {
        good =
            scale == 1 && mask_decoder_detail::decode_runs(data, size, out, static_cast<std::size_t>(pixels));
    } else if (good && encoding == mask_decoder_detail::kGrid) {
        good = scale > 0 && mask_decoder_detail::decode_grid(
                                static_cast<std::size_t>(width), static_cast<std::size_t>(height),
                                static_cast<std::size_t>(scale), data, size, out);
    } else {
        good = false;
    }
    if (!good)
        for (std::size_t i = 0; i < room; ++i)
            out[i] = 0;
    return good;
}

// The same for a received groundline::mask_t (a template, so that this header needs no LCM). `out` gets width
// * height classes, or becomes empty when the result is false. Allocates only when `out` must grow.
template <typename MaskMessage>
bool decode_mask(const MaskMessage& message, std::vector<std::uint8_t>& out) {
    out.clear();
    if (message.width <= 0 || message.height <= 0 || message.size < 0) return false;
    if (static_cast<std::size_t>(message.size) > message.data.size()) return false;
    const std::int64_t pixels =
        static_cast<std::int64_t>(message.width) * static_cast<std::int64_t>(message.height);
    if (pixels > kMaxDecodedPixels) return false;
    out.resize(static_cast<std::size_t>(pixels));
    const bool good =
        decode_mask(message.width, message.height, message.scale, message.encoding, message.data.data(),
                    static_cast<std::size_t>(message.size), out.data(), out.size());
    if (!good) out.clear();
    return good;
}

}  // namespace groundline
