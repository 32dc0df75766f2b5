#include "io/stamps.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <chrono>
#include <cmath>
#include <fstream>

#include "core/error.hpp"

namespace groundline::io {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

std::string_view trimmed(std::string_view text) {
    const auto space = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
    while (!text.empty() && space(text.front()))
        text.remove_prefix(1);
    while (!text.empty() && space(text.back()))
        text.remove_suffix(1);
    return text;
}

template <typename T>
std::optional<T> number_of(std::string_view text) {
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
    return value;
}

// The digits of a text of digits and nothing else.
std::optional<std::int64_t> digits_of(std::string_view text) {
    const auto digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
    if (text.empty() || !std::all_of(text.begin(), text.end(), digit)) return std::nullopt;
    return number_of<std::int64_t>(text);
}

// "YYYY-MM-DD HH:MM:SS[.fraction]"; digits beyond the nanosecond are cut off.
std::optional<std::int64_t> date_of(std::string_view text) {
    if (text.size() < 19 || text[4] != '-' || text[7] != '-' || text[10] != ' ' || text[13] != ':' ||
        text[16] != ':')
        return std::nullopt;
    const auto year = digits_of(text.substr(0, 4)), month = digits_of(text.substr(5, 2)),
               day = digits_of(text.substr(8, 2)), hour = digits_of(text.substr(11, 2)),
               minute = digits_of(text.substr(14, 2)), second = digits_of(text.substr(17, 2));
    if (!year || !month || !day || !hour || !minute || !second) return std::nullopt;
    const std::chrono::year_month_day date{std::chrono::year(static_cast<int>(*year)),
                                           std::chrono::month(static_cast<unsigned>(*month)),
                                           std::chrono::day(static_cast<unsigned>(*day))};
    if (!date.ok() || *hour > 23 || *minute > 59 || *second > 60) return std::nullopt;
    std::int64_t fraction_ns = 0;
    if (text.size() > 19) {
        std::string digits(text.substr(20));
        if (text[19] != '.' || digits.empty() || !digits_of(digits.substr(0, 18))) return std::nullopt;
        digits.resize(9, '0');
        fraction_ns = *digits_of(digits);
    }
    const std::int64_t days = std::chrono::sys_days(date).time_since_epoch().count();
    return (((days * 24 + *hour) * 60 + *minute) * 60 + *second) * kSecond + fraction_ns;
}

std::optional<std::int64_t> seconds_of(std::string_view text) {
    const auto seconds = number_of<double>(text);
    if (!seconds || !std::isfinite(*seconds) || std::fabs(*seconds) > 9e9) return std::nullopt;
    return static_cast<std::int64_t>(std::floor(*seconds * 1e9 + 0.5));
}

[[noreturn]] void refuse(const std::filesystem::path& file, int line, const std::string& why) {
    throw Refusal(ExitStatus::kInput, fmt::format("{}:{}: {}", file.string(), line, why));
}

std::ifstream open_text(const std::filesystem::path& file) {
    std::ifstream text(file);
    if (!text)
        throw Refusal(ExitStatus::kInput,
                      fmt::format("cannot read '{}'; expected time stamps", file.string()));
    return text;
}

}  // namespace

std::optional<std::int64_t> stamp_of_name(const std::filesystem::path& file) {
    const std::string stem = file.stem().string();
    return stem.size() == 19 ? digits_of(stem) : std::nullopt;
}

std::vector<std::int64_t> read_kitti_stamps(const std::filesystem::path& file) {
    std::ifstream text = open_text(file);
    std::vector<std::int64_t> stamps;
    int number = 0;
    for (std::string line; std::getline(text, line);) {
        ++number;
        const std::string_view content = trimmed(line);
        if (content.empty()) continue;
        std::optional<std::int64_t> stamp = date_of(content);
        if (!stamp) stamp = seconds_of(content);
        if (!stamp)
            refuse(file, number,
                   fmt::format("'{}' is no time stamp; expected 2011-09-26 13:02:25.594360375 or seconds",
                               content));
        stamps.push_back(*stamp);
    }
    return stamps;
}

std::vector<StampedFile> read_euroc_csv(const std::filesystem::path& file) {
    std::ifstream text = open_text(file);
    std::vector<StampedFile> entries;
    int number = 0;
    for (std::string line; std::getline(text, line);) {
        ++number;
        const std::string_view content = trimmed(line);
        if (content.empty() || content.front() == '#') continue;
        const std::size_t comma = content.find(',');
        const auto stamp = digits_of(trimmed(content.substr(0, comma)));
        const std::string_view name =
            comma == std::string_view::npos ? std::string_view{} : trimmed(content.substr(comma + 1));
        if (!stamp || name.empty())
            refuse(file, number, fmt::format("expected 'stamp in ns, image file', found '{}'", content));
        if (!entries.empty() && *stamp <= entries.back().stamp_ns)
            refuse(file, number, "the stamp does not increase; expected the images in the order of exposure");
        entries.push_back({*stamp, std::string(name)});
    }
    return entries;
}

}  // namespace groundline::io
