// The text of a calibration file, and how to complain about it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace groundline::io {

struct SourceText {
    std::filesystem::path path;
    std::string text;
};

// Throws Refusal: kInput where the file is missing or unreadable, kConfig where it is empty or larger than
// any calibration (1 MB).
SourceText load_text(const std::filesystem::path& path);

// Throws Refusal(kConfig) "path:line: what"; without the line where it is 0.
[[noreturn]] void refuse(const std::filesystem::path& path, int line, const std::string& what);

// The number that `word` is; none for anything else, not-a-number and infinity included.
std::optional<double> parse_number(std::string_view word);

// A line "key<separator>value" of a text file, both trimmed.
struct KeyedLine {
    int line = 0;  // from 1
    std::string key;
    std::string value;
};

// Every line that is neither blank nor a comment (#). Throws Refusal for a line without the separator and for
// a key that comes twice.
std::vector<KeyedLine> keyed_lines(const SourceText& source, char separator);

}  // namespace groundline::io
