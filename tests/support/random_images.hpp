// Luma images from fixed seeds, and the comparisons that tests of pixels share.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "core/image.hpp"

namespace groundline::test {

// An image that owns its pixels. `extra` elements at the end of each row, and the padding behind the last,
// are filled with a value that no result may depend on.
class OwnedLuma {
  public:
    OwnedLuma(int width, int height, int extra = 0)
        : width_(width),
          height_(height),
          stride_(width + extra),
          pixels_(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(height) + kRowPadding,
                  std::uint8_t{0xA5}) {}
    Luma view() { return {pixels_.data(), width_, height_, stride_}; }
    ConstLuma view() const { return {pixels_.data(), width_, height_, stride_}; }
    std::uint8_t& at(int x, int y) { return view().at(x, y); }
    std::uint8_t at(int x, int y) const { return view().at(x, y); }
    int width() const { return width_; }
    int height() const { return height_; }

    // Every pixel from function(x, y), clamped to 0 .. 255.
    template <typename Function>
    void fill(Function function) {
        for (int y = 0; y < height_; ++y)
            for (int x = 0; x < width_; ++x)
                at(x, y) = static_cast<std::uint8_t>(std::clamp<int>(function(x, y), 0, 255));
    }

  private:
    int width_;
    int height_;
    int stride_;
    std::vector<std::uint8_t> pixels_;
};

// Every pixel independent, uniform over lowest .. highest.
inline OwnedLuma noise_image(int width, int height, std::uint32_t seed, int lowest = 0, int highest = 255,
                             int extra = 0) {
    std::mt19937 random(seed);
    OwnedLuma image(width, height, extra);
    const auto range = static_cast<std::uint32_t>(highest - lowest + 1);
    image.fill([&](int, int) { return lowest + static_cast<int>(random() % range); });
    return image;
}

// Texture of several sizes like a natural surface: noise smoothed over 1, 3 and 9 px and added, 8 .. 247.
inline OwnedLuma textured_image(int width, int height, std::uint32_t seed, int extra = 0) {
    std::vector<int> sum(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
    std::uint32_t octave = 0;
    for (const int reach : {0, 1, 4}) {
        const OwnedLuma noise = noise_image(width + 2 * reach, height + 2 * reach, seed * 7919U + octave++);
        const int side = 2 * reach + 1;
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                int total = 0;
                for (int j = 0; j < side; ++j)
                    for (int i = 0; i < side; ++i)
                        total += noise.at(x + i, y + j) - 128;
                // A mean over side^2 pixels loses contrast as 1 / side; this gives each size the same.
                sum[static_cast<std::size_t>(y * width + x)] += total / side;
            }
    }
    OwnedLuma image(width, height, extra);
    image.fill([&](int x, int y) {
        return std::clamp(128 + sum[static_cast<std::size_t>(y * width + x)] / 2, 8, 247);
    });
    return image;
}

struct OwnedPair {
    OwnedLuma left;
    OwnedLuma right;
};

// left(x, y) = right(x - disparity(x, y), y) for every pixel, cut out of a texture wider than the picture;
// disparities -kMargin .. kMargin.
template <typename Disparity>
OwnedPair warped_pair(int width, int height, std::uint32_t seed, Disparity disparity, int extra = 0) {
    constexpr int kMargin = 300;
    const OwnedLuma texture = textured_image(width + 2 * kMargin, height, seed);
    OwnedPair pair{OwnedLuma(width, height, extra), OwnedLuma(width, height, extra)};
    pair.right.fill([&](int x, int y) { return texture.at(x + kMargin, y); });
    pair.left.fill([&](int x, int y) { return texture.at(x - disparity(x, y) + kMargin, y); });
    return pair;
}

// A pair with one disparity everywhere.
inline OwnedPair shifted_pair(int width, int height, std::uint32_t seed, int disparity, int extra = 0) {
    return warped_pair(
        width, height, seed, [=](int, int) { return disparity; }, extra);
}

// Adds independent noise, uniform over -amplitude .. amplitude.
inline void add_noise(OwnedLuma& image, std::uint32_t seed, int amplitude) {
    std::mt19937 random(seed);
    const auto range = static_cast<std::uint32_t>(2 * amplitude + 1);
    image.fill([&](int x, int y) { return image.at(x, y) + static_cast<int>(random() % range) - amplitude; });
}

// gain * pixel + offset, rounded.
inline void change_exposure(OwnedLuma& image, double gain, int offset) {
    image.fill([&](int x, int y) { return static_cast<int>(gain * image.at(x, y) + offset + 0.5); });
}

}  // namespace groundline::test
