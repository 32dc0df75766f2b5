// The two pictures people look at: the overlay and the v-disparity image (the paper's figure 5).
#pragma once

#include <array>
#include <cstdint>

#include "core/result.hpp"
#include "io/png.hpp"

namespace groundline::io {

// Blue, green, red.
using Colour = std::array<std::uint8_t, 3>;
inline constexpr Colour kDropColour = {230, 40, 170};        // violet
inline constexpr Colour kGroundLineColour = {40, 40, 255};   // red
inline constexpr Colour kToleranceColour = {190, 140, 255};  // pink
inline constexpr Colour kHorizonColour = {80, 230, 255};     // yellow

// Share of the tint over an obstacle or drop, and of the picture's own light where the class is unknown.
inline constexpr int kTintShare = 150;     // of 256
inline constexpr int kUnknownLight = 140;  // of 256

// Hue of a thing by its true disparity (offset taken off): red for the nearest the search can see, over
// yellow, green and cyan to blue at the far end; by the square root, so that far things differ too.
Colour range_colour(double disparity_px, double largest_px);

// The left image (colour where there is one); obstacles tinted by disparity hue, drops violet, what is not
// known dimmed so that it never looks free, the horizon drawn with its roll, the verdict in a corner.
// `to` is resized; its memory is reused.
void paint_overlay(const FrameResult& result, Image8& to);

// Rows are the image's rows, columns the histogram's bins summed over one pixel (quarters where the picture
// stays no wider than the left image, else whole pixels); brightness goes with the logarithm of the count.
// The ground line at the image's middle column is red, the tolerance above and below it pink.
void paint_v_disparity(const FrameResult& result, Image8& to);

}  // namespace groundline::io
