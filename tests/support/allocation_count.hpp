// Counts what the hot path must not do, in test programs that link support/allocation_count.cpp: it stands in
// front of the C library's allocation and mutex functions.
#pragma once

#include <cstdint>

namespace groundline::test {

// Allocations by any thread since the program began: malloc, calloc, realloc, aligned_alloc, posix_memalign
// and every operator new, which all end in them.
std::uint64_t allocations();

// pthread_mutex_lock calls by any thread since the program began.
std::uint64_t mutex_locks();

}  // namespace groundline::test
