#include "cli/step_progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

namespace groundline::cli {

void show_step(std::size_t done, std::size_t all, const std::string& what) {
    if (::isatty(STDERR_FILENO) == 0) return;
    if (done < all)
        fmt::print(stderr, "\r\x1b[K{} of {}: {}", done + 1, all, what);
    else
        fmt::print(stderr, "\r\x1b[K");
    std::fflush(stderr);
}

}  // namespace groundline::cli
