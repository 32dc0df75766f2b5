// May this frame be believed, and on which ground does its mask rest? Pure functions of evidence, state, now.
#pragma once

#include <cstdint>

#include "core/evidence.hpp"
#include "core/ground.hpp"
#include "terrain/classifier.hpp"

namespace groundline::verdict {

// How much the two cameras may differ in brightness. Any bound exceeded gives Reason::kPhotometric.
struct PhotometricLimits {
    double max_gain = 1.0;      // of the brighter over the darker camera
    double max_offset = 0.0;    // grey levels, either sign
    double max_mismatch = 0.0;  // mean difference of matching brightness ranks, grey levels
    bool operator==(const PhotometricLimits&) const = default;
};
// For matchers that compare grey levels as they are: a cost truncated at 4 % (10 levels) finds nothing at
// gain 1.06 with offset 4, which is a mismatch of about 11 levels; half the truncation still leaves contrast.
inline constexpr PhotometricLimits kRawDifferences{1.05, 10.0, 5.0};
// For matchers that bear a difference (census, local mean removed): what remains is a camera whose exposure
// has run away, so that a good part of its grey levels is clipped.
inline constexpr PhotometricLimits kLocalOrder{2.0, 64.0, 64.0};

// Where a measure stops being good enough. A value at its limit still passes; NaN never does.
struct Limits {
    double min_density = 0.15;            // fewer matches than that are as likely noise as picture
    double min_inlier_share = 0.25;       // of the valid pixels below the horizon
    double min_line_run_share = 0.25;     // of the rows below the horizon
    double max_attitude_step_deg = 2.0;   // pitch or roll, per frame since the ground last believed
    double max_attitude_gap_deg = 3.0;    // a larger step is believed if the attitude input made it too
    double max_second_peak_ratio = 0.85;  // of the strongest Hough peak
    double max_residual_rms_px = 0.75;
    double max_row_residual_px = 1.0;
    double max_sigma_pitch_deg = 0.5;      // 9 cm of height at 10 m
    double max_sigma_height_share = 0.05;  // of the height
    // Texture checks leave up to half of plain ground without disparity; more than that in the lower third is
    // something in front of the lens or nearer than the search range.
    double max_blocked_share = 0.6;
    PhotometricLimits photometric = kRawDifferences;  // the strict one: whoever sets the matcher widens it
    double max_overexposed_share = 0.25;              // a bright sky alone fills about a fifth
    double max_dark_share = 0.5;                      // most of the picture without anything to match
    double min_contrast = 10.0;                       // grey levels; noise of 2 levels alone spans 7
    // Pairs of one bit pattern in a row; the next is the third.
    int max_same_pairs = 2;
    // Of the features that are clearly nearer than infinity or beyond it. Not exchanged: up to 3 of 100 on 25
    // real sets; exchanged: 63 of 100 where the principal points are 31 px apart, else 95 and more.
    double max_behind_share = 0.35;
    int min_features = 6;
    // Vertical offset, by what is sure of it: two deviations of the median less. At 0.4 px a matcher of whole
    // rows begins to miss; on KITTI's frames 0.2 are sure at most.
    double max_row_offset_px = 0.4;
    int min_row_features = 8;
    // Steps of brightness of the one view over those of the other, and how much more than the other way
    // round: sharp pairs reach 1.05 in noise; blur of sigma 2 in one view gives 1.10 (an out-of-focus pair)
    // to 2, and ratios beyond 1.9.
    double max_sharper = 1.08;
    double max_sharper_ratio = 1.8;
    std::int64_t max_skew_ns = 2'000'000;  // at 30 deg/s of turn: 0.06 deg, 0.5 px at f = 500
    // For how long an earlier ground may stand in. A robot at 1 m/s has then moved by half its stopping
    // distance.
    std::int64_t hold_ns = 1'000'000'000;
    // The same by count, for sources whose stamps stand still: one second at 60 Hz.
    std::int64_t hold_frames = 60;
};

// What is remembered from frame to frame: the last ground that passed every check of its own.
struct State {
    bool has_ground = false;
    Ground ground;
    std::int64_t exposure_mono_ns = 0;  // of the frame that saw it
    std::int64_t frames_since = 0;      // frames decided after that one
    AttitudeInput attitude;             // of the frame that saw it
};

struct Decision {
    Verdict verdict = Verdict::kBlind;
    Reasons reasons;
    terrain::GroundUse use = terrain::GroundUse::kNone;
    Ground ground;           // to classify with; found is false where use is kNone
    AttitudeInput attitude;  // of the frame, for the memory
};

// `now_mono_ns` is the exposure of the frame that `evidence` is about, so that a replay decides as the live
// run did. Four cases, the thresholds from Limits:
//
// - kFrozen, kSwapped, kIdentical: the pictures are not what two cameras see now. Blind, whatever is
// remembered.
// - kNoGround, kWall, kOutsideGate, kPoseJump, kAmbiguous, kFewInliers, kShortLine: what was found may be no
//   ground at all. The remembered one stands in while it is fresh, at most hold_ns and hold_frames old:
//   degraded, with kHeldGround. Else blind.
// - Any other reason but kNoMountPrior: it is ground, but thin or seen badly: degraded, on the frame's own.
// - None of them: trusted; a first frame may be.
//
// Without validity checks every pixel has a disparity: density and blocked view say nothing, so kUnchecked.
//
// kPoseJump compares with the remembered ground while that is fresh. A step beyond max_attitude_step_deg is
// none where the attitude input changed by as much since then, within max_attitude_gap_deg and within a step
// that would be none: compared are changes, not angles, because the ground slopes and gravity does not. A
// stamp before the remembered one means that the source began again: the memory does not count. Worse
// evidence never gives a better verdict or use.
Decision decide(const Evidence& evidence, const State& state, std::int64_t now_mono_ns, const Limits& limits);

// The state after that decision. Remembered is a ground whose only reasons are kNoMountPrior, kUncalibrated,
// kUnchecked, kOverload and kHalfResolution: those are not about what this frame shows.
State next_state(const Decision& decision, const State& state, std::int64_t now_mono_ns,
                 const Limits& limits);

// The decision while no pairs arrive: blind, kNoFrames.
Decision decide_without_frames();

}  // namespace groundline::verdict
