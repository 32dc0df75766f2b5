// How the pure rooms share work without knowing threads: they are handed a Parallel.
#pragma once

#include "core/function_ref.hpp"

namespace groundline {

// Runs independent tasks. Contract for callers: the result may not depend on the order of the tasks, on the
// lane a task gets, nor on the number of lanes; lanes exist only to give each running task scratch memory.
class Parallel {
  public:
    Parallel() = default;
    Parallel(const Parallel&) = delete;
    Parallel& operator=(const Parallel&) = delete;
    virtual ~Parallel() = default;

    // Most tasks that run at one time; lane numbers are 0 .. lanes() - 1.
    virtual int lanes() const = 0;
    // Calls task(index, lane) once for each index in 0 .. count - 1 and returns when all are done. No two
    // tasks run with the same lane at once. Called from one thread only; tasks may not call it; no
    // allocation.
    virtual void for_each(int count, FunctionRef<void(int index, int lane)> task) = 0;
};

// All tasks in order on the calling thread.
class Serial final : public Parallel {
  public:
    int lanes() const override { return 1; }
    void for_each(int count, FunctionRef<void(int, int)> task) override {
        for (int index = 0; index < count; ++index)
            task(index, 0);
    }
};

}  // namespace groundline
