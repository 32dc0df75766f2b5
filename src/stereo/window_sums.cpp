#include "stereo/window_sums.hpp"

#include <algorithm>
#include <cassert>
#include <cstddef>

#include "stereo/paper_reading.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stereo/window_sums.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace groundline::stereo::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr int kWindow = 2 * kWindowReach + 1;
constexpr int kWindowPixels = kWindow * kWindow;
// Elements in front of the column sums: the border, and as many as keep the first pixel aligned.
constexpr std::size_t kLead = kRowAlignment;

const hn::CappedTag<std::uint8_t, kRowPadding> kBytes;
const hn::CappedTag<std::uint16_t, kRowPadding / sizeof(std::uint16_t)> kWords;
const hn::Rebind<std::uint8_t, decltype(kWords)> kHalfBytes;

// 255 where the pixel is 0 or 255, else 0: the same as -1 where it counts.
HWY_INLINE auto minus_saturated(const std::uint8_t* pixels) {
    const auto next = hn::Add(hn::LoadU(kBytes, pixels), hn::Set(kBytes, std::uint8_t{1}));
    return hn::VecFromMask(kBytes, hn::Eq(hn::Min(next, hn::Set(kBytes, std::uint8_t{1})), next));
}

// |I(x + 1) - I(x)|
HWY_INLINE auto step_to_next(const std::uint8_t* pixels) {
    const auto here = hn::LoadU(kHalfBytes, pixels);
    const auto next = hn::LoadU(kHalfBytes, pixels + 1);
    return hn::PromoteTo(kWords, hn::Or(hn::SaturatedSub(here, next), hn::SaturatedSub(next, here)));
}

// sum of columns[x - 5 .. x + 5]
template <typename Tag, typename Sum>
HWY_INLINE auto across(Tag tag, const Sum* columns) {
    auto sum = hn::LoadU(tag, columns - kWindowReach);
    for (int i = 1 - kWindowReach; i <= kWindowReach; ++i)
        sum = hn::Add(sum, hn::LoadU(tag, columns + i));
    return sum;
}

template <typename Sum>
void repeat_border(Sum* columns, int width) {
    for (int i = 1; i <= kWindowReach; ++i) {
        columns[-i] = columns[0];
        columns[width - 1 + i] = columns[width - 1];
    }
}

void judge_windows(ConstLuma given, ConstLuma matched, int y, bool fresh, const CheckLimits& limits,
                   const WindowColumns& columns, Invalid* out) {
    const auto width = static_cast<std::size_t>(given.width);
    std::uint8_t* const saturated = columns.saturated.data() + kLead;
    std::uint16_t* const texture = columns.texture.data() + kLead;
    const std::size_t bytes = hn::Lanes(kBytes);
    const std::size_t words = hn::Lanes(kWords);
    const auto row = [](ConstLuma image, int v) { return image.row(std::clamp(v, 0, image.height - 1)); };

    // Sums may be wrong behind the last column; the border is written over what is read of that.
    if (fresh) {
        std::fill_n(saturated, width, std::uint8_t{0});
        std::fill_n(texture, width, std::uint16_t{0});
    }
    const int first = fresh ? y - kWindowReach : y + kWindowReach;
    for (int v = first; v <= y + kWindowReach; ++v) {
        const std::uint8_t* enters = row(given, v);
        for (std::size_t x = 0; x < width; x += bytes) {
            const auto sum = hn::Sub(hn::LoadU(kBytes, saturated + x), minus_saturated(enters + x));
            hn::StoreU(sum, kBytes, saturated + x);
        }
        enters = row(matched, v);
        for (std::size_t x = 0; x < width; x += words) {
            const auto sum = hn::Add(hn::LoadU(kWords, texture + x + 1), step_to_next(enters + x));
            hn::StoreU(sum, kWords, texture + x + 1);
        }
    }
    if (!fresh) {
        const std::uint8_t* leaves = row(given, y - kWindowReach - 1);
        for (std::size_t x = 0; x < width; x += bytes) {
            const auto sum = hn::Add(hn::LoadU(kBytes, saturated + x), minus_saturated(leaves + x));
            hn::StoreU(sum, kBytes, saturated + x);
        }
        leaves = row(matched, y - kWindowReach - 1);
        for (std::size_t x = 0; x < width; x += words) {
            const auto sum = hn::Sub(hn::LoadU(kWords, texture + x + 1), step_to_next(leaves + x));
            hn::StoreU(sum, kWords, texture + x + 1);
        }
    }
    repeat_border(saturated, given.width);
    repeat_border(texture, given.width);

    // Sums are at most 121 and 30855: limits beyond that all mean the same.
    const int fewest = std::clamp(limits.saturated_percent * kWindowPixels / 100 + 1, 0, kWindowPixels + 1);
    const int least = std::clamp(limits.texture, 0, 255 * kWindowPixels + 1);
    const hn::RebindToSigned<decltype(kWords)> numbers;
    const auto least_texture = hn::Set(numbers, static_cast<std::int16_t>(least));
    const auto flat_reason = hn::Set(numbers, static_cast<std::int16_t>(Invalid::kTexture));
    auto* const reasons = reinterpret_cast<std::uint8_t*>(out);
    for (std::size_t x = 0; x < width; x += words) {
        const auto flat = hn::Lt(hn::BitCast(numbers, across(kWords, texture + x)), least_texture);
        hn::StoreU(hn::DemoteTo(kHalfBytes, hn::IfThenElseZero(flat, flat_reason)), kHalfBytes, reasons + x);
    }
    const auto fewest_saturated = hn::Set(kBytes, static_cast<std::uint8_t>(fewest));
    const auto saturation = hn::Set(kBytes, static_cast<std::uint8_t>(Invalid::kSaturation));
    for (std::size_t x = 0; x < width; x += bytes) {
        const auto sum = across(kBytes, saturated + x);
        const auto exposed_badly = hn::Eq(hn::Max(sum, fewest_saturated), sum);
        hn::StoreU(hn::IfThenElse(exposed_badly, saturation, hn::LoadU(kBytes, reasons + x)), kBytes,
                   reasons + x);
    }
}

}  // namespace
}  // namespace groundline::stereo::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace groundline::stereo {

HWY_EXPORT(judge_windows);

WindowColumns::WindowColumns(int width, Arena& arena) {
    // Kernels write up to one vector and one element behind the last pixel; the arena's padding is one
    // vector.
    const std::size_t size = static_cast<std::size_t>(width) + 2 * kRowAlignment;
    saturated = arena.take<std::uint8_t>(size);
    texture = arena.take<std::uint16_t>(size);
}

void judge_windows(ConstLuma given, ConstLuma matched, int y, bool fresh, const CheckLimits& limits,
                   const WindowColumns& columns, Invalid* out) {
    assert(matched.same_size(given.width, given.height));
    HWY_DYNAMIC_DISPATCH(judge_windows)(given, matched, y, fresh, limits, columns, out);
}

}  // namespace groundline::stereo
#endif
