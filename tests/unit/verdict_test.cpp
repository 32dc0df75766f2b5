// The verdict as a table: each rule on both sides of its limit, what is remembered, and that worse is never
// better.
#include "verdict/verdict.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <set>
#include <string>
#include <vector>

namespace groundline::verdict {
namespace {

using terrain::GroundUse;

constexpr std::int64_t kMs = 1'000'000;
const double kNaN = std::numeric_limits<double>::quiet_NaN();

double rad(double degrees) {
    return degrees * 3.14159265358979323846 / 180.0;
}

Reasons set_of(std::initializer_list<Reason> list) {
    Reasons reasons;
    for (const Reason reason : list)
        reasons.add(reason);
    return reasons;
}

std::string names(Reasons reasons) {
    std::string text;
    for (int i = 0; i < kReasons; ++i)
        if (reasons.has(static_cast<Reason>(i)))
            text += std::string(kReasonNames.at(static_cast<std::size_t>(i))) + ' ';
    return text;
}

Ground good_ground(double pitch_deg = 10.0) {
    Ground ground;
    ground.found = ground.metric = true;
    ground.plane = {0.0, 0.05, -6.0};
    ground.pose = {rad(pitch_deg), rad(1.0), 1.0};
    ground.sigma = {rad(0.05), rad(0.05), 0.01};
    return ground;
}

// Passes every check with room to spare, and knows its mount.
Evidence good_evidence() {
    Evidence evidence;
    evidence.calibrated = evidence.mount_prior = true;
    evidence.photometric = {1.01, 0.5, 1.0, 0.01, 0.05, 120.0};
    evidence.pair.patches = evidence.pair.matched = evidence.pair.features = evidence.pair.row_features = 80;
    evidence.pair.row_offset_px = 0.05;
    evidence.pair.row_sigma_px = 0.02;
    evidence.pair.left_sharper = evidence.pair.right_sharper = 0.95;
    evidence.ground_fit = {true, true, false, 0.8, 0.7, 0.9, 0.3, 0.25, 0.1, 0.1};
    evidence.ground = good_ground();
    return evidence;
}

State remembering(double pitch_deg, std::int64_t exposure_mono_ns, std::int64_t frames_since = 0) {
    return {true, good_ground(pitch_deg), exposure_mono_ns, frames_since, {}};
}

const Limits kLimits;

TEST(Verdict, AFirstFrameMayBeTrusted) {
    const Decision decision = decide(good_evidence(), State(), 0, kLimits);
    EXPECT_EQ(decision.verdict, Verdict::kTrusted);
    EXPECT_TRUE(decision.reasons.empty()) << names(decision.reasons);
    EXPECT_EQ(decision.use, GroundUse::kOwn);
    EXPECT_TRUE(decision.ground.found);
    EXPECT_EQ(decision.ground.pose.pitch_rad, rad(10.0));
}

TEST(Verdict, WithoutMountIsInformativeOnly) {
    Evidence evidence = good_evidence();
    evidence.mount_prior = false;
    const Decision decision = decide(evidence, State(), 0, kLimits);
    EXPECT_EQ(decision.verdict, Verdict::kTrusted);
    EXPECT_EQ(decision.reasons, set_of({Reason::kNoMountPrior}));
    EXPECT_EQ(decision.use, GroundUse::kOwn);
}

TEST(Verdict, WithoutFramesIsBlind) {
    const Decision decision = decide_without_frames();
    EXPECT_EQ(decision.verdict, Verdict::kBlind);
    EXPECT_EQ(decision.reasons, set_of({Reason::kNoFrames}));
    EXPECT_EQ(decision.use, GroundUse::kNone);
    EXPECT_FALSE(decision.ground.found);
}

// Every rule: what passes at the limit, what fails just beyond it, and what the failure costs.
struct Rule {
    const char* what;
    Reason reason;
    GroundUse use;  // without memory: kWeak (degraded) or kNone (blind)
    std::function<void(Evidence&)> at_limit;
    std::function<void(Evidence&)> beyond;
    bool hopeless = false;  // blind whatever is remembered
};

double above(double value) {
    return std::nextafter(value, 1e9);
}
double below(double value) {
    return std::nextafter(value, -1e9);
}

const std::vector<Rule>& rules() {
    using E = Evidence;
    static const std::vector<Rule> table = {
        {"uncalibrated", Reason::kUncalibrated, GroundUse::kWeak, [](E&) {},
         [](E& e) { e.calibrated = e.ground.metric = false; }},
        {"unchecked", Reason::kUnchecked, GroundUse::kWeak, [](E&) {}, [](E& e) { e.checked = false; }},
        {"overload", Reason::kOverload, GroundUse::kWeak, [](E&) {}, [](E& e) { e.overloaded = true; }},
        {"half resolution", Reason::kHalfResolution, GroundUse::kWeak, [](E&) {},
         [](E& e) { e.half_resolution = true; }},
        {"density", Reason::kLowDensity, GroundUse::kWeak, [](E& e) { e.ground_fit.density = 0.15; },
         [](E& e) { e.ground_fit.density = below(0.15); }},
        {"density NaN", Reason::kLowDensity, GroundUse::kWeak, [](E&) {},
         [](E& e) { e.ground_fit.density = kNaN; }},
        {"inliers", Reason::kFewInliers, GroundUse::kNone, [](E& e) { e.ground_fit.inlier_share = 0.25; },
         [](E& e) { e.ground_fit.inlier_share = below(0.25); }},
        {"inliers NaN", Reason::kFewInliers, GroundUse::kNone, [](E&) {},
         [](E& e) { e.ground_fit.inlier_share = kNaN; }},
        {"run of rows", Reason::kShortLine, GroundUse::kNone,
         [](E& e) { e.ground_fit.line_run_share = 0.25; },
         [](E& e) { e.ground_fit.line_run_share = below(0.25); }},
        {"gate", Reason::kOutsideGate, GroundUse::kNone, [](E&) {},
         [](E& e) { e.ground_fit.inside_gate = false; }},
        {"second peak", Reason::kAmbiguous, GroundUse::kNone,
         [](E& e) { e.ground_fit.second_peak_ratio = 0.85; },
         [](E& e) { e.ground_fit.second_peak_ratio = above(0.85); }},
        {"residual", Reason::kUneven, GroundUse::kWeak, [](E& e) { e.ground_fit.residual_rms_px = 0.75; },
         [](E& e) { e.ground_fit.residual_rms_px = above(0.75); }},
        {"row residual", Reason::kUneven, GroundUse::kWeak, [](E& e) { e.ground_fit.row_residual_px = 1.0; },
         [](E& e) { e.ground_fit.row_residual_px = above(1.0); }},
        {"sigma pitch", Reason::kUncertainPose, GroundUse::kWeak,
         [](E& e) { e.ground.sigma.pitch_rad = rad(0.4999); },
         [](E& e) { e.ground.sigma.pitch_rad = rad(0.5001); }},
        {"sigma pitch NaN", Reason::kUncertainPose, GroundUse::kWeak, [](E&) {},
         [](E& e) { e.ground.sigma.pitch_rad = kNaN; }},
        {"sigma height", Reason::kUncertainPose, GroundUse::kWeak,
         [](E& e) { e.ground.pose.height_m = 2.0, e.ground.sigma.height_m = 0.0999; },
         [](E& e) { e.ground.pose.height_m = 2.0, e.ground.sigma.height_m = 0.1001; }},
        {"no metres though calibrated", Reason::kUncertainPose, GroundUse::kWeak, [](E&) {},
         [](E& e) { e.ground.metric = false; }},
        {"blocked", Reason::kBlockedView, GroundUse::kWeak, [](E& e) { e.ground_fit.blocked_share = 0.6; },
         [](E& e) { e.ground_fit.blocked_share = above(0.6); }},
        {"wall", Reason::kWall, GroundUse::kNone, [](E&) {}, [](E& e) { e.ground_fit.wall = true; }},
        {"no line", Reason::kNoGround, GroundUse::kNone, [](E&) {},
         [](E& e) { e.ground_fit.line_found = false; }},
        {"no ground", Reason::kNoGround, GroundUse::kNone, [](E&) {}, [](E& e) { e.ground.found = false; }},
        {"brighter left", Reason::kPhotometric, GroundUse::kWeak, [](E& e) { e.photometric.gain = 1.05; },
         [](E& e) { e.photometric.gain = above(1.05); }},
        {"darker left", Reason::kPhotometric, GroundUse::kWeak, [](E& e) { e.photometric.gain = 0.9524; },
         [](E& e) { e.photometric.gain = 0.9523; }},
        {"offset up", Reason::kPhotometric, GroundUse::kWeak, [](E& e) { e.photometric.offset = 10.0; },
         [](E& e) { e.photometric.offset = above(10.0); }},
        {"offset down", Reason::kPhotometric, GroundUse::kWeak, [](E& e) { e.photometric.offset = -10.0; },
         [](E& e) { e.photometric.offset = below(-10.0); }},
        {"mismatch", Reason::kPhotometric, GroundUse::kWeak, [](E& e) { e.photometric.mismatch = 5.0; },
         [](E& e) { e.photometric.mismatch = above(5.0); }},
        {"mismatch NaN", Reason::kPhotometric, GroundUse::kWeak, [](E&) {},
         [](E& e) { e.photometric.mismatch = kNaN; }},
        {"gain NaN", Reason::kPhotometric, GroundUse::kWeak, [](E&) {},
         [](E& e) { e.photometric.gain = kNaN; }},
        {"overexposed", Reason::kOverexposed, GroundUse::kWeak,
         [](E& e) { e.photometric.overexposed_share = 0.25; },
         [](E& e) { e.photometric.overexposed_share = above(0.25); }},
        {"dark", Reason::kDark, GroundUse::kWeak, [](E& e) { e.photometric.dark_share = 0.5; },
         [](E& e) { e.photometric.dark_share = above(0.5); }},
        {"flat", Reason::kDark, GroundUse::kWeak, [](E& e) { e.photometric.contrast = 10.0; },
         [](E& e) { e.photometric.contrast = below(10.0); }},
        {"right late", Reason::kUnsynchronised, GroundUse::kWeak, [](E& e) { e.skew_ns = 2 * kMs; },
         [](E& e) { e.skew_ns = 2 * kMs + 1; }},
        {"left late", Reason::kUnsynchronised, GroundUse::kWeak, [](E& e) { e.skew_ns = -2 * kMs; },
         [](E& e) { e.skew_ns = -2 * kMs - 1; }},
        {"skew of no sense", Reason::kUnsynchronised, GroundUse::kWeak, [](E&) {},
         [](E& e) { e.skew_ns = std::numeric_limits<std::int64_t>::min(); }},
        {"frozen", Reason::kFrozen, GroundUse::kNone, [](E& e) { e.pair.same_pairs = 2; },
         [](E& e) { e.pair.same_pairs = 3; }, true},
        {"identical", Reason::kIdentical, GroundUse::kNone, [](E&) {}, [](E& e) { e.pair.identical = true; },
         true},
        {"swapped", Reason::kSwapped, GroundUse::kNone, [](E& e) { e.pair.behind_share = 0.35; },
         [](E& e) { e.pair.behind_share = above(0.35); }, true},
        {"swapped NaN", Reason::kSwapped, GroundUse::kNone, [](E&) {},
         [](E& e) { e.pair.behind_share = kNaN; }, true},
        {"swapped, few features", Reason::kSwapped, GroundUse::kNone,
         [](E& e) { e.pair.features = 5, e.pair.behind_share = 1.0; },
         [](E& e) { e.pair.features = 6, e.pair.behind_share = 1.0; }, true},
        {"rows down", Reason::kEpipolar, GroundUse::kWeak,
         [](E& e) { e.pair.row_offset_px = 0.4, e.pair.row_sigma_px = 0.0; },
         [](E& e) { e.pair.row_offset_px = above(0.4), e.pair.row_sigma_px = 0.0; }},
        {"rows up", Reason::kEpipolar, GroundUse::kWeak,
         [](E& e) { e.pair.row_offset_px = -0.4, e.pair.row_sigma_px = 0.0; },
         [](E& e) { e.pair.row_offset_px = below(-0.4), e.pair.row_sigma_px = 0.0; }},
        {"rows, not sure", Reason::kEpipolar, GroundUse::kWeak,
         [](E& e) { e.pair.row_offset_px = 0.59, e.pair.row_sigma_px = 0.1; },
         [](E& e) { e.pair.row_offset_px = 0.61, e.pair.row_sigma_px = 0.1; }},
        {"rows, few features", Reason::kEpipolar, GroundUse::kWeak,
         [](E& e) { e.pair.row_offset_px = 2.0, e.pair.row_features = 7; },
         [](E& e) { e.pair.row_offset_px = 2.0, e.pair.row_features = 8; }},
        {"rows NaN", Reason::kEpipolar, GroundUse::kWeak, [](E&) {},
         [](E& e) { e.pair.row_offset_px = kNaN; }},
        {"blurred right", Reason::kBlurred, GroundUse::kWeak,
         [](E& e) { e.pair.left_sharper = 1.08, e.pair.right_sharper = 0.3; },
         [](E& e) { e.pair.left_sharper = above(1.08), e.pair.right_sharper = 0.3; }},
        {"blurred left", Reason::kBlurred, GroundUse::kWeak,
         [](E& e) { e.pair.right_sharper = 1.8, e.pair.left_sharper = 1.0; },
         [](E& e) { e.pair.right_sharper = above(1.8), e.pair.left_sharper = 1.0; }},
        {"blurred NaN", Reason::kBlurred, GroundUse::kWeak, [](E&) {},
         [](E& e) { e.pair.left_sharper = kNaN; }},
    };
    return table;
}

TEST(Verdict, EveryRuleOnBothSidesOfItsLimit) {
    for (const Rule& rule : rules()) {
        SCOPED_TRACE(rule.what);
        Evidence evidence = good_evidence();
        rule.at_limit(evidence);
        Decision decision = decide(evidence, State(), 0, kLimits);
        EXPECT_EQ(decision.verdict, Verdict::kTrusted) << names(decision.reasons);

        rule.beyond(evidence);
        decision = decide(evidence, State(), 0, kLimits);
        EXPECT_EQ(decision.reasons, set_of({rule.reason})) << names(decision.reasons);
        EXPECT_EQ(decision.use, rule.use);
        EXPECT_EQ(decision.verdict, rule.use == GroundUse::kWeak ? Verdict::kDegraded : Verdict::kBlind);
        EXPECT_EQ(decision.ground.found, rule.use == GroundUse::kWeak);
    }
}

TEST(Verdict, AnUnusableGroundIsReplacedByTheRememberedOne) {
    for (const Rule& rule : rules()) {
        SCOPED_TRACE(rule.what);
        Evidence evidence = good_evidence();
        rule.beyond(evidence);
        const State state = remembering(9.0, 100 * kMs);
        const Decision decision = decide(evidence, state, 133 * kMs, kLimits);
        EXPECT_TRUE(decision.reasons.has(rule.reason));
        if (rule.hopeless) {
            EXPECT_EQ(decision.verdict, Verdict::kBlind);
            EXPECT_EQ(decision.use, GroundUse::kNone);
            EXPECT_EQ(decision.reasons, set_of({rule.reason}));
            EXPECT_FALSE(decision.ground.found);
            continue;
        }
        const bool held = rule.use == GroundUse::kNone || !evidence.ground.metric;  // pose not comparable
        EXPECT_EQ(decision.verdict, Verdict::kDegraded);
        EXPECT_EQ(decision.use, held ? GroundUse::kHeld : GroundUse::kWeak);
        EXPECT_EQ(decision.reasons.has(Reason::kHeldGround), held);
        EXPECT_EQ(decision.ground.pose.pitch_rad, held ? rad(9.0) : evidence.ground.pose.pitch_rad);
        EXPECT_TRUE(decision.ground.found);
    }
}

TEST(Verdict, HoldsForTheHoldTimeAndNoLonger) {
    Evidence evidence = good_evidence();
    evidence.ground_fit.line_found = false;
    const State state = remembering(10.0, 5000 * kMs);
    const struct {
        std::int64_t now;
        bool held;
    } table[] = {{5000 * kMs, true},
                 {6000 * kMs, true},
                 {6000 * kMs + 1, false},
                 {5000 * kMs - 1, false},
                 {std::numeric_limits<std::int64_t>::max(), false},
                 {std::numeric_limits<std::int64_t>::min(), false}};
    for (const auto& each : table) {
        const Decision decision = decide(evidence, state, each.now, kLimits);
        EXPECT_EQ(decision.use, each.held ? GroundUse::kHeld : GroundUse::kNone) << each.now;
        EXPECT_EQ(decision.verdict, each.held ? Verdict::kDegraded : Verdict::kBlind) << each.now;
        EXPECT_EQ(decision.reasons.has(Reason::kHeldGround), each.held);
        EXPECT_EQ(decision.ground.found, each.held);
    }
    Limits never;
    never.hold_ns = -1;
    EXPECT_EQ(decide(evidence, state, 5000 * kMs, never).verdict, Verdict::kBlind);
    // Stamps further apart than int64 can say.
    State ancient = state;
    ancient.exposure_mono_ns = std::numeric_limits<std::int64_t>::min();
    EXPECT_EQ(decide(evidence, ancient, std::numeric_limits<std::int64_t>::max(), kLimits).verdict,
              Verdict::kBlind);
    State future = state;
    future.exposure_mono_ns = std::numeric_limits<std::int64_t>::max();
    EXPECT_EQ(decide(evidence, future, std::numeric_limits<std::int64_t>::min(), kLimits).verdict,
              Verdict::kBlind);
}

TEST(Verdict, APoseMayMoveTwoDegreesAFrame) {
    const struct {
        double pitch_deg, roll_deg;
        std::int64_t frames_since;
        bool jump;
    } table[] = {{11.99, 1.0, 0, false}, {12.01, 1.0, 0, true},  {8.01, 1.0, 0, false},
                 {7.99, 1.0, 0, true},   {10.0, 2.99, 0, false}, {10.0, 3.01, 0, true},
                 {10.0, -1.01, 0, true}, {13.99, 1.0, 1, false}, {14.01, 1.0, 1, true},
                 {19.99, 1.0, 4, false}, {20.01, 1.0, 4, true},  {kNaN, 1.0, 0, true}};
    for (const auto& each : table) {
        Evidence evidence = good_evidence();
        evidence.ground.pose.pitch_rad = rad(each.pitch_deg);
        evidence.ground.pose.roll_rad = rad(each.roll_deg);
        const State state = remembering(10.0, 1000 * kMs, each.frames_since);
        const Decision decision = decide(evidence, state, 1033 * kMs, kLimits);
        EXPECT_EQ(decision.reasons.has(Reason::kPoseJump), each.jump)
            << each.pitch_deg << ' ' << each.roll_deg;
        EXPECT_EQ(decision.use, each.jump ? GroundUse::kHeld : GroundUse::kOwn);
        // When the memory no longer counts there is nothing to jump from.
        EXPECT_EQ(decide(evidence, state, 2001 * kMs, kLimits).use, GroundUse::kOwn);
        EXPECT_EQ(decide(evidence, state, 999 * kMs, kLimits).use, GroundUse::kOwn);
    }
}

AttitudeInput attitude(double pitch_deg, double roll_deg, double sigma_deg = 0.5) {
    return {true, rad(pitch_deg), rad(roll_deg), rad(sigma_deg)};
}

// On a slope of 20 deg: the attitude is 20 deg from the pose to the ground, before the step as after it.
TEST(Verdict, AStepThatTheAttitudeMadeTooIsNoJump) {
    const struct {
        double pitch_deg, roll_deg;  // of the ground found, 10 and 1 before
        AttitudeInput before, now;
        bool jump;
    } table[] = {
        {15.0, 1.0, attitude(-10, 0), attitude(-5, 0), false},
        {15.0, 1.0, attitude(-10, 0), attitude(-6.9, 0), false},
        {15.0, 1.0, attitude(-10, 0), attitude(-7.1, 0), true},
        {15.0, 1.0, attitude(-10, 0), attitude(-3.1, 0), false},
        {15.0, 1.0, attitude(-10, 0), attitude(-2.9, 0), true},
        {15.0, 1.0, attitude(-10, 0), attitude(-15, 0), true},
        {10.0, 8.0, attitude(0, 0), attitude(0, 7), false},
        {10.0, 8.0, attitude(0, 0), attitude(0, 3.9), true},
        {15.0, 1.0, attitude(0, 0), attitude(5, 3.1), true},
        {15.0, 1.0, attitude(0, 0, 1.6), attitude(5, 0), true},
        {15.0, 1.0, attitude(0, 0), attitude(5, 0, 1.6), true},
        {15.0, 1.0, attitude(0, 0), attitude(5, 0, kNaN), true},
        {15.0, 1.0, attitude(0, 0), attitude(kNaN, 0), true},
        {15.0, 1.0, AttitudeInput{}, attitude(5, 0), true},
        {15.0, 1.0, attitude(-5, 0), AttitudeInput{}, true},
        {12.9, 1.0, attitude(0, 0), attitude(0, 0), true},  // it stands still and excuses nothing
        // Steps that a robot makes need no witness.
        {11.0, 1.0, attitude(0, 0), attitude(30, 0), false},
    };
    for (const auto& each : table) {
        Evidence evidence = good_evidence();
        evidence.ground.pose.pitch_rad = rad(each.pitch_deg);
        evidence.ground.pose.roll_rad = rad(each.roll_deg);
        evidence.attitude = each.now;
        State state = remembering(10.0, 0);
        state.attitude = each.before;
        const Decision decision = decide(evidence, state, 33 * kMs, kLimits);
        EXPECT_EQ(decision.reasons.has(Reason::kPoseJump), each.jump)
            << each.pitch_deg << ' ' << each.roll_deg << ", from " << each.before.pitch_rad << " to "
            << each.now.pitch_rad;
    }
}

TEST(Verdict, EveryReasonThatEvidenceHoldsIsReached) {
    std::set<Reason> reached = {Reason::kNoFrames};  // decide_without_frames
    const auto note = [&](const Decision& decision) {
        for (int i = 0; i < kReasons; ++i)
            if (decision.reasons.has(static_cast<Reason>(i))) reached.insert(static_cast<Reason>(i));
    };
    for (const Rule& rule : rules()) {
        Evidence evidence = good_evidence();
        evidence.mount_prior = false;
        rule.beyond(evidence);
        note(decide(evidence, remembering(10.0, 0), 0, kLimits));
    }
    note(decide(good_evidence(), remembering(30.0, 0), 0, kLimits));
    for (int i = 0; i < kReasons; ++i)
        EXPECT_EQ(reached.count(static_cast<Reason>(i)), 1U) << kReasonNames.at(static_cast<std::size_t>(i));
}

TEST(Verdict, WhereALineWasFoundTheSpecificReasonSpeaks) {
    Evidence evidence = good_evidence();
    evidence.ground.found = false;
    evidence.ground_fit.inside_gate = false;
    EXPECT_EQ(decide(evidence, State(), 0, kLimits).reasons, set_of({Reason::kOutsideGate}));
}

TEST(Verdict, WithoutALineItsMeasuresAreNotBlamed) {
    Evidence evidence;  // everything at its worst but the pictures
    evidence.calibrated = evidence.mount_prior = true;
    evidence.photometric.contrast = 100.0;
    EXPECT_EQ(decide(evidence, State(), 0, kLimits).reasons,
              set_of({Reason::kNoGround, Reason::kLowDensity}));
}

TEST(Verdict, AWallIsNeverTrusted) {
    Evidence evidence = good_evidence();
    evidence.ground_fit.wall = true;
    EXPECT_EQ(decide(evidence, State(), 0, kLimits).verdict, Verdict::kBlind);
    const Decision held = decide(evidence, remembering(10.0, 0), kMs, kLimits);
    EXPECT_EQ(held.verdict, Verdict::kDegraded);
    EXPECT_EQ(held.use, GroundUse::kHeld);
}

// The pair whose right camera has gain 1.06 and offset 4: kills matching on grey levels, not on local order.
TEST(Verdict, TheBrightnessThatKillsRawDifferencesIsCaught) {
    Evidence evidence = good_evidence();
    evidence.photometric.gain = 1.0 / 1.06;
    evidence.photometric.offset = -4.0 / 1.06;
    evidence.photometric.mismatch = 11.0;
    EXPECT_EQ(decide(evidence, State(), 0, kLimits).reasons, set_of({Reason::kPhotometric}));
    Limits census;
    census.photometric = kLocalOrder;
    EXPECT_EQ(decide(evidence, State(), 0, census).verdict, Verdict::kTrusted);
    evidence.photometric.gain = 0.49;
    EXPECT_EQ(decide(evidence, State(), 0, census).reasons, set_of({Reason::kPhotometric}));
}

// Runs frames through decide and next_state.
struct Drive {
    State state;
    Decision step(const Evidence& evidence, std::int64_t now_mono_ns) {
        const Decision decision = decide(evidence, state, now_mono_ns, kLimits);
        state = next_state(decision, state, now_mono_ns, kLimits);
        return decision;
    }
};

TEST(Memory, RemembersOnlyGroundsThatPassedEveryCheck) {
    for (const Rule& rule : rules()) {
        SCOPED_TRACE(rule.what);
        Evidence evidence = good_evidence();
        rule.beyond(evidence);
        Drive run;
        run.step(evidence, 0);
        EXPECT_EQ(run.state.has_ground,
                  rule.reason == Reason::kUncalibrated || rule.reason == Reason::kUnchecked ||
                      rule.reason == Reason::kOverload || rule.reason == Reason::kHalfResolution);
    }
    Evidence evidence = good_evidence();
    evidence.mount_prior = false;
    Drive run;
    run.step(evidence, 7);
    EXPECT_TRUE(run.state.has_ground);
    EXPECT_EQ(run.state.exposure_mono_ns, 7);
    EXPECT_EQ(run.state.ground.pose.pitch_rad, rad(10.0));
}

TEST(Memory, AHeldGroundIsNotRememberedAnew) {
    Evidence lost = good_evidence();
    lost.ground_fit.line_found = false;
    Drive run;
    run.step(good_evidence(), 0);
    int held = 0;
    int blind = 0;
    for (std::int64_t now = 100 * kMs; now <= 2000 * kMs; now += 100 * kMs) {
        const Decision decision = run.step(lost, now);
        held += decision.use == GroundUse::kHeld ? 1 : 0;
        blind += decision.verdict == Verdict::kBlind ? 1 : 0;
    }
    EXPECT_EQ(held, 10) << "one second after the last ground seen, not after the last one used";
    EXPECT_EQ(blind, 10);
    EXPECT_FALSE(run.state.has_ground);
    EXPECT_EQ(run.step(good_evidence(), 2100 * kMs).verdict, Verdict::kTrusted);
}

TEST(Memory, RemembersTheAttitudeWithTheGround) {
    Drive run;
    Evidence evidence = good_evidence();
    evidence.attitude = attitude(3.0, 1.0);
    run.step(evidence, 0);
    EXPECT_EQ(run.state.attitude.pitch_rad, rad(3.0));
    // A ground that is not believed leaves both alone.
    evidence.attitude = attitude(4.0, 1.0);
    evidence.ground_fit.line_found = false;
    run.step(evidence, 33 * kMs);
    EXPECT_EQ(run.state.attitude.pitch_rad, rad(3.0));
    Evidence bump = good_evidence();
    bump.attitude = attitude(13.0, 1.0);
    bump.ground.pose.pitch_rad = rad(20.0);
    EXPECT_EQ(run.step(bump, 66 * kMs).verdict, Verdict::kTrusted);
}

// Frozen pictures show the robot the same good ground again and again.
TEST(Memory, AFrozenPictureIsNotRemembered) {
    Drive run;
    Evidence evidence = good_evidence();
    for (int frame = 0; frame < 5; ++frame) {
        evidence.pair.same_pairs = frame + 1;
        EXPECT_EQ(run.step(evidence, frame * 33 * kMs).verdict,
                  frame < 2 ? Verdict::kTrusted : Verdict::kBlind);
    }
    EXPECT_EQ(run.state.exposure_mono_ns, 33 * kMs) << "of the last that was believed";
}

TEST(Memory, StampsThatStandStillHoldNothingForEver) {
    Evidence lost = good_evidence();
    lost.ground_fit.line_found = false;
    Drive run;
    run.step(good_evidence(), 0);
    for (int frame = 1; frame <= 70; ++frame)
        EXPECT_EQ(run.step(lost, 0).use, frame <= 60 ? GroundUse::kHeld : GroundUse::kNone) << frame;
}

TEST(Memory, AStepOfTheRobotIsBelievedWhenItCouldHaveMovedThere) {
    Drive run;
    run.step(good_evidence(), 0);
    Evidence tilted = good_evidence();
    tilted.ground.pose.pitch_rad = rad(17.0);  // 7 deg: the fourth frame at 2 deg each
    for (int frame = 1; frame <= 3; ++frame) {
        const Decision decision = run.step(tilted, frame * 33 * kMs);
        EXPECT_EQ(decision.use, GroundUse::kHeld) << frame;
        EXPECT_EQ(decision.reasons, set_of({Reason::kPoseJump, Reason::kHeldGround}));
    }
    EXPECT_EQ(run.step(tilted, 132 * kMs).verdict, Verdict::kTrusted);
    EXPECT_EQ(run.state.frames_since, 0);
}

TEST(Memory, WeakFramesNeitherRefreshNorForget) {
    Evidence weak = good_evidence();
    weak.ground_fit.density = 0.1;
    Drive run;
    run.step(good_evidence(), 0);
    EXPECT_EQ(run.step(weak, 100 * kMs).use, GroundUse::kWeak);
    EXPECT_TRUE(run.state.has_ground);
    EXPECT_EQ(run.state.exposure_mono_ns, 0);
    EXPECT_EQ(run.state.frames_since, 1);
    run.step(weak, 1001 * kMs);
    EXPECT_FALSE(run.state.has_ground);
}

TEST(Memory, TimeGoingBackwardsStartsAnew) {
    Evidence lost = good_evidence();
    lost.ground_fit.line_found = false;
    Evidence elsewhere = good_evidence();
    elsewhere.ground.pose.pitch_rad = rad(30.0);
    Drive run;
    run.step(good_evidence(), 5000 * kMs);
    EXPECT_EQ(run.step(lost, 4000 * kMs).verdict, Verdict::kBlind);
    EXPECT_FALSE(run.state.has_ground);
    run.step(good_evidence(), 5000 * kMs);
    EXPECT_EQ(run.step(elsewhere, 100 * kMs).verdict, Verdict::kTrusted);
    EXPECT_EQ(run.state.exposure_mono_ns, 100 * kMs);
    EXPECT_EQ(run.state.ground.pose.pitch_rad, rad(30.0));
}

// Random evidence near the limits, and a change for the worse of a random part of it.
struct Chance {
    std::mt19937 random;
    double share() { return static_cast<double>(random()) / 4294967296.0; }
    bool one_in(unsigned n) { return random() % n == 0; }

    Evidence evidence() {
        Evidence e = good_evidence();
        const auto near_limit = [&](double& value, double limit) {
            if (one_in(6)) value = limit * (0.7 + 0.6 * share());
        };
        e.mount_prior = !one_in(2);
        near_limit(e.photometric.gain, 1.05);
        near_limit(e.photometric.offset, 10.0);
        near_limit(e.photometric.mismatch, 5.0);
        near_limit(e.photometric.overexposed_share, 0.25);
        near_limit(e.photometric.dark_share, 0.5);
        near_limit(e.photometric.contrast, 10.0);
        PairEvidence& p = e.pair;
        p.identical = one_in(40);
        if (one_in(20)) p.same_pairs = 1 + static_cast<int>(random() % 4);
        if (one_in(8)) p.behind_share = 0.5 * share();
        if (one_in(6)) p.row_offset_px = 0.6 * share();
        if (one_in(6)) p.left_sharper = 1.0 + 0.3 * share();
        if (one_in(6)) p.right_sharper = 0.5 + 0.3 * share();
        GroundEvidence& f = e.ground_fit;
        f.line_found = !one_in(12);
        f.inside_gate = !one_in(12);
        f.wall = one_in(12);
        near_limit(f.density, 0.15);
        near_limit(f.inlier_share, 0.25);
        near_limit(f.line_run_share, 0.25);
        near_limit(f.second_peak_ratio, 0.85);
        near_limit(f.residual_rms_px, 0.75);
        near_limit(f.row_residual_px, 1.0);
        near_limit(f.blocked_share, 0.6);
        e.ground.found = !one_in(12);
        near_limit(e.ground.sigma.pitch_rad, rad(0.5));
        near_limit(e.ground.sigma.height_m, 0.05);
        e.ground.pose.pitch_rad = rad(10.0 + 3.0 * share());
        e.ground.pose.roll_rad = rad(1.0 + 2.5 * share());
        if (one_in(4)) e.skew_ns = static_cast<std::int64_t>(share() * 4e6);
        if (one_in(8)) e.calibrated = e.ground.metric = false;
        if (one_in(8)) e.checked = false;
        return e;
    }
    void worsen(Evidence& e) {
        const auto more = [&](double& value) {
            if (one_in(4)) value = one_in(20) ? kNaN : value + share() * std::fabs(value);
        };
        const auto less = [&](double& value) {
            if (one_in(4)) value = one_in(20) ? kNaN : value * share();
        };
        more(e.photometric.gain);  // 1 or more in these tests, so away from 1
        more(e.photometric.offset);
        more(e.photometric.mismatch);
        more(e.photometric.overexposed_share);
        more(e.photometric.dark_share);
        less(e.photometric.contrast);
        PairEvidence& p = e.pair;
        if (one_in(20)) p.identical = true;
        if (one_in(8)) ++p.same_pairs;
        more(p.behind_share);
        more(p.row_offset_px);
        less(p.row_sigma_px);
        if (p.left_sharper > p.right_sharper) {
            more(p.left_sharper);
            less(p.right_sharper);
        }
        GroundEvidence& f = e.ground_fit;
        if (one_in(8)) f.line_found = false;
        if (one_in(8)) f.inside_gate = false;
        if (one_in(8)) f.wall = true;
        less(f.density);
        less(f.inlier_share);
        less(f.line_run_share);
        more(f.second_peak_ratio);
        more(f.residual_rms_px);
        more(f.row_residual_px);
        more(f.blocked_share);
        if (one_in(8)) e.ground.found = false;
        more(e.ground.sigma.pitch_rad);
        more(e.ground.sigma.height_m);
        if (one_in(4)) e.ground.pose.pitch_rad += rad(2.0 * share());  // away from the 10 deg remembered
        if (one_in(4)) e.ground.pose.roll_rad += rad(2.0 * share());
        if (one_in(4)) e.skew_ns *= 2;
        if (one_in(4)) e.mount_prior = false;
        if (one_in(8)) e.calibrated = e.ground.metric = false;
        if (one_in(8)) e.checked = false;
    }
};

TEST(Verdict, WorseEvidenceNeverGivesABetterVerdict) {
    Chance chance{std::mt19937(11)};
    int counts[3] = {0, 0, 0};
    int dropped = 0;
    for (int round = 0; round < 200000; ++round) {
        Evidence evidence = chance.evidence();
        evidence.photometric.gain = std::max(1.0, evidence.photometric.gain);
        const State state = chance.one_in(2) ? State() : remembering(10.0, 1000 * kMs, chance.random() % 3);
        const std::int64_t now = 1000 * kMs + static_cast<std::int64_t>(chance.random() % 1500) * kMs;
        const Decision better = decide(evidence, state, now, kLimits);
        ++counts[static_cast<int>(better.verdict)];
        chance.worsen(evidence);
        const Decision worse = decide(evidence, state, now, kLimits);
        ASSERT_LE(worse.verdict, better.verdict) << names(better.reasons) << "-> " << names(worse.reasons);
        ASSERT_LE(worse.use, better.use) << names(better.reasons) << "-> " << names(worse.reasons);
        dropped += worse.use < better.use ? 1 : 0;
    }
    for (const int count : counts)
        EXPECT_GT(count, 10000) << "the chances are lopsided";
    EXPECT_GT(dropped, 10000);
}

TEST(Verdict, TrustAndUseGoTogether) {
    Chance chance{std::mt19937(12)};
    for (int round = 0; round < 100000; ++round) {
        const Evidence evidence = chance.evidence();
        const State state = chance.one_in(2) ? State() : remembering(10.0, 1000 * kMs, chance.random() % 3);
        const std::int64_t now = static_cast<std::int64_t>(chance.random() % 2500) * kMs;
        const Decision decision = decide(evidence, state, now, kLimits);
        ASSERT_EQ(decision.verdict == Verdict::kTrusted, decision.use == GroundUse::kOwn);
        ASSERT_EQ(decision.verdict == Verdict::kBlind, decision.use == GroundUse::kNone);
        ASSERT_EQ(decision.reasons.has(Reason::kHeldGround), decision.use == GroundUse::kHeld);
        ASSERT_EQ(decision.ground.found, decision.use != GroundUse::kNone);
        if (!evidence.calibrated || !evidence.checked || evidence.ground_fit.wall ||
            evidence.pair.identical || evidence.pair.same_pairs > 2) {
            ASSERT_NE(decision.verdict, Verdict::kTrusted);
        }
        if (decision.verdict != Verdict::kTrusted) {
            ASSERT_FALSE(decision.reasons.empty()) << "not trusted, and nobody says why";
        }
    }
}

}  // namespace
}  // namespace groundline::verdict
