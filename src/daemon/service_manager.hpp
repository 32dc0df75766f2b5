// What the daemon tells systemd, over the datagram socket that sd_notify(3) describes.
#pragma once

#include <cstdint>
#include <string>

namespace groundline::daemon {

// Not libsystemd: the protocol is one datagram and promised to stay, and the library would bring four
// compression libraries and a cipher into a program that means to link little, on four architectures.
class ServiceManager {
  public:
    // Takes NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID out of the environment, so that no child sees them.
    // Does nothing from then on where there is no service manager.
    ServiceManager();
    ~ServiceManager();
    ServiceManager(const ServiceManager&) = delete;
    ServiceManager& operator=(const ServiceManager&) = delete;

    // Lines of NAME=VALUE. Never waits: what the manager cannot take now is lost, false: tell it again. True
    // also where there is nobody to tell.
    bool tell(const std::string& lines) const;

    // Within which WATCHDOG=1 is expected, 0 where it is not.
    std::int64_t watchdog_ns() const { return watchdog_ns_; }

  private:
    std::string address_;  // '@' first: an abstract one
    int socket_ = -1;
    std::int64_t watchdog_ns_ = 0;
};

}  // namespace groundline::daemon
