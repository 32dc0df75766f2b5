#include "rig/repeats.hpp"

#include <cassert>
#include <cstddef>
#include <cstring>
#include <limits>

namespace groundline::rig {
namespace {

constexpr int kRowStep = 8;

// Each step is a bijection of the sum, so that pictures which differ in one word never share theirs by it
// alone.
std::uint64_t mixed(std::uint64_t sum, std::uint64_t word) {
    sum = (sum ^ word) * 0x9E3779B97F4A7C15ULL;
    return sum ^ (sum >> 29U);
}

std::uint64_t mixed_rows(std::uint64_t sum, ConstLuma image) {
    for (int y = 0; y < image.height; y += kRowStep) {
        const std::uint8_t* row = image.row(y);
        constexpr int kWord = 8;
        int x = 0;
        for (; x + kWord <= image.width; x += kWord) {
            std::uint64_t word = 0;
            std::memcpy(&word, row + x, kWord);
            sum = mixed(sum, word);
        }
        for (; x < image.width; ++x)
            sum = mixed(sum, row[x]);
    }
    return sum;
}

}  // namespace

bool identical(ConstLuma left, ConstLuma right) {
    assert(left.same_size(right.width, right.height));
    for (int y = 0; y < left.height; ++y)
        if (std::memcmp(left.row(y), right.row(y), static_cast<std::size_t>(left.width)) != 0) return false;
    return true;
}

int RepeatCounter::count(ConstLuma left, ConstLuma right) {
    const std::uint64_t sum = mixed_rows(mixed_rows(0, left), right);
    if (same_ == 0 || sum != last_)
        same_ = 1;
    else if (same_ < std::numeric_limits<int>::max())
        ++same_;
    last_ = sum;
    return same_;
}

}  // namespace groundline::rig
