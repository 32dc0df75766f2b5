// controller [URL]: go, slow or stop, at every sectors_t and at least ten times a second.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <lcm/lcm-cpp.hpp>

#include "groundline/mask_t.hpp"
#include "groundline/sectors_t.hpp"

using groundline::mask_t;
using groundline::sectors_t;

constexpr double kOldest_s = 0.3, kStopping_m = 1.0, kAhead_rad = 0.35;

const char* decide(const sectors_t& newest) {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    const double age_s =
        1e-6 * static_cast<double>(std::chrono::duration_cast<std::chrono::microseconds>(now).count() -
                                   newest.utime);
    if (!(std::abs(age_s) < kOldest_s)) return "stop: nothing new";
    if (newest.verdict == mask_t::VERDICT_BLIND) return "stop: blind";
    double free_m = INFINITY;
    for (const auto& sector : newest.sectors)
        if (std::abs(sector.bearing_rad) < kAhead_rad) free_m = std::min(free_m, sector.free_range_m);
    if (!std::isfinite(free_m) || free_m < kStopping_m) return "stop: no free ground";
    return newest.verdict == mask_t::VERDICT_TRUSTED ? "go" : "slow";
}

int main(int argc, char** argv) {
    lcm::LCM lcm(argc > 1 ? argv[1] : "udpm://239.255.76.67:7667?ttl=0");
    sectors_t newest{};  // of 1970: too old
    const auto keep = [](const lcm::ReceiveBuffer*, const std::string&, const sectors_t* sectors,
                         sectors_t* to) { *to = *sectors; };
    lcm.subscribeFunction<sectors_t, sectors_t*>("GROUNDLINE_SECTORS", keep, &newest);
    while (lcm.good() && lcm.handleTimeout(100) >= 0) {
        std::puts(decide(newest));
        std::fflush(stdout);
    }
    return 1;
}
