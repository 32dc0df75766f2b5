// What one frame brings forward about itself, and the words a verdict is given in.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/attitude.hpp"
#include "core/ground.hpp"

namespace groundline {

// May the mask be believed? The numbers are in messages.
enum class Verdict : std::uint8_t {
    kBlind = 0,     // no usable picture or no ground: the mask is all unknown
    kDegraded = 1,  // believe obstacles; traversable only where this frame's own evidence supports it
    kTrusted = 2,
};
inline constexpr std::array<std::string_view, 3> kVerdictNames = {"blind", "degraded", "trusted"};

// Why a verdict is what it is; bit positions in messages, so never renumbered. Names in kReasonNames.
enum class Reason : std::uint8_t {
    kNoFrames = 0,
    kUncalibrated,    // no metres: tolerance is a share of the camera height
    kNoMountPrior,    // informative: pose was searched in the wide default gate
    kLowDensity,      // too few pixels below the horizon have a disparity
    kFewInliers,      // too little of what is seen lies on the ground found
    kShortLine,       // the ground line is supported on too few rows
    kOutsideGate,     // the pose found is not possible for this mount
    kPoseJump,        // the pose moved more between frames than a robot does
    kAmbiguous,       // a second, different ground is nearly as good
    kUneven,          // the residual to the ground model is large
    kUncertainPose,   // the fit leaves pitch or height too uncertain
    kBlockedView,     // much of the lower picture is nearer than the search range or unmatched
    kWall,            // what fills the view is upright: no ground to be seen
    kNoGround,        // no line was found at all
    kHeldGround,      // the ground is an earlier frame's
    kPhotometric,     // the cameras differ in brightness more than the matcher bears
    kOverexposed,     // too many saturated pixels
    kDark,            // too dark to match
    kFrozen,          // the same picture again and again
    kSwapped,         // left and right seem exchanged
    kUnsynchronised,  // the two exposures are too far apart
    kEpipolar,        // rows of the two views do not correspond
    kBlurred,         // one camera is out of focus or dirty
    kOverload,        // frames were skipped or shrunk to keep up
    kUnchecked,       // disparities are answered without checks
    kIdentical,       // left and right are one and the same picture
    kHalfResolution,  // looked at at half the resolution
    kCount,
};
inline constexpr int kReasons = static_cast<int>(Reason::kCount);
inline constexpr std::array<std::string_view, static_cast<std::size_t>(kReasons)> kReasonNames = {
    "no_frames",    "uncalibrated", "no_mount_prior", "low_density", "few_inliers",    "short_line",
    "outside_gate", "pose_jump",    "ambiguous",      "uneven",      "uncertain_pose", "blocked_view",
    "wall",         "no_ground",    "held_ground",    "photometric", "overexposed",    "dark",
    "frozen",       "swapped",      "unsynchronised", "epipolar",    "blurred",        "overload",
    "unchecked",    "identical",    "half_resolution"};

// A set of reasons, as the bit mask that goes out in messages.
class Reasons {
  public:
    constexpr Reasons() = default;
    constexpr explicit Reasons(std::uint32_t bits) : bits_(bits) {}
    constexpr void add(Reason reason) { bits_ |= bit(reason); }
    constexpr void add(Reasons others) { bits_ |= others.bits_; }
    constexpr bool has(Reason reason) const { return (bits_ & bit(reason)) != 0; }
    constexpr bool empty() const { return bits_ == 0; }
    constexpr std::uint32_t bits() const { return bits_; }
    friend constexpr bool operator==(Reasons, Reasons) = default;

  private:
    static constexpr std::uint32_t bit(Reason reason) { return 1U << static_cast<unsigned>(reason); }
    std::uint32_t bits_ = 0;
};
static_assert(kReasons <= 32);

// How the two pictures compare, before matching.
struct PhotometricEvidence {
    double gain = 1.0;      // left is about gain * right + offset
    double offset = 0.0;    // grey levels
    double mismatch = 0.0;  // mean |left - right| of matching brightness ranks, grey levels
    // Of the lower half of the picture, in the worse view: a sky may be white, and trees before it black.
    double overexposed_share = 0.0;  // pixels at 255
    double dark_share = 0.0;         // pixels at or below the dark level
    double contrast = 0.0;           // grey levels between the 5th and the 95th percentile, the weaker view
};

// How the two pictures lie to each other, from sparse features, before matching.
struct PairEvidence {
    bool identical = false;      // left and right are one and the same picture, as delivered
    int same_pairs = 1;          // pairs in a row, this one included, that are the same to the last bit
    int patches = 0;             // with texture, tried
    int matched = 0;             // of those, found again along the row
    int features = 0;            // found again along the row, clearly nearer than infinity or beyond it
    double behind_share = 0.0;   // of those, beyond infinity, where nothing can be
    int row_features = 0;        // found again in the row too
    double row_offset_px = 0.0;  // median vertical offset of those, right minus left
    double row_sigma_px = 0.0;   // standard error of that median
    // How much stronger the left view's steps of brightness are than the right view's where both see the
    // same, its gain taken out; and the other way round. Blur of the one raises it, noise in either lowers
    // it.
    double left_sharper = 1.0;
    double right_sharper = 1.0;
};

// How well the ground found explains the disparities. All shares are 0..1.
struct GroundEvidence {
    bool line_found = false;
    bool inside_gate = false;
    bool wall = false;               // the strongest line is upright
    double density = 0.0;            // valid pixels among those below the horizon
    double inlier_share = 0.0;       // ground inliers among the valid pixels below the horizon
    double line_run_share = 0.0;     // longest supported run of rows among the rows below the horizon
    double second_peak_ratio = 0.0;  // the most that a rival plane alone explains, over what the ground does
    double residual_rms_px = 0.0;    // of the inliers, weighted
    double row_residual_px = 0.0;    // mean over rows of |row's mean residual|
    double blocked_share = 0.0;      // invalid or range-edge pixels in the lower third of the picture
};

struct Evidence {
    bool calibrated = false;
    bool mount_prior = false;
    bool overloaded = false;       // the pair's mode is not kFull
    bool half_resolution = false;  // matched and judged at half the resolution
    bool checked = true;           // disparities passed validity checks; if not, every pixel counts as valid
    PhotometricEvidence photometric;
    PairEvidence pair;
    GroundEvidence ground_fit;
    Ground ground;
    AttitudeInput attitude;
    std::int64_t skew_ns = 0;
};

}  // namespace groundline
