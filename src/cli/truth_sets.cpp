#include "cli/truth_sets.hpp"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <system_error>

#include "core/error.hpp"

namespace groundline::cli {
namespace {

namespace fs = std::filesystem;

bool fits(const fs::path& set, const std::string& word) {
    const std::string pattern = word.find_first_of("*?[") == std::string::npos ? word + "*" : word;
    return ::fnmatch(pattern.c_str(), set.filename().c_str(), 0) == 0;
}

}  // namespace

std::vector<fs::path> truth_sets(const fs::path& suite, const std::vector<std::string>& wanted) {
    std::error_code error;
    std::vector<fs::path> sets;
    for (fs::directory_iterator entry(suite, error), end; !error && entry != end; entry.increment(error)) {
        std::error_code ignored;
        if (fs::is_regular_file(entry->path() / "disp.png", ignored) ||
            fs::is_directory(entry->path() / "disp", ignored))
            sets.push_back(entry->path());
    }
    if (error)
        throw Refusal(ExitStatus::kInput,
                      fmt::format("cannot read the folder '{}': {}", suite.string(), error.message()));
    if (sets.empty())
        throw Refusal(ExitStatus::kInput,
                      fmt::format("no folder in '{}' holds truth; expected folders with disp.png "
                                  "or disp/ in them",
                                  suite.string()));
    for (const std::string& word : wanted)
        if (std::none_of(sets.begin(), sets.end(), [&](const fs::path& set) { return fits(set, word); }))
            throw Refusal(
                ExitStatus::kInput,
                fmt::format("--sets {}: no folder with truth in '{}' is called so", word, suite.string()));
    if (!wanted.empty())
        std::erase_if(sets, [&](const fs::path& set) {
            return std::none_of(wanted.begin(), wanted.end(),
                                [&](const std::string& word) { return fits(set, word); });
        });
    std::sort(sets.begin(), sets.end());
    return sets;
}

}  // namespace groundline::cli
