#include "settings/cpu_list.hpp"

#include <charconv>

namespace groundline::settings {
namespace {

bool parse_cpu(std::string_view text, int& cpu) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), cpu);
    return error == std::errc{} && end == text.data() + text.size() && cpu >= 0 && cpu < kMaxCpus;
}

}  // namespace

std::optional<std::vector<int>> parse_cpu_list(std::string_view text) {
    std::vector<int> cpus;
    while (!text.empty()) {
        const std::size_t comma = text.find(',');
        const std::string_view part = text.substr(0, comma);
        const std::size_t dash = part.find('-');
        int first = 0;
        if (!parse_cpu(part.substr(0, dash), first)) return std::nullopt;
        int last = first;
        if (dash != std::string_view::npos && !parse_cpu(part.substr(dash + 1), last)) return std::nullopt;
        if (last < first || comma == text.size() - 1) return std::nullopt;
        for (int cpu = first; cpu <= last; ++cpu)
            cpus.push_back(cpu);
        text = comma == std::string_view::npos ? std::string_view() : text.substr(comma + 1);
    }
    return cpus;
}

}  // namespace groundline::settings
