// Runs a few threads in every order their atomic steps can take: for proving a small lock-free protocol.
#pragma once

#include <ucontext.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <unordered_set>
#include <vector>

namespace groundline::test {

// The threads are fibers of one real thread. Each operation on a ModelAtomic, and each step(), is a point
// where any thread that can go on may be the next; what lies between two such points happens at once. All
// orders are tried, depth first, by running from the start again with one choice changed. A state that was
// met before is not followed again: threads are functions of what they have read, so a state is what the
// atomics and the noted values hold, what each thread has read so far, and who is asleep.
//
// Memory is sequentially consistent here: weaker orders are for ThreadSanitizer and the stress tests.
class Interleavings {
  public:
    struct Result {
        std::uint64_t runs = 0;
        std::uint64_t states = 0;
        std::string fault;  // of the first run in which something was wrong, empty where none was
    };

    // `prepare` makes everything anew for one run and gives the threads' bodies; `finally` judges a run that
    // came to its end. Both, and the bodies, report by fault().
    static Result explore(const std::function<std::vector<std::function<void()>>()>& prepare,
                          const std::function<void()>& finally);

    // For bodies and ModelAtomic, within explore().
    static void step();                      // another thread may come before what follows
    static void read(std::uint64_t value);   // the running thread has seen this
    static void note(std::uint64_t* value);  // part of the state from now on; for one run
    static void sleep(const void* on);       // until wake() for the same place
    static void wake(const void* on);
    static void fault(const std::string& sentence);
};

// Stands in for std::atomic in what is to be explored.
template <typename Value>
class ModelAtomic {
  public:
    ModelAtomic(Value value) : value_(static_cast<std::uint64_t>(value)) {  // NOLINT: as std::atomic
        Interleavings::note(&value_);
    }
    ModelAtomic(const ModelAtomic&) = delete;
    ModelAtomic& operator=(const ModelAtomic&) = delete;

    Value load(std::memory_order = std::memory_order_seq_cst) const {
        Interleavings::step();
        return seen();
    }
    void store(Value value, std::memory_order = std::memory_order_seq_cst) {
        Interleavings::step();
        value_ = static_cast<std::uint64_t>(value);
    }
    Value exchange(Value value, std::memory_order = std::memory_order_seq_cst) {
        Interleavings::step();
        const Value before = seen();
        value_ = static_cast<std::uint64_t>(value);
        return before;
    }
    Value fetch_add(Value value, std::memory_order = std::memory_order_seq_cst) {
        Interleavings::step();
        const Value before = seen();
        value_ = static_cast<std::uint64_t>(static_cast<Value>(before + value));
        return before;
    }
    // Looking and falling asleep is one step, as the kernel makes it; waking without a change is allowed for
    // and not tried.
    void wait(Value old, std::memory_order = std::memory_order_seq_cst) const {
        Interleavings::step();
        while (seen() == old)
            Interleavings::sleep(this);
    }
    void notify_one() {
        Interleavings::step();
        Interleavings::wake(this);
    }

  private:
    Value seen() const {
        Interleavings::read(value_);
        return static_cast<Value>(value_);
    }
    std::uint64_t value_;
};

}  // namespace groundline::test
