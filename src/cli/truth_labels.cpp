#include "cli/truth_labels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/deterministic_math.hpp"
#include "core/error.hpp"

namespace groundline::cli {
namespace {

std::vector<GroundPose> true_poses(const io::Truth& truth, const std::filesystem::path& folder) {
    std::vector<GroundPose> poses;
    if (truth.json_text().empty()) return poses;
    try {
        const nlohmann::json root = nlohmann::json::parse(truth.json_text());
        if (!root.contains("frames")) return poses;
        for (const nlohmann::json& frame : root.at("frames"))
            poses.push_back({det::radians(frame.at("pitch_deg").get<double>()),
                             det::radians(frame.at("roll_deg").get<double>()),
                             frame.at("height_m").get<double>()});
    } catch (const nlohmann::json::exception& problem) {
        throw Refusal(ExitStatus::kInput,
                      fmt::format("cannot use '{}': {}", (folder / "truth.json").string(), problem.what()));
    }
    return poses;
}

}  // namespace

OcclusionTruth::OcclusionTruth(const io::TruthFrame& truth) {
    const DisparityQ8 wanted = truth.disparity_q8.view();
    const auto pixels = static_cast<std::int64_t>(truth.disparity_q8.pixels.size());
    known_ = pixels - std::count(truth.disparity_q8.pixels.begin(), truth.disparity_q8.pixels.end(), 0);
    sparse_ = 2 * known_ <= pixels;
    if (truth.occluded.width > 0) {
        view_ = truth.occluded.luma();
        origin_ = "occluded/";
    } else if (!sparse_) {
        own_.resize(truth.disparity_q8.pixels.size());
        const Luma view(own_.data(), wanted.width, wanted.height, wanted.width);
        mark_occluded(wanted, view);
        view_ = view;
        origin_ = "disparity truth";
    }
}

TruthLabels::TruthLabels(const io::Truth& truth, const std::filesystem::path& folder)
    : has_classes_(truth.has_classes()),
      has_heights_(truth.has_heights()),
      poses_(true_poses(truth, folder)) {}

TruthLabels::Origin TruthLabels::label(const io::TruthFrame& truth, int position, const RectifiedRig& rig,
                                       Mask labels) const {
    const DisparityQ8 wanted = truth.disparity_q8.view();
    fill_pixels(labels, TerrainClass::kUnknown);
    Origin origin;
    if (position < static_cast<int>(poses_.size())) {
        origin.true_pose = poses_[static_cast<std::size_t>(position)];
        origin.pose = "truth.json";
    }
    if (has_classes_ || has_heights_) {
        if (has_classes_) {
            label_by_class(truth.classes.luma(), truth.height_mm.view(), labels);
            origin.terrain = has_heights_ ? "class/ and height/" : "class/";
        } else {
            label_by_height(truth.height_mm.view(), labels);
            origin.terrain = "height/";
        }
        if (rig.calibrated) limit_range(wanted, rig, labels);
    } else if (rig.calibrated) {
        const std::optional<DisparityPlane> plane = fit_ground(wanted, rig);
        origin.groundless = !plane;
        if (plane) {
            label_by_disparity(wanted, *plane, rig, labels);
            origin.terrain = "disparity truth";
            if (poses_.empty()) {
                origin.true_pose = pose_of(*plane, rig);
                origin.pose = "disparity truth";
            }
        }
    }
    return origin;
}

}  // namespace groundline::cli
