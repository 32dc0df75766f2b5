// The driver for images and videos in files.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/frame_source.hpp"
#include "io/pair_reader.hpp"

namespace groundline::capture {

// Everything io/pair_reader.hpp opens. Throws Refusal(kInput) with the file and what was expected.
std::unique_ptr<FrameSource> open_files(const std::vector<std::string>& source);
// The same for a reader that is already open.
std::unique_ptr<FrameSource> files_source(std::unique_ptr<io::PairReader> reader);

}  // namespace groundline::capture
