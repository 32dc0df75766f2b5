#include "verdict/camera_exposure.hpp"

#include <algorithm>
#include <cmath>

namespace groundline::verdict {
namespace {

// Neither known, or as good as equal.
bool alike(double wanted, double present, double least_change) {
    if (std::isnan(wanted)) return true;
    if (std::isnan(present)) return false;
    return std::abs(wanted - present) <= least_change * std::max(std::abs(wanted), std::abs(present));
}

}  // namespace

FollowStep follow(const FollowState& state, const ExposureValues& left, const ExposureValues& right,
                  std::int64_t pair, const FollowLimits& limits) {
    FollowStep step{state, std::nullopt};
    if (state.commanded && pair - state.command_pair < limits.latency_pairs) return step;
    const auto present = [&](double said, double told) { return std::isnan(said) ? told : said; };
    const ExposureValues now{present(right.exposure_us, state.command.exposure_us),
                             present(right.gain, state.command.gain)};
    if (alike(left.exposure_us, now.exposure_us, limits.least_change) &&
        alike(left.gain, now.gain, limits.least_change))
        return step;
    const bool again = state.commanded &&
                       alike(left.exposure_us, state.command.exposure_us, limits.least_change) &&
                       alike(left.gain, state.command.gain, limits.least_change);
    if (again && pair - state.command_pair < limits.repeat_pairs) return step;
    step.set = left;
    step.state = {true, left, pair};
    return step;
}

}  // namespace groundline::verdict
