#include "daemon/host_health.hpp"

#include <algorithm>
#include <fstream>
#include <optional>
#include <string>
#include <system_error>

namespace groundline::daemon {
namespace fs = std::filesystem;
namespace {

// A zone that is off reads 0 or a fault; no computer runs outside of this.
constexpr double kColdest = -60.0;
constexpr double kHottest = 200.0;
// Of the firmware's bits the lower four are about now: too little voltage, capped, throttled, at the limit.
constexpr long kNow = 0xF;

std::optional<long> number_in(const fs::path& file, int base = 10) {
    std::ifstream stream(file);
    std::string text;
    if (!(stream >> text)) return std::nullopt;
    char* end = nullptr;
    const long value = std::strtol(text.c_str(), &end, base);
    if (end == text.c_str()) return std::nullopt;
    return value;
}

std::vector<fs::path> folders(const fs::path& parent, const std::string& beginning) {
    std::vector<fs::path> found;
    std::error_code fault;
    for (const auto& entry : fs::directory_iterator(parent, fault))
        if (entry.path().filename().string().starts_with(beginning)) found.push_back(entry.path());
    std::sort(found.begin(), found.end());
    return found;
}

}  // namespace

HostSensors::HostSensors(const fs::path& sys) {
    for (const fs::path& zone : folders(sys / "class/thermal", "thermal_zone"))
        temperatures_.push_back(zone / "temp");
    for (const fs::path& policy : folders(sys / "devices/system/cpu/cpufreq", "policy"))
        frequencies_.push_back({policy / "scaling_max_freq", policy / "cpuinfo_max_freq"});
    const fs::path firmware = sys / "devices/platform/soc/soc:firmware/get_throttled";
    if (number_in(firmware, 16)) firmware_ = firmware;
}

void HostSensors::read(publish::HostHealth& host) const {
    std::optional<double> hottest;
    for (const fs::path& file : temperatures_) {
        const std::optional<long> millidegrees = number_in(file);
        if (!millidegrees) continue;
        const double degrees = static_cast<double>(*millidegrees) / 1000.0;
        if (degrees > kColdest && degrees < kHottest) hottest = std::max(degrees, hottest.value_or(degrees));
    }
    host.temperature_c = hottest.value_or(publish::kNotMeasured);

    host.throttled = -1;
    if (!firmware_.empty()) {
        if (const std::optional<long> bits = number_in(firmware_, 16)) host.throttled = (*bits & kNow) != 0;
        return;
    }
    for (const Frequency& frequency : frequencies_) {
        const std::optional<long> allowed = number_in(frequency.allowed);
        const std::optional<long> possible = number_in(frequency.possible);
        if (allowed && possible) host.throttled = std::max(host.throttled, *allowed < *possible ? 1 : 0);
    }
}

}  // namespace groundline::daemon
