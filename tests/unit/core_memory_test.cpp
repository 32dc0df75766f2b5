#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "core/arena.hpp"
#include "core/evidence.hpp"
#include "core/fixed_vector.hpp"
#include "core/frame.hpp"
#include "core/image.hpp"
#include "core/latency_histogram.hpp"
#include "core/parallel.hpp"
#include "support/allocation_count.hpp"

namespace groundline {
namespace {

bool aligned(const void* address) {
    return reinterpret_cast<std::uintptr_t>(address) % kRowAlignment == 0;
}

TEST(Arena, HandsOutZeroedAlignedMemoryWithPaddingBehind) {
    Arena arena;
    for (const std::size_t count : {std::size_t{1}, std::size_t{63}, std::size_t{64}, std::size_t{1000}}) {
        const std::span<std::uint32_t> numbers = arena.take<std::uint32_t>(count);
        ASSERT_EQ(numbers.size(), count);
        EXPECT_TRUE(aligned(numbers.data()));
        for (const std::uint32_t number : numbers)
            EXPECT_EQ(number, 0U);
        // The padding is there to be read and written; a sanitizer build shows if it is not.
        auto* bytes = reinterpret_cast<std::uint8_t*>(numbers.data() + count);
        std::fill_n(bytes, kRowPadding, std::uint8_t{0xEE});
    }
}

TEST(Arena, ImagesKeepTheRowContract) {
    Arena arena;
    for (const int width : {1, 31, 64, 641}) {
        const ImageView<std::int16_t> image = arena.image<std::int16_t>(width, 5);
        EXPECT_TRUE(image.same_size(width, 5));
        EXPECT_GE(image.stride * 2, width * 2 + static_cast<int>(kRowPadding));
        for (int v = 0; v < 5; ++v) {
            EXPECT_TRUE(aligned(image.row(v)));
            for (int u = 0; u < width; ++u)
                EXPECT_EQ(image.at(u, v), 0);
        }
        // Filling a row and its padding must leave the others alone.
        for (int v = 0; v < 5; ++v)
            std::fill_n(image.row(v), static_cast<std::size_t>(width) + kRowPadding / 2,
                        static_cast<std::int16_t>(v));
        for (int v = 0; v < 5; ++v)
            EXPECT_EQ(image.at(0, v), v);
    }
    const BgrView colour = arena.bgr_image(10, 3);
    EXPECT_EQ(colour.width, 10);
    EXPECT_GE(colour.stride, 30);
    EXPECT_TRUE(aligned(colour.row(2)));
}

TEST(Arena, CountsWhatItTook) {
    Arena arena;
    EXPECT_EQ(arena.bytes(), 0U);
    arena.take<std::uint8_t>(1000);
    EXPECT_GE(arena.bytes(), 1000U + kRowPadding);
    const std::size_t before = arena.bytes();
    arena.image<std::uint8_t>(100, 10);
    EXPECT_GE(arena.bytes(), before + 10U * (100U + kRowPadding));
}

TEST(ArenaDeathTest, AbortsWhenAskedAfterTheSeal) {
    Arena arena;
    arena.take<int>(1);
    EXPECT_FALSE(arena.sealed());
    arena.seal();
    EXPECT_TRUE(arena.sealed());
    EXPECT_DEATH(arena.take<int>(1), "after start-up");
}

TEST(Image, CopyAndFillLeavePaddingAlone) {
    Arena arena;
    const ImageView<std::uint8_t> from = arena.image<std::uint8_t>(37, 4);
    const ImageView<std::uint8_t> to = arena.image<std::uint8_t>(37, 4);
    fill_pixels(from, 9);
    from.row(2)[37] = 77;
    to.row(2)[37] = 55;
    copy_pixels<std::uint8_t>(from, to);
    for (int v = 0; v < 4; ++v)
        for (int u = 0; u < 37; ++u)
            EXPECT_EQ(to.at(u, v), 9);
    EXPECT_EQ(to.row(2)[37], 55);
    EXPECT_EQ(from.row(2)[37], 77);
    EXPECT_TRUE(ImageView<int>().empty());
    const ConstImageView<std::uint8_t> view = from;  // a view of T is a view of const T
    EXPECT_EQ(view.at(36, 3), 9);
}

TEST(Image, LumaIsTheSpecifiedSum) {
    EXPECT_EQ(luma_of(0, 0, 0), 0);
    EXPECT_EQ(luma_of(255, 255, 255), 255);
    EXPECT_EQ(luma_of(255, 0, 0), 77);  // (77 * 255 + 128) >> 8
    EXPECT_EQ(luma_of(0, 255, 0), 149);
    EXPECT_EQ(luma_of(0, 0, 255), 29);
}

TEST(LatencyHistogram, PercentilesAreWithinOneSixteenth) {
    std::mt19937 random(3);
    for (int trial = 0; trial < 20; ++trial) {
        LatencyHistogram histogram;
        std::vector<std::int64_t> values;
        for (int i = 0; i < 5000; ++i) {
            const auto value = static_cast<std::int64_t>(random() >> (random() % 31));
            values.push_back(value);
            histogram.add(value);
        }
        std::sort(values.begin(), values.end());
        EXPECT_EQ(histogram.count(), 5000U);
        EXPECT_EQ(histogram.max_ns(), values.back());
        for (const double share : {0.01, 0.5, 0.9, 0.99, 0.999, 1.0}) {
            auto rank = static_cast<std::size_t>(share * 5000.0);
            if (static_cast<double>(rank) < share * 5000.0) ++rank;
            const auto truth = static_cast<double>(values[std::max<std::size_t>(rank, 1) - 1]);
            const auto found = static_cast<double>(histogram.percentile_ns(share));
            EXPECT_GE(found, truth);
            EXPECT_LE(found, truth * 1.0625 + 1.0);
        }
    }
}

TEST(LatencyHistogram, HoldsTheExtremes) {
    constexpr std::int64_t kLargest = (std::int64_t{1} << 62) - 1;
    LatencyHistogram histogram;
    EXPECT_EQ(histogram.percentile_ns(0.5), 0);
    histogram.add(-5);
    EXPECT_EQ(histogram.percentile_ns(1.0), 0);
    histogram.add(kLargest);
    EXPECT_EQ(histogram.max_ns(), kLargest);
    EXPECT_EQ(histogram.percentile_ns(1.0), kLargest);
    EXPECT_EQ(histogram.percentile_ns(0.25), 0);
    LatencyHistogram three;  // the median of 1, 2, 3 is the 2nd: ceil(0.5 * 3)
    for (const std::int64_t value : {1, 2, 3})
        three.add(value);
    EXPECT_EQ(three.percentile_ns(0.5), 2);
    EXPECT_EQ(three.percentile_ns(0.34), 2);
    EXPECT_EQ(three.percentile_ns(0.33), 1);
    for (std::int64_t small = 0; small < 16; ++small) {
        LatencyHistogram one;
        one.add(small);
        EXPECT_EQ(one.percentile_ns(0.5), small);
    }
}

TEST(FixedVector, KeepsItsRoomInside) {
    const std::uint64_t before = test::allocations();
    FixedVector<int, 5> numbers;
    for (int i = 0; i < 5; ++i)
        numbers.push_back(i);
    EXPECT_EQ(numbers.size(), numbers.capacity());
    EXPECT_EQ(numbers.back(), 4);
    EXPECT_EQ(test::allocations(), before);
    EXPECT_THROW(numbers.push_back(5), std::bad_alloc);
}

TEST(Reasons, AreASetOfStableBits) {
    Reasons reasons;
    EXPECT_TRUE(reasons.empty());
    reasons.add(Reason::kWall);
    reasons.add(Reason::kNoFrames);
    EXPECT_TRUE(reasons.has(Reason::kWall));
    EXPECT_FALSE(reasons.has(Reason::kDark));
    EXPECT_EQ(reasons.bits(), (1U << 12U) | 1U);  // in messages: never renumbered
    Reasons others;
    others.add(Reason::kDark);
    others.add(reasons);
    EXPECT_EQ(Reasons(others.bits()), others);
    EXPECT_TRUE(others.has(Reason::kNoFrames) && others.has(Reason::kDark));
    for (const std::string_view name : kReasonNames)
        EXPECT_FALSE(name.empty());
    EXPECT_EQ(kReasonNames[static_cast<std::size_t>(Reason::kHeldGround)], "held_ground");
    EXPECT_EQ(kReasonNames[static_cast<std::size_t>(Reason::kOverload)], "overload");
    EXPECT_EQ(kReasonNames[static_cast<std::size_t>(Reason::kUnchecked)], "unchecked");
    EXPECT_EQ(kReasonNames[static_cast<std::size_t>(Reason::kHalfResolution)], "half_resolution");
}

TEST(FrameStamp, CutsLongNamesAndForgetsOldOnes) {
    FrameStamp stamp;
    stamp.set_name(std::string(500, 'x'));
    EXPECT_EQ(stamp.name_view(), std::string(127, 'x'));
    stamp.set_name("left.png");
    EXPECT_EQ(stamp.name_view(), "left.png");
}

TEST(Parallel, SerialRunsEveryTaskInOrder) {
    Serial serial;
    std::vector<int> order;
    serial.for_each(5, [&](int index, int lane) {
        EXPECT_EQ(lane, 0);
        order.push_back(index);
    });
    EXPECT_EQ(order, (std::vector<int>{0, 1, 2, 3, 4}));
    EXPECT_EQ(serial.lanes(), 1);
}

}  // namespace
}  // namespace groundline
