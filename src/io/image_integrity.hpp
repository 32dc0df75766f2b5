// Tells what is wrong with an encoded image before a decoder sees it.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace groundline::io {

// For people: the still formats that are read.
inline constexpr std::string_view kImageFormats = "PNG, JPEG, PGM/PPM, TIFF or BMP";

// True when the bytes begin like one of kImageFormats.
bool looks_like_image(std::span<const std::uint8_t> bytes);

// Empty when nothing is wrong, else the rest of a sentence: "the file is empty", "it is not ...", "the JPEG
// data end too early (truncated file)". PNG and JPEG are walked to their end mark; BMP and binary PGM/PPM are
// held against the size in their header. Decoders fill what is missing with grey (JPEG) or print lines of
// their own to stderr (PNG, BMP, PGM/PPM). TIFF is left to its decoder.
std::string image_fault(std::span<const std::uint8_t> bytes);

}  // namespace groundline::io
