// The folders with truth that a suite is made of.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace groundline::cli {

// Every folder in `suite` with disp.png or disp/ in it, sorted; of them those that a word of `wanted` fits,
// all for none. A word with * ? or [ is a pattern as in a shell, any other the beginning of a name. Throws
// Refusal(kInput) where the suite cannot be read, holds no truth, or a word fits no set.
std::vector<std::filesystem::path> truth_sets(const std::filesystem::path& suite,
                                              const std::vector<std::string>& wanted);

}  // namespace groundline::cli
