// Counts every operator new of a test program that links support/allocation_count.cpp.
#pragma once

#include <cstdint>

namespace groundline::test {

// Allocations by any thread since the program began.
std::uint64_t allocations();

}  // namespace groundline::test
