// A file that is there whole or not at all.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

namespace groundline::io {

// Writes `.NAME.tmp` beside `path`, then renames it over `path`; leaves no temporary file when it fails. Not
// synchronised to the disk: it guards against a killed program, not against a power cut. Any thread.
// Throws std::runtime_error with a sentence that names the path.
void write_file_whole(const std::filesystem::path& path, std::span<const std::uint8_t> bytes);
void write_file_whole(const std::filesystem::path& path, std::string_view text);

// The whole file into `bytes`, whose memory is reused. Throws std::runtime_error, the sentence begins
// "cannot read 'PATH': " and says missing, no file, or the system's reason.
void read_file_whole(const std::filesystem::path& path, std::vector<std::uint8_t>& bytes);

}  // namespace groundline::io
