// The worker pool: every task once, no lane shared at one time, jobs back to back, no allocation.
#include <gtest/gtest.h>

#include <atomic>
#include <vector>

#include "pipeline/pacer.hpp"
#include "pipeline/worker_pool.hpp"
#include "support/allocation_count.hpp"

namespace groundline::pipeline {
namespace {

TEST(WorkerPool, RunsEachTaskOnceAndNeverTwoOnOneLane) {
    for (int lanes = 1; lanes <= 4; ++lanes) {
        WorkerPool pool(lanes);
        ASSERT_EQ(pool.lanes(), lanes);
        std::vector<std::atomic<int>> in_lane(static_cast<std::size_t>(lanes));
        std::atomic<bool> shared{false};
        for (int job = 0; job < 2000; ++job) {
            const int count = job % 23;
            std::vector<std::atomic<int>> runs(static_cast<std::size_t>(count));
            pool.for_each(count, [&](int index, int lane) {
                if (in_lane[static_cast<std::size_t>(lane)].fetch_add(1) != 0) shared = true;
                runs[static_cast<std::size_t>(index)].fetch_add(1);
                in_lane[static_cast<std::size_t>(lane)].fetch_sub(1);
            });
            for (int index = 0; index < count; ++index)
                ASSERT_EQ(runs[static_cast<std::size_t>(index)].load(), 1) << "job " << job;
        }
        EXPECT_FALSE(shared.load());
    }
}

TEST(WorkerPool, WhatTasksWroteIsSeenAfterForEach) {
    WorkerPool pool(3);
    std::vector<int> squares(1000);
    for (int round = 1; round <= 50; ++round) {
        pool.for_each(1000,
                      [&](int index, int) { squares[static_cast<std::size_t>(index)] = round * index; });
        for (int index = 0; index < 1000; ++index)
            ASSERT_EQ(squares[static_cast<std::size_t>(index)], round * index);
    }
}

TEST(WorkerPool, ForEachAllocatesNothing) {
    WorkerPool pool(3);
    std::atomic<long> sum{0};
    pool.for_each(10, [&](int index, int) { sum += index; });
    const std::uint64_t before = test::allocations();
    for (int job = 0; job < 100; ++job)
        pool.for_each(64, [&](int index, int) { sum += index; });
    EXPECT_EQ(test::allocations(), before);
    EXPECT_EQ(sum.load(), 45 + 100 * 2016);
}

TEST(Pacer, FollowsTheStampsAndBridgesGapsAndJumps) {
    Pacer pacer(0);
    EXPECT_EQ(pacer.due_ns(5'000'000'000, 1000), 1000);
    EXPECT_EQ(pacer.due_ns(5'050'000'000, 99), 50'001'000);
    EXPECT_EQ(pacer.due_ns(4'000'000'000, 99), 100'001'000) << "a jump back repeats the last good step";
    EXPECT_EQ(pacer.due_ns(99'000'000'000, 99), 150'001'000) << "so does a gap longer than kLongestStepNs";
}

TEST(Pacer, AFixedStepIgnoresTheStamps) {
    Pacer pacer(20);
    EXPECT_EQ(pacer.due_ns(7, 1000), 1000);
    EXPECT_EQ(pacer.due_ns(7, 5000), 1020);
    EXPECT_EQ(pacer.due_ns(1'000'000, 5000), 1040);
}

}  // namespace
}  // namespace groundline::pipeline
