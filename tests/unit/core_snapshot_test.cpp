// One writer, several readers: a reader never sees half of one value and half of another.
#include "core/snapshot.hpp"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace groundline {
namespace {

struct Record {
    std::array<std::int64_t, 40> values{};
    char tail = 0;
};

TEST(Snapshot, HoldsWhatWasStoredLast) {
    Snapshot<Record> snapshot;
    EXPECT_EQ(snapshot.load().values[0], 0);
    Record record;
    record.values.fill(7);
    record.tail = 3;
    snapshot.store(record);
    EXPECT_EQ(snapshot.load().values, record.values);
    EXPECT_EQ(snapshot.load().tail, 3);
}

TEST(Snapshot, ReadersSeeWholeValuesThatNeverGoBack) {
    Snapshot<Record> snapshot;
    std::atomic<bool> stop{false};
    std::atomic<int> torn{0};
    std::atomic<int> reads{0};
    std::vector<std::jthread> readers;
    for (int i = 0; i < 2; ++i) {
        readers.emplace_back([&] {
            std::int64_t last = 0;
            while (!stop.load()) {
                const Record record = snapshot.load();
                for (const std::int64_t value : record.values)
                    if (value != record.values[0]) torn.fetch_add(1);
                if (record.tail != static_cast<char>(record.values[0] % 100)) torn.fetch_add(1);
                if (record.values[0] < last) torn.fetch_add(1);
                last = record.values[0];
                reads.fetch_add(1);
            }
        });
    }
    Record record;
    for (std::int64_t i = 1; i <= 300'000 || reads.load() < 100; ++i) {
        record.values.fill(i);
        record.tail = static_cast<char>(i % 100);
        snapshot.store(record);
    }
    stop.store(true);
    readers.clear();
    EXPECT_EQ(torn.load(), 0);
}

}  // namespace
}  // namespace groundline
