// All memory that frames need, taken before the first frame and given back only at the end.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "core/image.hpp"

namespace groundline {

// Hands out zeroed memory that lives as long as the arena. Use: take everything at start-up, then seal();
// a take after that is a programming error and aborts, so steady state cannot allocate here by accident.
// Only for types without destructors. Not thread-safe: one thread sets the program up.
class Arena {
  public:
    Arena() = default;
    Arena(const Arena&) = delete;
    Arena& operator=(const Arena&) = delete;

    // `count` zeroed elements aligned to kRowAlignment, followed by kRowPadding readable bytes.
    template <typename T>
    std::span<T> take(std::size_t count) {
        static_assert(std::is_trivially_destructible_v<T>);
        return {static_cast<T*>(take_bytes(count * sizeof(T))), count};
    }

    // A zeroed image whose rows keep the alignment and padding contract of image.hpp.
    template <typename T>
    ImageView<T> image(int width, int height) {
        const std::size_t row_bytes = padded_row_bytes(static_cast<std::size_t>(width) * sizeof(T));
        static_assert(kRowAlignment % sizeof(T) == 0);
        auto* first = static_cast<T*>(take_bytes(row_bytes * static_cast<std::size_t>(height)));
        return {first, width, height, static_cast<std::ptrdiff_t>(row_bytes / sizeof(T))};
    }
    BgrView bgr_image(int width, int height);

    void seal() { sealed_ = true; }
    bool sealed() const { return sealed_; }
    // Everything taken so far, rounding and padding included.
    std::size_t bytes() const { return bytes_; }

  private:
    struct Free {
        void operator()(std::byte* block) const;
    };

    static std::size_t padded_row_bytes(std::size_t row_bytes);
    void* take_bytes(std::size_t bytes);

    std::vector<std::unique_ptr<std::byte, Free>> blocks_;
    std::size_t bytes_ = 0;
    bool sealed_ = false;
};

}  // namespace groundline
