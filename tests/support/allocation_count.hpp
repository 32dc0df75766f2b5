// Counts every operator new in a test program: include in exactly one source of the program.
#pragma once

#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <new>

namespace groundline::test {

inline std::atomic<std::uint64_t> allocation_counter{0};

// Allocations by any thread since the program began.
inline std::uint64_t allocations() { return allocation_counter.load(); }

}  // namespace groundline::test

// Replacement functions may not be inline, hence one source only.
void* operator new(std::size_t size) {
    ++groundline::test::allocation_counter;
    if (void* memory = std::malloc(size)) return memory;
    throw std::bad_alloc();
}
void* operator new(std::size_t size, std::align_val_t alignment) {
    ++groundline::test::allocation_counter;
    const auto step = static_cast<std::size_t>(alignment);
    if (void* memory = std::aligned_alloc(step, (size + step - 1) / step * step)) return memory;
    throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
