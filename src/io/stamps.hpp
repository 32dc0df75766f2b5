// Reads the time stamp files of recorded data sets.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace groundline::io {

// A file name of 19 digits (before its extension) is a stamp in ns since the epoch.
std::optional<std::int64_t> stamp_of_name(const std::filesystem::path& file);

// KITTI's timestamps.txt ("2011-09-26 13:02:25.594360375", local time there, taken as UTC) or times.txt
// ("1.036224e-01", seconds since the start), one stamp a line, told line by line. In ns.
// Throws Refusal(kInput) with file:line.
std::vector<std::int64_t> read_kitti_stamps(const std::filesystem::path& file);

struct StampedFile {
    std::int64_t stamp_ns = 0;
    std::string name;
};
// EuRoC's data.csv: "stamp [ns], file name" a line, '#' starts a comment; stamps must increase.
// Throws Refusal(kInput) with file:line.
std::vector<StampedFile> read_euroc_csv(const std::filesystem::path& file);

}  // namespace groundline::io
