// The triple buffer's own code in every order that its atomic steps can take.
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <optional>

#include "pipeline/triple_buffer.hpp"
#include "support/interleavings.hpp"

namespace groundline::pipeline {
namespace {

using test::Interleavings;
using test::ModelAtomic;

// A slot that is written and read in two steps, and knows who is at it.
struct Slot {
    std::uint64_t first = 0;
    std::uint64_t second = 0;
    std::uint64_t writing = 0;
    std::uint64_t reading = 0;
};

struct World {
    TripleBuffer<Slot, ModelAtomic> buffer{{}};
    std::uint64_t committed = 0;  // newest whose commit() has returned
    std::uint64_t taken = 0;
    std::uint64_t last = 0;
    std::uint64_t lost = 0;
    std::uint64_t writes = 0;

    World() {
        for (std::uint64_t* value : {&committed, &taken, &last, &lost, &writes})
            Interleavings::note(value);
    }

    // False after close().
    bool write(std::uint64_t number) {
        Slot* slot = buffer.begin_write();
        if (slot == nullptr) return false;
        if (slot->reading != 0) Interleavings::fault("a slot is written while it is read");
        slot->writing = 1;
        slot->first = number;
        Interleavings::step();
        slot->second = number;
        slot->writing = 0;
        ++writes;
        if (buffer.commit()) ++lost;
        committed = number;
        return true;
    }

    void read(Slot& slot, std::uint64_t newest_before) {
        if (slot.writing != 0) Interleavings::fault("a slot is read while it is written");
        slot.reading = 1;
        const std::uint64_t number = slot.first;
        Interleavings::read(number);
        Interleavings::step();
        if (slot.second != number || slot.first != number) Interleavings::fault("a slot changed while read");
        slot.reading = 0;
        if (number <= last) Interleavings::fault("a slot came twice or out of order");
        if (number < newest_before) Interleavings::fault("a newer slot had been committed before");
        last = number;
        ++taken;
    }

    void judge_end(std::uint64_t items) const {
        if (last != items) Interleavings::fault("the newest slot never came");
        if (taken + lost != items) Interleavings::fault("a slot was lost uncounted");
    }
};

// The slots are part of the state, though the buffer keeps them to itself: what a thread wrote is a function
// of its history, and which slot it wrote of the atomics.
Interleavings::Result explore(std::uint64_t items, bool waiting) {
    std::unique_ptr<World> world;
    return Interleavings::explore(
        [&] {
            world = std::make_unique<World>();
            std::vector<std::function<void()>> threads;
            threads.emplace_back([&world, items] {
                for (std::uint64_t number = 1; number <= items; ++number)
                    world->write(number);
                world->buffer.end_of_stream();
            });
            if (waiting) {
                threads.emplace_back([&world] {
                    while (Slot* slot = world->buffer.take())
                        world->read(*slot, world->committed);
                });
            } else {
                threads.emplace_back([&world, items] {
                    for (std::uint64_t look = 0; look <= items; ++look) {
                        const std::uint64_t newest_before = world->committed;
                        Interleavings::read(newest_before);
                        if (Slot* slot = world->buffer.newest())
                            world->read(*slot, newest_before);
                        else if (newest_before > world->last)
                            Interleavings::fault("a committed slot was not found");
                    }
                });
            }
            return threads;
        },
        [&] {
            if (!waiting)
                if (Slot* slot = world->buffer.newest()) world->read(*slot, world->committed);
            world->judge_end(items);
        });
}

TEST(Interleavings, ATripleBufferThatIsWaitedOn) {
    for (const std::uint64_t items : {1U, 2U, 3U}) {
        const Interleavings::Result result = explore(items, true);
        EXPECT_EQ(result.fault, "") << items << " items, run " << result.runs;
        RecordProperty("states_" + std::to_string(items), std::to_string(result.states));
        EXPECT_GT(result.states, 10 * items) << "hardly anything was tried";
    }
}

TEST(Interleavings, ATripleBufferThatIsLookedAt) {
    for (const std::uint64_t items : {1U, 2U, 3U}) {
        const Interleavings::Result result = explore(items, false);
        EXPECT_EQ(result.fault, "") << items << " items, run " << result.runs;
        RecordProperty("states_" + std::to_string(items), std::to_string(result.states));
    }
}

TEST(Interleavings, ClosingWakesWhoeverWaitsAndNothingIsTakenAfterwards) {
    std::unique_ptr<World> world;
    const Interleavings::Result result = Interleavings::explore(
        [&] {
            world = std::make_unique<World>();
            return std::vector<std::function<void()>>{[&world] {
                                                          for (std::uint64_t number = 1; number <= 2;
                                                               ++number)
                                                              if (!world->write(number)) return;
                                                      },
                                                      [&world] {
                                                          while (Slot* slot = world->buffer.take())
                                                              world->read(*slot, world->committed);
                                                      },
                                                      [&world] { world->buffer.close(); }};
        },
        [&] {
            if (world->taken + world->lost > world->writes) Interleavings::fault("more came than went in");
            if (world->buffer.take() != nullptr) Interleavings::fault("taken after close()");
        });
    EXPECT_EQ(result.fault, "");
    EXPECT_GT(result.states, 100U);
}

TEST(Interleavings, ACommitAloneWakesWhoeverWaits) {
    std::unique_ptr<World> world;
    const Interleavings::Result result = Interleavings::explore(
        [&] {
            world = std::make_unique<World>();
            return std::vector<std::function<void()>>{[&world] { world->write(1); },
                                                      [&world] {
                                                          Slot* slot = world->buffer.take();
                                                          world->read(*slot, 0);
                                                      }};
        },
        [&] { world->judge_end(1); });
    EXPECT_EQ(result.fault, "");
}

// The explorer itself: it must find what is there to be found.
TEST(Interleavings, FindsALostUpdateAndALostWakeUp) {
    std::optional<ModelAtomic<std::uint32_t>> count;
    const Interleavings::Result lost_update = Interleavings::explore(
        [&] {
            count.emplace(0U);
            const auto add = [&count] { count->store(count->load() + 1); };
            return std::vector<std::function<void()>>{add, add};
        },
        [&] {
            if (count->load() != 2) Interleavings::fault("an update was lost");
        });
    EXPECT_EQ(lost_update.fault, "an update was lost");

    std::optional<ModelAtomic<std::uint32_t>> ticket;
    const Interleavings::Result lost_wake_up = Interleavings::explore(
        [&] {
            ticket.emplace(0U);
            return std::vector<std::function<void()>>{[&ticket] {
                                                          ticket->notify_one();
                                                          ticket->store(1U);
                                                      },
                                                      [&ticket] { ticket->wait(0U); }};
        },
        [] {});
    EXPECT_NE(lost_wake_up.fault.find("wake-up was lost"), std::string::npos) << lost_wake_up.fault;
}

}  // namespace
}  // namespace groundline::pipeline
