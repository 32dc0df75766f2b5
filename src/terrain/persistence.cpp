#include "terrain/persistence.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/error.hpp"

namespace groundline::terrain {
namespace {

constexpr double kSigmas = 3.0;
// Of a robot and what it meets, towards or away from each other.
constexpr double kSpeed = 3.0;  // m/s

double allowance(double sigma_m, double other_m, double moved_m) {
    return kSigmas * std::sqrt(sigma_m * sigma_m + other_m * other_m) + moved_m;
}

}  // namespace

Persistence::Persistence(const TerrainConfig& config)
    : clear_frames_(config.clear_frames),
      window_(config.clear_window >= 32 ? 0xFFFFFFFFU : (1U << std::max(config.clear_window, 0)) - 1U) {
    if (config.clear_frames < 1 || config.clear_frames > config.clear_window || config.clear_window > 32)
        throw Refusal(ExitStatus::kConfig,
                      "terrain.clear_frames must be 1 or more, and at most terrain.clear_window, which is at "
                      "most 32");
}

void Persistence::reset() {
    things_ = {};
}

Persistence::Thing Persistence::seen_in(const Sector& sector) {
    Thing thing;
    if (!sector.blocked || sector.kind == TerrainClass::kUnknown) return thing;
    thing.known = true;
    thing.kind = sector.kind;
    thing.nearest_m = sector.nearest_m;
    thing.sigma_m = sector.nearest_sigma_m;
    return thing;
}

bool Persistence::at_range(const Thing& seen, const Thing& before, double moved_m) {
    return seen.known && before.known &&
           std::fabs(seen.nearest_m - before.nearest_m) <= allowance(seen.sigma_m, before.sigma_m, moved_m);
}

// Towards one side, through sectors that show what was at `from`, is there one that did not show it before?
bool Persistence::moved_aside(int from, int step, double moved_m) const {
    const Thing& thing = things_[static_cast<std::size_t>(from)];
    for (int i = from + step; i >= 0 && i < count_; i += step) {
        const auto at = static_cast<std::size_t>(i);
        if (!at_range(seen_[at], thing, moved_m)) return false;
        if (!at_range(things_[at], thing, moved_m)) return true;
    }
    return false;
}

void Persistence::apply(std::int64_t exposure_mono_ns, Verdict verdict,
                        FixedVector<Sector, kMaxSectors>& sectors) {
    const std::int64_t since_ns = exposure_mono_ns - last_ns_;
    last_ns_ = exposure_mono_ns;
    const int count = static_cast<int>(sectors.size());
    if (verdict == Verdict::kBlind || since_ns < 0 || since_ns > kGapNs || count != count_) things_ = {};
    count_ = count;
    if (verdict == Verdict::kBlind) return;

    const double moved_m = kSpeed * 1e-9 * static_cast<double>(since_ns);
    for (std::size_t i = 0; i < sectors.size(); ++i)
        seen_[i] = seen_in(sectors[i]);
    std::array<Thing, kMaxSectors> next = seen_;
    for (int i = 0; i < count_; ++i) {
        const auto at = static_cast<std::size_t>(i);
        const Thing& before = things_[at];
        if (!before.known) continue;
        const bool same = at_range(seen_[at], before, moved_m);
        const bool nearer = seen_[at].known && seen_[at].nearest_m < before.nearest_m;
        if (nearer && !same) continue;
        next[at].absent = (before.absent << 1U | (same ? 0U : 1U)) & window_;
        if (same) continue;
        if (std::popcount(next[at].absent) >= clear_frames_ || moved_aside(i, 1, moved_m) ||
            moved_aside(i, -1, moved_m)) {
            next[at].absent = 0;
            continue;
        }
        next[at] = {true, before.kind, before.nearest_m, before.sigma_m, next[at].absent};
        Sector& sector = sectors[at];
        if (sector.blocked && sector.nearest_m <= before.nearest_m) continue;
        sector.blocked = sector.held = true;
        sector.kind = before.kind;
        sector.nearest_m = before.nearest_m;
        sector.nearest_sigma_m = before.sigma_m;
        sector.free_range_m = std::min(sector.free_range_m, before.nearest_m);
    }
    things_ = next;
}

}  // namespace groundline::terrain
