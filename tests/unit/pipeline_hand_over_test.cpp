// The hand-overs: order, losslessness, newest-first, integrity under two racing threads, and their ends.
#include <gtest/gtest.h>

#include <algorithm>
#include <thread>
#include <vector>

#include "pipeline/ring.hpp"
#include "pipeline/triple_buffer.hpp"

namespace groundline::pipeline {
namespace {

// A slot that shows tearing: every word must belong to the same item.
struct Item {
    std::uint64_t number = 0;
    std::array<std::uint64_t, 32> copies{};

    void fill(std::uint64_t value) {
        number = value;
        for (std::uint64_t& copy : copies)
            copy = value * 0x9E3779B97F4A7C15ULL;
    }
    bool whole() const {
        return std::all_of(copies.begin(), copies.end(),
                           [this](std::uint64_t copy) { return copy == number * 0x9E3779B97F4A7C15ULL; });
    }
};

struct Seen {
    std::vector<std::uint64_t> numbers;
    bool whole = true;
    std::uint64_t overwritten = 0;
};

Seen race(HandOver<Item>& hand_over, std::uint64_t items, int consumer_spins) {
    Seen seen;
    seen.numbers.reserve(items);
    std::thread consumer([&] {
        while (const Item* item = hand_over.take()) {
            seen.whole = seen.whole && item->whole();
            for (int spin = 0; spin < consumer_spins; ++spin)
                std::atomic_signal_fence(std::memory_order_seq_cst);
            seen.whole = seen.whole && item->whole();
            seen.numbers.push_back(item->number);
            hand_over.release();
        }
    });
    for (std::uint64_t number = 1; number <= items; ++number) {
        Item* item = hand_over.begin_write();
        if (item == nullptr) break;
        item->fill(number);
        if (hand_over.commit()) ++seen.overwritten;
    }
    hand_over.end_of_stream();
    consumer.join();
    return seen;
}

TEST(Ring, DeliversEveryItemInOrderHoweverSlowTheConsumer) {
    for (const int spins : {0, 200, 5000}) {
        Ring<Item, 3> ring({});
        const std::uint64_t items = spins > 1000 ? 2000 : 50000;
        const Seen seen = race(ring, items, spins);
        ASSERT_EQ(seen.numbers.size(), items);
        for (std::uint64_t i = 0; i < items; ++i)
            ASSERT_EQ(seen.numbers[i], i + 1);
        EXPECT_TRUE(seen.whole);
        EXPECT_EQ(seen.overwritten, 0U);
    }
}

TEST(TripleBuffer, DeliversWholeItemsInRisingOrderAndCountsEveryLoss) {
    for (const int spins : {0, 200, 5000}) {
        TripleBuffer<Item> buffer({});
        const std::uint64_t items = 200000;
        const Seen seen = race(buffer, items, spins);
        ASSERT_FALSE(seen.numbers.empty());
        EXPECT_TRUE(seen.whole);
        EXPECT_TRUE(std::adjacent_find(seen.numbers.begin(), seen.numbers.end(), std::greater_equal<>()) ==
                    seen.numbers.end());
        EXPECT_EQ(seen.numbers.back(), items) << "the newest item must never be lost";
        EXPECT_EQ(seen.numbers.size() + seen.overwritten, items);
    }
}

TEST(TripleBuffer, ConsumerGetsTheNewestOfThoseCommitted) {
    TripleBuffer<Item> buffer({});
    EXPECT_EQ(buffer.newest(), nullptr);
    for (std::uint64_t number = 1; number <= 5; ++number) {
        buffer.begin_write()->fill(number);
        EXPECT_EQ(buffer.commit(), number > 1) << "all but the first cost the one before";
    }
    EXPECT_EQ(buffer.take()->number, 5U);
    EXPECT_EQ(buffer.newest(), nullptr) << "each is given once";
    buffer.begin_write()->fill(6);
    EXPECT_FALSE(buffer.commit());
    EXPECT_EQ(buffer.newest()->number, 6U);
    buffer.end_of_stream();
    EXPECT_EQ(buffer.take(), nullptr);
}

TEST(TripleBuffer, ASlotBeingReadIsNotWritten) {
    TripleBuffer<Item> buffer({});
    buffer.begin_write()->fill(1);
    buffer.commit();
    const Item* held = buffer.take();
    for (std::uint64_t number = 2; number <= 9; ++number) {
        Item* slot = buffer.begin_write();
        ASSERT_NE(slot, held);
        slot->fill(number);
        buffer.commit();
        ASSERT_EQ(held->number, 1U);
    }
}

template <typename H>
void close_wakes_both_sides() {
    {
        H hand_over({});
        std::thread consumer([&] { EXPECT_EQ(hand_over.take(), nullptr); });
        hand_over.close();
        consumer.join();
    }
    H hand_over({});
    std::thread producer([&] {
        while (Item* item = hand_over.begin_write()) {
            item->fill(7);
            hand_over.commit();
        }
    });
    hand_over.close();
    producer.join();
    EXPECT_EQ(hand_over.take(), nullptr);
}

TEST(Ring, CloseWakesBothSides) {
    close_wakes_both_sides<Ring<Item, 3>>();
}
TEST(TripleBuffer, CloseWakesBothSides) {
    close_wakes_both_sides<TripleBuffer<Item>>();
}

}  // namespace
}  // namespace groundline::pipeline
