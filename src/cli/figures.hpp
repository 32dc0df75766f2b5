// What the tables of `groundline evaluate` are made of: shares that may be absent, and aligned columns.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace groundline::cli {

using Figure = std::optional<double>;  // none: there was nothing to measure

Figure share(std::int64_t part, std::int64_t whole);

// Rounded to six decimals, which are enough for every figure and keep the last bits of a division out of the
// text; null for none.
nlohmann::ordered_json number(const Figure& figure);

// One line of text each, the first `left` columns flush left, the others flush right. All of one length; no
// spaces at an end.
std::string aligned(const std::vector<std::vector<std::string>>& lines, std::size_t left);

}  // namespace groundline::cli
