#include "daemon/service_manager.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <charconv>
#include <cstddef>
#include <cstdlib>

namespace groundline::daemon {
namespace {

std::string take_out(const char* name) {
    const char* value = std::getenv(name);
    std::string text = value == nullptr ? "" : value;
    unsetenv(name);
    return text;
}

std::int64_t number(const std::string& text) {
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc{} && end == text.data() + text.size() ? value : 0;
}

}  // namespace

ServiceManager::ServiceManager() : address_(take_out("NOTIFY_SOCKET")) {
    const std::int64_t watchdog_us = number(take_out("WATCHDOG_USEC"));
    const std::string watched = take_out("WATCHDOG_PID");
    const bool usable = address_.size() > 1 && address_.size() < sizeof(sockaddr_un::sun_path) &&
                        (address_[0] == '/' || address_[0] == '@');
    if (!usable) return;
    socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (watchdog_us > 0 && (watched.empty() || number(watched) == getpid()))
        watchdog_ns_ = watchdog_us * 1000;
}

ServiceManager::~ServiceManager() {
    if (socket_ >= 0) ::close(socket_);
}

bool ServiceManager::tell(const std::string& lines) const {
    if (socket_ < 0) return true;
    sockaddr_un to{};
    to.sun_family = AF_UNIX;
    address_.copy(to.sun_path, address_.size());
    if (address_[0] == '@') to.sun_path[0] = '\0';
    const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address_.size());
    const ssize_t sent = sendto(socket_, lines.data(), lines.size(), MSG_NOSIGNAL,
                                reinterpret_cast<const sockaddr*>(&to), length);
    return sent == static_cast<ssize_t>(lines.size());
}

}  // namespace groundline::daemon
