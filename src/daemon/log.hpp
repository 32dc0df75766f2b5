// The daemon's log: spdlog to stderr, as the journal or a person reads it.
#pragma once

#include <spdlog/logger.h>

#include <cstddef>
#include <string>

namespace groundline::daemon {

// Is stderr the journal's socket? It says so itself: JOURNAL_STREAM holds device and inode of the stream.
bool stderr_is_journal();

// The log of this program. A thread of its own writes, so that a journal that hangs costs the oldest lines
// and never time. The first call starts that thread; not for the threads that handle frames.
spdlog::logger& log();
// How many lines were lost so far because nobody took them.
std::size_t lost_lines();
// Writes what is left and ends that thread.
void close_log();

// One line for the operator before the log exists or after it ended.
void say(int priority, const std::string& sentence);

}  // namespace groundline::daemon
