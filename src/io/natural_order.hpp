// Orders file names as people count: numbers inside names by their value.
#pragma once

#include <cctype>
#include <cstddef>
#include <string_view>

namespace groundline::io {

// Total order: "2.png" before "10.png"; names of equal numbers ("02", "2") and equal rest by their bytes.
// Equal to the order of bytes where numbers have leading zeros to one length.
inline bool natural_less(std::string_view a, std::string_view b) {
    const auto digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
    const auto number = [&](std::string_view text, std::size_t& at) {
        while (at + 1 < text.size() && text[at] == '0' && digit(text[at + 1]))
            ++at;
        const std::size_t first = at;
        while (at < text.size() && digit(text[at]))
            ++at;
        return text.substr(first, at - first);
    };
    std::size_t i = 0, j = 0;
    while (i < a.size() && j < b.size()) {
        if (digit(a[i]) && digit(b[j])) {
            const std::string_view left = number(a, i), right = number(b, j);
            if (left.size() != right.size()) return left.size() < right.size();
            if (left != right) return left < right;
        } else if (a[i] != b[j]) {
            return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[j]);
        } else {
            ++i, ++j;
        }
    }
    const std::size_t rest_a = a.size() - i, rest_b = b.size() - j;
    return rest_a != rest_b ? rest_a < rest_b : a < b;
}

}  // namespace groundline::io
