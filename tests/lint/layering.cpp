#include "lint/layering.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <regex>

namespace groundline::lint {
namespace {

struct Room {
    std::string_view name;
    int level;  // a room may include itself and every room of a lower level
    bool pure;
};
constexpr std::array kRooms = {
    Room{"core", 0, true},      Room{"rig", 1, true},       Room{"stereo", 1, true},
    Room{"terrain", 1, true},   Room{"synth", 1, true},     Room{"verdict", 2, true},
    Room{"pipeline", 3, false}, Room{"io", 4, false},       Room{"capture", 5, false},
    Room{"publish", 5, false},  Room{"settings", 6, false}, Room{"setup", 7, false},
    Room{"cli", 8, false},      Room{"daemon", 8, false}};

// Beginnings of what a pure room must not include.
constexpr std::array<std::string_view, 15> kImpureHeaders = {
    "opencv2/",           "lcm/",   "groundline/", "thread",     "mutex",    "shared_mutex",
    "condition_variable", "future", "fstream",     "filesystem", "iostream", "unordered_map",
    "unordered_set",      "random", "unistd.h"};

// Names that only the C library's own sources of bits have; lround is left out of pure code with them, since
// its call costs what one addition does.
constexpr const char* kTranscendental =
    R"((^|[^\w:.>])(std::|::)?(sin|cos|tan|asin|acos|atan|atan2|sinh|cosh|tanh|asinh|acosh|atanh|exp|exp2|expm1|log|log2|log10|log1p|pow|hypot|cbrt|erf|erfc|tgamma|lgamma|lround|llround|lrint|llrint)[fl]?\s*\()";

constexpr std::array<std::string_view, 6> kMachinePlaces = {"/home/", "/root/",  "/Users/",
                                                            "/mnt/",  "/media/", "../shared"};

const Room* room_of(std::string_view name) {
    const auto* found =
        std::find_if(kRooms.begin(), kRooms.end(), [&](const Room& room) { return room.name == name; });
    return found == kRooms.end() ? nullptr : found;
}

std::string_view first_folder(std::string_view path) {
    const std::size_t slash = path.find('/');
    return slash == std::string_view::npos ? std::string_view{} : path.substr(0, slash);
}

// The text with comments, string and character literals blanked, line breaks kept. Raw strings and digit
// separators are not understood beyond what this repository writes: 1'000 is not taken for a character.
std::string code_only(std::string_view text) {
    std::string code(text);
    enum { kCode, kLine, kBlock, kString, kCharacter } state = kCode;
    for (std::size_t i = 0; i < code.size(); ++i) {
        const char here = text[i];
        const char next = i + 1 < text.size() ? text[i + 1] : '\0';
        const bool after_word = i > 0 && (std::isalnum(static_cast<unsigned char>(text[i - 1])) != 0);
        if (state == kCode) {
            if (here == '/' && next == '/')
                state = kLine;
            else if (here == '/' && next == '*')
                state = kBlock;
            else if (here == '"')
                state = kString;
            else if (here == '\'' && !after_word)
                state = kCharacter;
            if (state == kCode) continue;
            code[i] = ' ';
            if (state == kBlock) code[++i] = ' ';
            continue;
        }
        if (here == '\n') {
            if (state == kLine) state = kCode;
            continue;
        }
        code[i] = ' ';
        if (state == kBlock && here == '*' && next == '/') {
            code[++i] = ' ';
            state = kCode;
        } else if ((state == kString || state == kCharacter) && here == '\\') {
            if (i + 1 < code.size()) code[++i] = ' ';
        } else if ((state == kString && here == '"') || (state == kCharacter && here == '\'')) {
            state = kCode;
        }
    }
    return code;
}

std::vector<std::string_view> lines_of(std::string_view text) {
    std::vector<std::string_view> lines;
    for (std::size_t start = 0; start < text.size();) {
        const std::size_t end = std::min(text.find('\n', start), text.size());
        lines.push_back(text.substr(start, end - start));
        start = end + 1;
    }
    return lines;
}

std::optional<std::string> include_breach(const Room& room, const std::string& target, bool quoted) {
    if (room.pure) {
        for (const std::string_view impure : kImpureHeaders) {
            const bool folder = impure.back() == '/';
            if (folder ? target.starts_with(impure) : target == impure)
                return std::string(room.name) + " is a pure room and must not include " + target;
        }
    }
    if (!quoted) return std::nullopt;
    const std::string_view folder = first_folder(target);
    if (folder == "groundline") return std::nullopt;  // the public and generated headers
    const Room* other = room_of(folder);
    if (other == nullptr) return "include \"" + target + "\" does not start with the name of a room";
    if (other != &room && other->level >= room.level)
        return std::string(room.name) + " must not include " + std::string(other->name) +
               ": arrows point down";
    return std::nullopt;
}

}  // namespace

std::vector<std::string> breaches(std::string_view path, std::string_view text) {
    static const std::regex include(R"(^\s*#\s*include\s*([<"])([^>"]+)[>"])");
    static const std::regex transcendental(kTranscendental);

    std::vector<std::string> found;
    const auto report = [&](std::size_t line, const std::string& sentence) {
        found.push_back(std::string(path) + ":" + std::to_string(line + 1) + ": " + sentence);
    };
    const Room* room = room_of(first_folder(path));
    if (room == nullptr) {
        report(0, "is in no known room");
        return found;
    }
    const std::string code = code_only(text);
    const std::vector<std::string_view> lines = lines_of(text);
    const std::vector<std::string_view> code_lines = lines_of(code);
    const bool own_functions = path.starts_with("core/deterministic_math.");
    for (std::size_t i = 0; i < lines.size(); ++i) {
        const std::string line(lines[i]);
        std::smatch match;
        if (std::regex_search(line, match, include)) {
            if (const auto breach = include_breach(*room, match[2], match[1] == "\"")) report(i, *breach);
        }
        for (const std::string_view place : kMachinePlaces)
            if (line.find(place) != std::string::npos)
                report(i, "names a place on one machine: " + std::string(place));
        const std::string code_line(code_lines[i]);
        if (room->pure && !own_functions && std::regex_search(code_line, match, transcendental))
            report(i, "calls " + match[3].str() + " of the C library, whose bits differ between machines");
    }
    return found;
}

}  // namespace groundline::lint
