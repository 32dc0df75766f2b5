// Threads inherit the processors of the thread that starts them: which ones a library's threads get.
#pragma once

#include <sched.h>

namespace groundline::capture {

// The processors that the thread which makes this may run on.
struct Processors {
    cpu_set_t set{};
    bool known = sched_getaffinity(0, sizeof set, &set) == 0;
};

// While one lives the calling thread may run on those processors, and what it starts does; then on its own
// again. Does nothing where the kernel refuses.
class LentProcessors {
  public:
    explicit LentProcessors(const Processors& lent)
        : lent_(lent.known && own_.known && sched_setaffinity(0, sizeof lent.set, &lent.set) == 0) {}
    LentProcessors(const LentProcessors&) = delete;
    LentProcessors& operator=(const LentProcessors&) = delete;
    ~LentProcessors() {
        if (lent_) sched_setaffinity(0, sizeof own_.set, &own_.set);
    }

  private:
    Processors own_;
    bool lent_;
};

}  // namespace groundline::capture
