#include "verdict/verdict.hpp"

#include <algorithm>
#include <array>

#include "core/deterministic_math.hpp"

namespace groundline::verdict {
namespace {

using terrain::GroundUse;

constexpr Reasons set_of(std::initializer_list<Reason> list) {
    Reasons reasons;
    for (const Reason reason : list)
        reasons.add(reason);
    return reasons;
}

// The pictures are not what two cameras see now.
constexpr Reasons kNonsense = set_of({Reason::kFrozen, Reason::kSwapped, Reason::kIdentical});
// What was found may be no ground at all.
constexpr Reasons kUnusable =
    set_of({Reason::kNoGround, Reason::kWall, Reason::kOutsideGate, Reason::kPoseJump, Reason::kAmbiguous,
            Reason::kFewInliers, Reason::kShortLine});
constexpr Reasons kInformative = set_of({Reason::kNoMountPrior});
constexpr Reasons kRemembered = set_of({Reason::kNoMountPrior, Reason::kUncalibrated, Reason::kUnchecked,
                                        Reason::kOverload, Reason::kHalfResolution});

constexpr bool within(Reasons reasons, Reasons allowed) {
    return (reasons.bits() & ~allowed.bits()) == 0;
}
constexpr bool share_any(Reasons a, Reasons b) {
    return (a.bits() & b.bits()) != 0;
}

// Written so that NaN fails.
constexpr bool at_least(double value, double limit) {
    return value >= limit;
}
constexpr bool at_most(double value, double limit) {
    return value <= limit;
}
constexpr bool magnitude_at_most(double value, double limit) {
    return value <= limit && value >= -limit;
}

bool is_fresh(const State& state, std::int64_t now_mono_ns, const Limits& limits) {
    if (!state.has_ground || now_mono_ns < state.exposure_mono_ns) return false;
    if (state.frames_since >= limits.hold_frames) return false;
    // Unsigned, because stamps from files may lie further apart than int64 holds.
    const std::uint64_t age =
        static_cast<std::uint64_t>(now_mono_ns) - static_cast<std::uint64_t>(state.exposure_mono_ns);
    return limits.hold_ns >= 0 && age <= static_cast<std::uint64_t>(limits.hold_ns);
}

void judge_pictures(const Evidence& evidence, const Limits& limits, Reasons& reasons) {
    const PhotometricEvidence& seen = evidence.photometric;
    const PhotometricLimits& bear = limits.photometric;
    const bool gain_borne = at_most(seen.gain, bear.max_gain) && at_least(seen.gain * bear.max_gain, 1.0);
    if (!gain_borne || !magnitude_at_most(seen.offset, bear.max_offset) ||
        !at_most(seen.mismatch, bear.max_mismatch))
        reasons.add(Reason::kPhotometric);
    if (!at_most(seen.overexposed_share, limits.max_overexposed_share)) reasons.add(Reason::kOverexposed);
    if (!at_most(seen.dark_share, limits.max_dark_share) || !at_least(seen.contrast, limits.min_contrast))
        reasons.add(Reason::kDark);
    if (evidence.skew_ns > limits.max_skew_ns || evidence.skew_ns < -limits.max_skew_ns)
        reasons.add(Reason::kUnsynchronised);
    if (!at_most(evidence.ground_fit.blocked_share, limits.max_blocked_share))
        reasons.add(Reason::kBlockedView);
}

bool sharper(double one, double other, const Limits& limits) {
    return !at_most(one, limits.max_sharper) && !at_most(one, limits.max_sharper_ratio * other);
}

void judge_pair(const PairEvidence& pair, const Limits& limits, Reasons& reasons) {
    if (pair.identical) reasons.add(Reason::kIdentical);
    if (pair.same_pairs > limits.max_same_pairs) reasons.add(Reason::kFrozen);
    if (pair.features >= limits.min_features && !at_most(pair.behind_share, limits.max_behind_share))
        reasons.add(Reason::kSwapped);
    if (pair.row_features < limits.min_row_features) return;
    if (!magnitude_at_most(pair.row_offset_px, limits.max_row_offset_px + 2.0 * pair.row_sigma_px))
        reasons.add(Reason::kEpipolar);
    if (sharper(pair.left_sharper, pair.right_sharper, limits) ||
        sharper(pair.right_sharper, pair.left_sharper, limits))
        reasons.add(Reason::kBlurred);
}

double largest_step(const State& state, const Limits& limits) {
    return det::radians(limits.max_attitude_step_deg) * static_cast<double>(state.frames_since + 1);
}

// The camera turned as the ground seems to have. What the attitude does not explain must not be a jump
// itself: an input that stands still excuses none.
bool turned_alike(const Evidence& evidence, const State& state, const Limits& limits) {
    const AttitudeInput& now = evidence.attitude;
    const AttitudeInput& then = state.attitude;
    if (!now.valid || !then.valid || !evidence.ground.metric) return false;
    const double gap = det::radians(limits.max_attitude_gap_deg);
    if (!at_most(now.sigma_rad, 0.5 * gap) || !at_most(then.sigma_rad, 0.5 * gap)) return false;
    const GroundPose& pose = evidence.ground.pose;
    const GroundPose& last = state.ground.pose;
    const double left = std::min(gap, largest_step(state, limits));
    return magnitude_at_most((pose.pitch_rad - last.pitch_rad) - (now.pitch_rad - then.pitch_rad), left) &&
           magnitude_at_most((pose.roll_rad - last.roll_rad) - (now.roll_rad - then.roll_rad), left);
}

bool jumped(const Ground& own, const State& state, const Limits& limits) {
    if (!state.ground.metric) return false;
    if (!own.metric) return true;  // where it went cannot be said
    const double step = largest_step(state, limits);
    return !magnitude_at_most(own.pose.pitch_rad - state.ground.pose.pitch_rad, step) ||
           !magnitude_at_most(own.pose.roll_rad - state.ground.pose.roll_rad, step);
}

void judge_ground(const Evidence& evidence, const State& state, bool fresh, const Limits& limits,
                  Reasons& reasons) {
    const GroundEvidence& fit = evidence.ground_fit;
    const Ground& own = evidence.ground;
    if (fit.wall) reasons.add(Reason::kWall);
    if (!at_least(fit.density, limits.min_density)) reasons.add(Reason::kLowDensity);
    if (!fit.line_found) {
        reasons.add(Reason::kNoGround);
        return;  // the other measures are about a line
    }
    if (!fit.inside_gate) reasons.add(Reason::kOutsideGate);
    if (!at_least(fit.inlier_share, limits.min_inlier_share)) reasons.add(Reason::kFewInliers);
    if (!at_least(fit.line_run_share, limits.min_line_run_share)) reasons.add(Reason::kShortLine);
    if (!at_most(fit.second_peak_ratio, limits.max_second_peak_ratio)) reasons.add(Reason::kAmbiguous);
    if (!at_most(fit.residual_rms_px, limits.max_residual_rms_px) ||
        !at_most(fit.row_residual_px, limits.max_row_residual_px))
        reasons.add(Reason::kUneven);
    if (!own.found) {
        // The other reasons mostly say why; kNoGround where they do not.
        if (!share_any(reasons, kUnusable)) reasons.add(Reason::kNoGround);
        return;
    }
    if (evidence.calibrated &&
        (!own.metric || !at_most(own.sigma.pitch_rad, det::radians(limits.max_sigma_pitch_deg)) ||
         !at_most(own.sigma.height_m, limits.max_sigma_height_share * own.pose.height_m)))
        reasons.add(Reason::kUncertainPose);
    if (fresh && jumped(own, state, limits) && !turned_alike(evidence, state, limits))
        reasons.add(Reason::kPoseJump);
}

}  // namespace

Decision decide(const Evidence& evidence, const State& state, std::int64_t now_mono_ns,
                const Limits& limits) {
    const bool fresh = is_fresh(state, now_mono_ns, limits);
    Decision decision;
    Reasons& reasons = decision.reasons;
    if (!evidence.calibrated) reasons.add(Reason::kUncalibrated);
    if (!evidence.mount_prior) reasons.add(Reason::kNoMountPrior);
    if (!evidence.checked) reasons.add(Reason::kUnchecked);
    if (evidence.overloaded) reasons.add(Reason::kOverload);
    if (evidence.half_resolution) reasons.add(Reason::kHalfResolution);
    judge_pictures(evidence, limits, reasons);
    judge_pair(evidence.pair, limits, reasons);
    judge_ground(evidence, state, fresh, limits, reasons);

    decision.attitude = evidence.attitude;
    if (share_any(reasons, kNonsense)) return decision;
    if (!share_any(reasons, kUnusable)) {
        const bool trusted = within(reasons, kInformative);
        decision.verdict = trusted ? Verdict::kTrusted : Verdict::kDegraded;
        decision.use = trusted ? GroundUse::kOwn : GroundUse::kWeak;
        decision.ground = evidence.ground;
    } else if (fresh) {
        reasons.add(Reason::kHeldGround);
        decision.verdict = Verdict::kDegraded;
        decision.use = GroundUse::kHeld;
        decision.ground = state.ground;
    }
    return decision;
}

State next_state(const Decision& decision, const State& state, std::int64_t now_mono_ns,
                 const Limits& limits) {
    // A ground that is not the frame's own always comes with a further reason.
    if (within(decision.reasons, kRemembered))
        return {true, decision.ground, now_mono_ns, 0, decision.attitude};
    if (!is_fresh(state, now_mono_ns, limits)) return {};
    State next = state;
    ++next.frames_since;
    return next;
}

Decision decide_without_frames() {
    Decision decision;
    decision.reasons.add(Reason::kNoFrames);
    return decision;
}

}  // namespace groundline::verdict
