#include "io/calibration/source_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>
#include <sstream>

#include "core/error.hpp"

namespace groundline::io {
namespace {

constexpr std::uintmax_t kLargestFile = 1 << 20;

std::string trimmed(std::string_view text) {
    constexpr std::string_view kBlank = " \t\r\n";
    const std::size_t first = text.find_first_not_of(kBlank);
    if (first == std::string_view::npos) return {};
    return std::string(text.substr(first, text.find_last_not_of(kBlank) - first + 1));
}

}  // namespace

SourceText load_text(const std::filesystem::path& path) {
    std::error_code ignored;
    if (!std::filesystem::exists(path, ignored))
        throw Refusal(ExitStatus::kInput,
                      fmt::format("{}: no such calibration file; check the path", path.string()));
    if (!std::filesystem::is_regular_file(path, ignored))
        throw Refusal(ExitStatus::kInput,
                      fmt::format("{}: not a file, expected a calibration", path.string()));
    const std::uintmax_t size = std::filesystem::file_size(path, ignored);
    if (size > kLargestFile)
        refuse(path, 0, fmt::format("{} bytes are too many for a calibration; is it another file?", size));
    std::ifstream file(path, std::ios::binary);
    SourceText source{path, {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()}};
    if (!file || file.bad())
        throw Refusal(ExitStatus::kInput,
                      fmt::format("{}: cannot be read; check its permissions", path.string()));
    const auto is_control = [](char c) {
        return static_cast<unsigned char>(c) < ' ' && c != '\t' && c != '\r' && c != '\n';
    };
    if (std::any_of(source.text.begin(), source.text.end(), is_control))
        refuse(path, 0, "not a text file, expected a calibration");
    if (trimmed(source.text).empty()) refuse(path, 0, "the file is empty, expected a calibration");
    return source;
}

void refuse(const std::filesystem::path& path, int line, const std::string& what) {
    throw Refusal(ExitStatus::kConfig, line > 0 ? fmt::format("{}:{}: {}", path.string(), line, what)
                                                : fmt::format("{}: {}", path.string(), what));
}

std::optional<double> parse_number(std::string_view word) {
    if (word.size() > 1 && word.front() == '+' && word[1] != '-') word.remove_prefix(1);
    double value = 0.0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc{} || end != word.data() + word.size() || !std::isfinite(value))
        return std::nullopt;
    return value;
}

std::vector<KeyedLine> keyed_lines(const SourceText& source, char separator) {
    std::vector<KeyedLine> lines;
    std::istringstream stream(source.text);
    std::string text;
    for (int number = 1; std::getline(stream, text); ++number) {
        const std::string line = trimmed(text);
        if (line.empty() || line.front() == '#') continue;
        const std::size_t at = line.find(separator);
        if (at == std::string::npos)
            refuse(source.path, number,
                   fmt::format("\"{}\" has no '{}', expected key{} value", line.substr(0, 40), separator,
                               separator));
        KeyedLine keyed{number, trimmed(line.substr(0, at)), trimmed(line.substr(at + 1))};
        for (const KeyedLine& earlier : lines)
            if (earlier.key == keyed.key)
                refuse(source.path, number,
                       fmt::format("{} was given in line {} already", keyed.key, earlier.line));
        lines.push_back(std::move(keyed));
    }
    return lines;
}

}  // namespace groundline::io
