// What health comes down to in one sentence, for `systemctl status` and the log.
#pragma once

#include <string>

#include "publish/health.hpp"

namespace groundline::daemon {

// "waiting for cameras", "running: 29.8 pairs/s, degraded (overload)", "no pairs for 3 s, the cameras are out
// of step", "stopping".
std::string status_of(const publish::HealthReport& report);

// The verdict with what makes it less than trusted: "trusted", "degraded (dark, uneven)".
std::string verdict_of(const publish::HealthReport& report);

}  // namespace groundline::daemon
