// What a frame's truth says about each pixel: what it is, and whether the right camera sees it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cli/evaluation.hpp"
#include "core/ground.hpp"
#include "core/image.hpp"
#include "core/rectified_rig.hpp"
#include "core/terrain_class.hpp"
#include "io/truth.hpp"

namespace groundline::cli {

// What the right camera does not see: as the folder says; where it does not and more than half of the pixels
// have a disparity, as mark_occluded() finds; else nothing. Borrows the frame.
class OcclusionTruth {
  public:
    explicit OcclusionTruth(const io::TruthFrame& truth);

    ConstLuma view() const { return view_; }        // not 0 where hidden; empty where nothing is
    const char* origin() const { return origin_; }  // "occluded/", "disparity truth", "none"
    std::int64_t known() const { return known_; }   // pixels with a true disparity
    bool sparse() const { return sparse_; }         // they are at most half of all

  private:
    std::int64_t known_ = 0;
    bool sparse_ = false;
    const char* origin_ = "none";
    std::vector<std::uint8_t> own_;
    ConstLuma view_;
};

// The labels of a folder's frames, by the rules of evaluation.hpp, and the poses of its ground.
class TruthLabels {
  public:
    // `folder` is for messages. Throws Refusal(kInput) for a truth.json that cannot be used.
    TruthLabels(const io::Truth& truth, const std::filesystem::path& folder);

    bool has_poses() const { return !poses_.empty(); }
    struct Origin {
        std::string
            terrain;       // "class/ and height/", "class/", "height/", "disparity truth"; empty: no labels
        std::string pose;  // "truth.json", "disparity truth"; empty: no pose
        std::optional<GroundPose> true_pose;
        bool groundless = false;  // no labels, because there is no ground plane in the disparity truth
    };
    // Writes all of `labels`, which has the frame's size.
    Origin label(const io::TruthFrame& truth, int position, const RectifiedRig& rig, Mask labels) const;

  private:
    bool has_classes_;
    bool has_heights_;
    std::vector<GroundPose> poses_;  // empty: unknown
};

}  // namespace groundline::cli
