// Temperature and throttling of the computer, as the kernel shows them.
#pragma once

#include <filesystem>
#include <vector>

#include "publish/health.hpp"

namespace groundline::daemon {

// Looks once for what there is below `sys` (/sys but in tests); reading it later opens files and may take
// milliseconds: not for the threads that handle frames.
class HostSensors {
  public:
    explicit HostSensors(const std::filesystem::path& sys = "/sys");

    // Sets temperature_c (the hottest thermal zone) and throttled: what the Raspberry Pi's firmware says of
    // now, else whether any processor's highest frequency is below what it can do. Not measured where the
    // kernel shows neither.
    void read(publish::HostHealth& host) const;

  private:
    struct Frequency {
        std::filesystem::path allowed;
        std::filesystem::path possible;
    };
    std::vector<std::filesystem::path> temperatures_;
    std::vector<Frequency> frequencies_;
    std::filesystem::path firmware_;
};

}  // namespace groundline::daemon
