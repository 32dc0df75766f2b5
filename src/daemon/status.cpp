#include "daemon/status.hpp"

#include <fmt/format.h>

#include <cmath>

namespace groundline::daemon {

std::string verdict_of(const publish::HealthReport& report) {
    std::string text(kVerdictNames[static_cast<std::size_t>(report.verdict)]);
    if (report.verdict == Verdict::kTrusted) return text;
    std::string why;
    for (int i = 0; i < kReasons; ++i) {
        const auto reason = static_cast<Reason>(i);
        // That one never costs trust.
        if (!report.reasons.has(reason) || reason == Reason::kNoMountPrior) continue;
        why += fmt::format("{}{}", why.empty() ? "" : ", ", kReasonNames[static_cast<std::size_t>(i)]);
    }
    return why.empty() ? text : fmt::format("{} ({})", text, why);
}

namespace {

// Why no pair comes.
const char* lack_of(const publish::HealthReport& report) {
    const publish::CameraHealth& camera = report.camera;
    if (camera.state && *camera.state != verdict::CameraState::kRunning) return "waiting for cameras";
    if (camera.out_of_step) return "the cameras are out of step";
    if (report.counts[static_cast<std::size_t>(Count::kFramesBad)] > 0) return "the pictures cannot be read";
    return "waiting for pairs";
}

}  // namespace

std::string status_of(const publish::HealthReport& report) {
    switch (report.state) {
        case publish::LifeState::kStarting:
            return lack_of(report);
        case publish::LifeState::kStalled:
            return fmt::format("no pairs for {:.0f} s, {}", report.result_age_s, lack_of(report));
        case publish::LifeState::kStopping:
            return "stopping";
        case publish::LifeState::kRunning:
            break;
    }
    if (std::isnan(report.publish_rate_hz)) return "running: " + verdict_of(report);
    return fmt::format("running: {:.1f} pairs/s, {}", report.publish_rate_hz, verdict_of(report));
}

}  // namespace groundline::daemon
