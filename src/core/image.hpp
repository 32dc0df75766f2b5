// Views of two-dimensional pixel memory: a pointer, a size and a row stride; they own nothing.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace groundline {

// Every row that the arena hands out starts on a multiple of this, so that kernels may load whole vectors.
inline constexpr std::size_t kRowAlignment = 64;

// Bytes behind the last pixel of a row that may be read and written but mean nothing (the padding contract).
// They are never part of a result: a kernel may leave anything in them.
inline constexpr std::size_t kRowPadding = 64;

// Pixels of type T, `width` by `height`; row y starts `stride` elements after row y - 1.
// Copying a view copies no pixel. A view of T converts to a view of const T.
template <typename T>
struct ImageView {
    T* data = nullptr;
    int width = 0;
    int height = 0;
    std::ptrdiff_t stride = 0;

    ImageView() = default;
    ImageView(T* first, int width_px, int height_px, std::ptrdiff_t stride_elements)
        : data(first), width(width_px), height(height_px), stride(stride_elements) {}

    template <typename U>
    requires(std::is_same_v<T, const U>)
        ImageView(const ImageView<U>& other)  // NOLINT: implicit on purpose, like T* to const T*
        : data(other.data), width(other.width), height(other.height), stride(other.stride) {}

    T* row(int y) const {
        assert(y >= 0 && y < height);
        return data + y * stride;
    }
    T& at(int x, int y) const {
        assert(x >= 0 && x < width);
        return row(y)[x];
    }
    bool empty() const { return width == 0 || height == 0; }
    bool same_size(int w, int h) const { return width == w && height == h; }
};

template <typename T>
using ConstImageView = ImageView<const T>;

using Luma = ImageView<std::uint8_t>;
using ConstLuma = ConstImageView<std::uint8_t>;

// Three bytes a pixel, blue green red; `width` counts pixels, `stride` counts bytes.
struct BgrView {
    std::uint8_t* data = nullptr;
    int width = 0;
    int height = 0;
    std::ptrdiff_t stride = 0;

    std::uint8_t* row(int y) const {
        assert(y >= 0 && y < height);
        return data + y * stride;
    }
    bool empty() const { return width == 0 || height == 0; }
};

// Luma of a colour pixel, the same for every source: (77 R + 150 G + 29 B + 128) >> 8.
constexpr std::uint8_t luma_of(unsigned red, unsigned green, unsigned blue) {
    return static_cast<std::uint8_t>((77U * red + 150U * green + 29U * blue + 128U) >> 8U);
}

// Copies the pixels of `from` into `to`; both must have the same size. Padding is not copied.
template <typename T>
void copy_pixels(ImageView<const std::type_identity_t<T>> from, ImageView<T> to) {
    assert(from.same_size(to.width, to.height));
    for (int y = 0; y < to.height; ++y) {
        const T* source = from.row(y);
        T* target = to.row(y);
        for (int x = 0; x < to.width; ++x)
            target[x] = source[x];
    }
}

// Sets every pixel of `image` to `value`.
template <typename T>
void fill_pixels(ImageView<T> image, std::type_identity_t<T> value) {
    for (int y = 0; y < image.height; ++y) {
        T* target = image.row(y);
        for (int x = 0; x < image.width; ++x)
            target[x] = value;
    }
}

}  // namespace groundline
