#include "support/allocation_count.hpp"

#include <dlfcn.h>
#include <pthread.h>

#include <atomic>
#include <cerrno>
#include <cstddef>

namespace {

std::atomic<std::uint64_t> allocation_counter{0};
std::atomic<std::uint64_t> lock_counter{0};

}  // namespace

namespace groundline::test {

std::uint64_t allocations() {
    return allocation_counter.load();
}

std::uint64_t mutex_locks() {
    return lock_counter.load();
}

}  // namespace groundline::test

// Sanitizers stand in the same place themselves; under them the counters stay 0.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
extern "C" {

// The GNU C library's own names for what is replaced here.
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
    ++allocation_counter;
    return __libc_malloc(size);
}

void* calloc(std::size_t count, std::size_t size) {
    ++allocation_counter;
    return __libc_calloc(count, size);
}

void* realloc(void* memory, std::size_t size) {
    ++allocation_counter;
    return __libc_realloc(memory, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) {
    ++allocation_counter;
    return __libc_memalign(alignment, size);
}

int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
    ++allocation_counter;
    *memory = __libc_memalign(alignment, size);
    return *memory != nullptr ? 0 : ENOMEM;
}

int pthread_mutex_lock(pthread_mutex_t* mutex) {
    using Lock = int (*)(pthread_mutex_t*);
    static std::atomic<Lock> next{nullptr};
    Lock lock = next.load(std::memory_order_relaxed);
    if (lock == nullptr) {
        lock = reinterpret_cast<Lock>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
        next.store(lock, std::memory_order_relaxed);
    }
    ++lock_counter;
    return lock(mutex);
}

}  // extern "C"
#endif
