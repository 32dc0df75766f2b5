// Shows on a terminal how far a run of many steps is.
#pragma once

#include <cstddef>
#include <string>

namespace groundline::cli {

// Writes "N of ALL: WHAT" over the line on stderr, if that is a terminal: step `done` + 1 is under way.
// Clears the line at the end, done == all.
void show_step(std::size_t done, std::size_t all, const std::string& what);

}  // namespace groundline::cli
