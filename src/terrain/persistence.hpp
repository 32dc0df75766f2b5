// What was seen in a sector stays a moment: one frame without it does not clear the way.
#pragma once

#include <array>
#include <cstdint>

#include "core/evidence.hpp"
#include "core/fixed_vector.hpp"
#include "core/result.hpp"
#include "terrain/config.hpp"

namespace groundline::terrain {

// The memory of the sectors of one camera pair. Of a fixed size; what it holds and answers is a function of
// the frames given since the last reset, each of them stamp, verdict and sectors: a replay that gives the
// same gives the same. Only sectors are held: the mask stays a function of its frame alone.
//
// In each sector the nearest obstacle or drop is remembered as it was seen last. Seen again it is where
// something is seen at its range or nearer (3 deviations and what 3 m/s make of the time between). Else it is
// absent, and held: blocked, with its range, class and deviation as they were, until it was absent in
// clear_frames of the last clear_window frames. It is never moved and never given to another sector. Where
// the frame itself shows a gap nearer than that, the gap is what is said, and the thing stays remembered.
//
// A thing that moves aside leaves nothing behind: it is not held where, in the same frame, a sector newly
// shows something at its range, with sectors that show it too between.
class Persistence {
  public:
    // A longer time between two stamps is a gap.
    static constexpr std::int64_t kGapNs = 500'000'000;

    // Throws Refusal unless 1 <= clear_frames <= clear_window <= 32.
    explicit Persistence(const TerrainConfig& config);

    // Takes the sectors as this frame alone shows them and adds what is held. Forgets all before it where the
    // stamp lies more than kGapNs after the last or before it, the frame is blind, or has another number of
    // sectors.
    void apply(std::int64_t exposure_mono_ns, Verdict verdict, FixedVector<Sector, kMaxSectors>& sectors);
    void reset();

  private:
    struct Thing {
        bool known = false;
        TerrainClass kind = TerrainClass::kUnknown;
        double nearest_m = 0.0;
        double sigma_m = 0.0;
        std::uint32_t absent = 0;  // bit i: absent i frames ago
    };
    static Thing seen_in(const Sector& sector);
    static bool at_range(const Thing& seen, const Thing& before, double moved_m);
    bool moved_aside(int from, int step, double moved_m) const;

    int clear_frames_;
    std::uint32_t window_;  // a bit for each of its frames
    int count_ = 0;
    std::int64_t last_ns_ = 0;
    std::array<Thing, kMaxSectors> things_;
    std::array<Thing, kMaxSectors> seen_;  // of the frame at hand
};

}  // namespace groundline::terrain
