// Lists of processors as operators write them: 0,2-3.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

namespace groundline::settings {

inline constexpr int kMaxCpus = 1024;  // what the kernel's fixed set holds

// The numbers named, in the order written; empty for an empty text; nothing where it is not such a list.
std::optional<std::vector<int>> parse_cpu_list(std::string_view text);

}  // namespace groundline::settings
