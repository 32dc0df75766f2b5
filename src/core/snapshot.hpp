// The newest value of a record that one thread writes and any may read, without a lock.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace groundline {

// A sequence lock: the version is odd while the words are being written, and a reader takes what it read only
// if the version was even and the same before and after. The words are atomics themselves, so that reading
// them meanwhile is no data race. store() is wait-free and for one thread; load() is for any, and tries again
// while a store() is under way, which is for as long as copying T takes. Neither allocates.
template <typename T>
class Snapshot {
    static_assert(std::is_trivially_copyable_v<T>);

  public:
    Snapshot() { store(T{}); }

    void store(const T& value) {
        std::array<std::uint64_t, kWords> words{};
        std::memcpy(words.data(), &value, sizeof(T));
        const std::uint64_t version = version_.load(std::memory_order_relaxed);
        version_.store(version + 1, std::memory_order_relaxed);
        // Whoever sees a word of this store, sees the odd version too.
        for (std::size_t i = 0; i < kWords; ++i)
            words_[i].store(words[i], std::memory_order_release);
        version_.store(version + 2, std::memory_order_release);
    }

    T load() const {
        std::array<std::uint64_t, kWords> words{};
        for (;;) {
            const std::uint64_t before = version_.load(std::memory_order_acquire);
            for (std::size_t i = 0; i < kWords; ++i)
                words[i] = words_[i].load(std::memory_order_acquire);
            if (before % 2 == 0 && version_.load(std::memory_order_relaxed) == before) break;
        }
        T value;
        std::memcpy(static_cast<void*>(&value), words.data(), sizeof(T));
        return value;
    }

  private:
    static constexpr std::size_t kWords = (sizeof(T) + 7) / 8;

    std::atomic<std::uint64_t> version_{0};
    std::array<std::atomic<std::uint64_t>, kWords> words_{};
};

}  // namespace groundline
