#include "cli/perturbation.hpp"

#include <algorithm>
#include <array>
#include <cassert>

namespace groundline::cli {
namespace {

std::uint8_t clamped(int level) {
    return static_cast<std::uint8_t>(std::clamp(level, 0, 255));
}

// SplitMix64's output function: every bit of the argument turns about half of the bits of the result.
std::uint64_t mixed(std::uint64_t bits) {
    bits = (bits ^ (bits >> 30U)) * 0xBF58476D1CE4E5B9U;
    bits = (bits ^ (bits >> 27U)) * 0x94D049BB133111EBU;
    return bits ^ (bits >> 31U);
}

// Numbers of mean 0 and standard deviation 65536.
class Deviations {
  public:
    explicit Deviations(std::uint64_t seed) : state_(seed) {}
    int next() {
        // Twelve uniform over 0 .. 65535: the mean of the sum is 12 * 32767.5, its variance 65536^2 - 1.
        int sum = -12 * 65535 / 2;
        for (int word = 0; word < 3; ++word) {
            state_ += 0x9E3779B97F4A7C15U;
            std::uint64_t bits = mixed(state_);
            for (int part = 0; part < 4; ++part, bits >>= 16U)
                sum += static_cast<int>(bits & 0xFFFFU);
        }
        return sum;
    }

  private:
    std::uint64_t state_;
};

}  // namespace

void change_exposure(ConstLuma from, int gain_percent, int offset, Luma to) {
    assert(from.same_size(to.width, to.height) && gain_percent >= 0);
    std::array<std::uint8_t, 256> levels{};
    for (int level = 0; level < 256; ++level)
        levels[static_cast<std::size_t>(level)] = clamped((gain_percent * level + 50) / 100 + offset);
    for (int y = 0; y < from.height; ++y)
        for (int x = 0; x < from.width; ++x)
            to.at(x, y) = levels[from.at(x, y)];
}

void add_noise(ConstLuma from, int sigma, std::uint64_t seed, Luma to) {
    assert(from.same_size(to.width, to.height) && sigma >= 0 && sigma <= 255);
    Deviations deviations(seed);
    for (int y = 0; y < from.height; ++y)
        for (int x = 0; x < from.width; ++x)
            to.at(x, y) = clamped(from.at(x, y) + ((sigma * deviations.next() + 32768) >> 16));
}

std::uint64_t noise_seed(std::uint64_t repetition, std::uint64_t pair, std::uint64_t view) {
    return mixed(mixed(mixed(repetition + 1) + pair + 1) + view + 1);
}

void shift_down(ConstLuma from, int rows, Luma to) {
    assert(from.same_size(to.width, to.height) && rows >= 0);
    for (int y = 0; y < from.height; ++y)
        for (int x = 0; x < from.width; ++x)
            to.at(x, y) = from.at(x, std::max(y - rows, 0));
}

void blur_binomial_5x5(ConstLuma from, Luma to) {
    assert(from.same_size(to.width, to.height));
    constexpr std::array kTaps = {1, 4, 6, 4, 1};
    for (int y = 0; y < from.height; ++y) {
        for (int x = 0; x < from.width; ++x) {
            int sum = 128;
            for (int j = -2; j <= 2; ++j) {
                const int row = std::clamp(y + j, 0, from.height - 1);
                int across = 0;
                for (int i = -2; i <= 2; ++i)
                    across += kTaps[static_cast<std::size_t>(i + 2)] *
                              from.at(std::clamp(x + i, 0, from.width - 1), row);
                sum += kTaps[static_cast<std::size_t>(j + 2)] * across;
            }
            to.at(x, y) = clamped(sum >> 8);
        }
    }
}

}  // namespace groundline::cli
