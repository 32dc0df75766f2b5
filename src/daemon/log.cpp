#include "daemon/log.hpp"

#include <pthread.h>
#include <spdlog/async.h>
#include <spdlog/async_logger.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <utility>

namespace groundline::daemon {
namespace {

constexpr const char* kName = "groundlined";
constexpr std::size_t kQueuedLines = 256;

// The journal takes the priority of a line from a number before it, as syslog numbers them.
class Priority final : public spdlog::custom_flag_formatter {
  public:
    void format(const spdlog::details::log_msg& line, const std::tm& /*time*/,
                spdlog::memory_buf_t& out) override {
        const char* prefix = line.level >= spdlog::level::critical ? "<2>"
                             : line.level == spdlog::level::err    ? "<3>"
                             : line.level == spdlog::level::warn   ? "<4>"
                             : line.level == spdlog::level::info   ? "<6>"
                                                                   : "<7>";
        out.append(prefix, prefix + 3);
    }
    std::unique_ptr<custom_flag_formatter> clone() const override { return std::make_unique<Priority>(); }
};

std::shared_ptr<spdlog::logger> make_log() {
    spdlog::init_thread_pool(kQueuedLines, 1, [] { pthread_setname_np(pthread_self(), "gl-log"); });
    auto logger = std::make_shared<spdlog::async_logger>(
        kName, std::make_shared<spdlog::sinks::stderr_sink_mt>(), spdlog::thread_pool(),
        spdlog::async_overflow_policy::overrun_oldest);
    auto formatter = std::make_unique<spdlog::pattern_formatter>();
    formatter->add_flag<Priority>('*');
    // The journal brings the time itself.
    formatter->set_pattern(stderr_is_journal() ? "%*%v" : "%Y-%m-%d %H:%M:%S.%e %l: %v");
    logger->set_formatter(std::move(formatter));
    spdlog::register_logger(logger);
    return logger;
}

}  // namespace

bool stderr_is_journal() {
    const char* stream = std::getenv("JOURNAL_STREAM");
    struct stat status {};
    if (stream == nullptr || fstat(2, &status) != 0) return false;
    return std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino) == stream;
}

spdlog::logger& log() {
    static const std::shared_ptr<spdlog::logger> logger = make_log();
    return *logger;
}

std::size_t lost_lines() {
    const auto pool = spdlog::thread_pool();
    return pool ? pool->overrun_counter() : 0;
}

void close_log() {
    spdlog::shutdown();
}

void say(int priority, const std::string& sentence) {
    if (stderr_is_journal())
        std::fprintf(stderr, "<%d>%s\n", priority, sentence.c_str());
    else
        std::fprintf(stderr, "%s: %s\n", kName, sentence.c_str());
}

}  // namespace groundline::daemon
