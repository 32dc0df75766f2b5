// Reads a video whose frames hold the left view in their left half and the right view in their right half.
#pragma once

#include <filesystem>
#include <memory>

#include "io/pair_reader.hpp"

namespace groundline::io {

// Stamps come from the container's frame rate. Throws Refusal(kInput): no video that can be decoded, no first
// frame, odd width.
std::unique_ptr<PairReader> open_video(const std::filesystem::path& path);

}  // namespace groundline::io
