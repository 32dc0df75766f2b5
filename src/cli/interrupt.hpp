// Ctrl-C and SIGTERM as a flag that long work looks at.
#pragma once

#include <atomic>

namespace groundline::cli {

// From now on the first SIGINT or SIGTERM turns the flag true; a second one ends the program at once, with
// the shell's usual status. The flag is the same on every call.
const std::atomic<bool>& stop_on_signals();

}  // namespace groundline::cli
