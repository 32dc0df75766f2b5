// Loaded into a program by LD_PRELOAD: counts, thread by thread, what a thread that handles frames must not
// do. SIGUSR2 begins the count; the next one ends it and writes one line a thread into $GROUNDLINE_FORBIDDEN:
//   NAME allocations locks output allocations_in_lcm locks_in_lcm messages
// What LCM does inside lcm_publish is counted apart.
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/uio.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

struct _lcm_t;

namespace {

struct Tally {
    std::atomic<pid_t> thread{0};
    std::atomic<std::uint64_t> allocations[2];  // ours, LCM's
    std::atomic<std::uint64_t> locks[2];
    std::atomic<std::uint64_t> output{0};
    std::atomic<std::uint64_t> messages{0};
};

constexpr std::size_t kThreads = 64;
std::array<Tally, kThreads> tallies;
std::atomic<std::size_t> threads{0};
std::atomic<bool> counting{false};
char result_path[256];

thread_local Tally* mine = nullptr;
thread_local int in_lcm = 0;

Tally& tally() {
    if (mine == nullptr) {
        const std::size_t index = threads.fetch_add(1);
        mine = &tallies[index < kThreads ? index : kThreads - 1];
        mine->thread.store(gettid());
    }
    return *mine;
}

void allocated() {
    if (counting.load(std::memory_order_relaxed)) ++tally().allocations[in_lcm];
}
void locked() {
    if (counting.load(std::memory_order_relaxed)) ++tally().locks[in_lcm];
}
void wrote() {
    if (counting.load(std::memory_order_relaxed)) ++tally().output;
}

// The function of that name that this library stands in front of. Looked up when it is first called, which
// may be before this library's constructor: those of other libraries run first.
template <typename Function>
class Next {
  public:
    explicit constexpr Next(const char* name) : name_(name) {}
    template <typename... Arguments>
    auto operator()(Arguments... arguments) {
        Function function = function_.load(std::memory_order_relaxed);
        if (function == nullptr) {
            function = reinterpret_cast<Function>(dlsym(RTLD_NEXT, name_));
            function_.store(function, std::memory_order_relaxed);
        }
        return function(arguments...);
    }

  private:
    const char* name_;
    std::atomic<Function> function_{nullptr};
};
constinit Next<int (*)(pthread_mutex_t*)> next_lock("pthread_mutex_lock");
constinit Next<int (*)(pthread_rwlock_t*)> next_read_lock("pthread_rwlock_rdlock");
constinit Next<int (*)(pthread_rwlock_t*)> next_write_lock("pthread_rwlock_wrlock");
constinit Next<void (*)(void*)> next_glib_lock("g_mutex_lock");  // LCM's
constinit Next<ssize_t (*)(int, const void*, std::size_t)> next_write("write");
constinit Next<std::size_t (*)(const void*, std::size_t, std::size_t, FILE*)> next_fwrite("fwrite");
constinit Next<int (*)(FILE*, const char*, va_list)> next_vfprintf("vfprintf");
constinit Next<int (*)(_lcm_t*, const char*, const void*, unsigned)> next_publish("lcm_publish");

void write_result() {
    const int file = open(result_path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    const std::size_t count = threads.load() < kThreads ? threads.load() : kThreads;
    for (std::size_t i = 0; i < count; ++i) {
        const Tally& each = tallies[i];
        char path[64];
        std::snprintf(path, sizeof path, "/proc/self/task/%d/comm", each.thread.load());
        char name[32] = "ended";
        const int comm = open(path, O_RDONLY | O_CLOEXEC);
        if (comm >= 0) {
            const ssize_t got = read(comm, name, sizeof name - 1);
            name[got > 0 ? got - 1 : 0] = '\0';
            close(comm);
        }
        char line[256];
        const int length =
            std::snprintf(line, sizeof line, "%s %lu %lu %lu %lu %lu %lu\n", name, each.allocations[0].load(),
                          each.locks[0].load(), each.output.load(), each.allocations[1].load(),
                          each.locks[1].load(), each.messages.load());
        if (next_write(file, line, static_cast<std::size_t>(length)) < 0) break;
    }
    close(file);
}

void toggle(int /*signal*/) {
    if (!counting.exchange(!counting.load())) return;
    write_result();
}

__attribute__((constructor)) void prepare() {
    const char* path = std::getenv("GROUNDLINE_FORBIDDEN");
    if (path == nullptr) return;
    std::strncpy(result_path, path, sizeof result_path - 1);
    struct sigaction action {};
    action.sa_handler = toggle;
    action.sa_flags = static_cast<int>(SA_RESTART);
    sigaction(SIGUSR2, &action, nullptr);
}

}  // namespace

extern "C" {

void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* memory);

void* malloc(std::size_t size) {
    allocated();
    return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
    allocated();
    return __libc_calloc(count, size);
}
void* realloc(void* memory, std::size_t size) {
    allocated();
    return __libc_realloc(memory, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
    allocated();
    return __libc_memalign(alignment, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
    allocated();
    return __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
    allocated();
    *memory = __libc_memalign(alignment, size);
    return *memory != nullptr ? 0 : ENOMEM;
}
void free(void* memory) {
    if (memory != nullptr) allocated();
    __libc_free(memory);
}

int pthread_mutex_lock(pthread_mutex_t* mutex) {
    locked();
    return next_lock(mutex);
}
int pthread_rwlock_rdlock(pthread_rwlock_t* mutex) {
    locked();
    return next_read_lock(mutex);
}
int pthread_rwlock_wrlock(pthread_rwlock_t* mutex) {
    locked();
    return next_write_lock(mutex);
}

void g_mutex_lock(void* mutex) {
    locked();
    next_glib_lock(mutex);
}

ssize_t write(int file, const void* data, std::size_t size) {
    wrote();
    return next_write(file, data, size);
}
std::size_t fwrite(const void* data, std::size_t size, std::size_t count, FILE* file) {
    wrote();
    return next_fwrite(data, size, count, file);
}
int vfprintf(FILE* file, const char* format, va_list values) {
    wrote();
    return next_vfprintf(file, format, values);
}

int lcm_publish(_lcm_t* lcm, const char* channel, const void* data, unsigned size) {
    if (counting.load(std::memory_order_relaxed)) ++tally().messages;
    in_lcm = 1;
    const int result = next_publish(lcm, channel, data, size);
    in_lcm = 0;
    return result;
}

}  // extern "C"
