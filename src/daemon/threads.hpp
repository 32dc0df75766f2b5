// What the kernel shows of the threads of this process.
#pragma once

namespace groundline::daemon {

// Is any thread of this process stopped, by a debugger or a signal? One that waits, for whatever, is not.
// Reads a file for each thread, some 10 us each: not for the threads that handle frames. False where the
// kernel does not show them.
bool a_thread_is_stopped();

}  // namespace groundline::daemon
