#include "cli/evaluate_set.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <stdexcept>
#include <system_error>

#include "cli/truth_labels.hpp"
#include "core/arena.hpp"
#include "core/deterministic_math.hpp"
#include "core/error.hpp"
#include "core/evidence.hpp"
#include "io/calibration/calibration_reader.hpp"
#include "io/png.hpp"
#include "io/truth.hpp"
#include "rig/rectifier.hpp"

namespace groundline::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

GroundPose pose_from(const json& object) {
    return {det::radians(object.at("pitch_deg").get<double>()),
            det::radians(object.at("roll_deg").get<double>()), object.at("height_m").get<double>()};
}

struct FrameLine {
    Verdict verdict = Verdict::kBlind;
    std::optional<GroundPose> pose;  // none: no ground, or no metres
};

FrameLine line_from(const json& object) {
    FrameLine line;
    const auto verdict = object.at("verdict").get<std::string>();
    const auto* name = std::find(kVerdictNames.begin(), kVerdictNames.end(), verdict);
    if (name == kVerdictNames.end()) throw std::runtime_error("unknown verdict " + verdict);
    line.verdict = static_cast<Verdict>(name - kVerdictNames.begin());
    const json& ground = object.at("ground");
    if (ground.is_object() && ground.at("height_m").is_number()) line.pose = pose_from(ground);
    return line;
}

std::map<std::int64_t, FrameLine> read_lines(const fs::path& path) {
    std::ifstream file(path);
    if (!file) throw Refusal(ExitStatus::kInput, fmt::format("cannot read '{}'", path.string()));
    std::map<std::int64_t, FrameLine> lines;
    std::string text;
    for (int number = 1; std::getline(file, text); ++number) {
        try {
            const json object = json::parse(text);
            lines[object.at("frame").get<std::int64_t>()] = line_from(object);
        } catch (const std::exception& problem) {
            throw Refusal(ExitStatus::kInput, fmt::format("{}:{}: not a line of a replay's frames.jsonl ({})",
                                                          path.string(), number, problem.what()));
        }
    }
    return lines;
}

// What the run itself used; nothing where it does not say or had no calibration.
std::optional<RectifiedRig> rig_of_run(const fs::path& path, int width, int height) {
    std::ifstream file(path);
    if (!file) return std::nullopt;
    try {
        const json summary = json::parse(file);
        if (!summary.contains("calibration") || summary.at("calibration").is_null()) return std::nullopt;
        const json& calibration = summary.at("calibration");
        RectifiedRig rig{width, height, true};
        rig.focal_px = calibration.at("focal_px").get<double>();
        rig.cx_px = calibration.at("cx_px").get<double>();
        rig.cy_px = calibration.at("cy_px").get<double>();
        rig.cx_right_px = rig.cx_px - calibration.at("disparity_offset_px").get<double>();
        rig.baseline_m = calibration.at("baseline_m").get<double>();
        if (!(rig.focal_px > 0.0 && rig.baseline_m > 0.0))
            throw std::runtime_error("focal_px and baseline_m must be above 0");
        return rig;
    } catch (const std::exception& problem) {
        throw Refusal(ExitStatus::kInput,
                      fmt::format("cannot use the calibration in '{}': {}; replay again to write it anew",
                                  path.string(), problem.what()));
    }
}

// Numbers of the images in a folder of a result.
std::set<std::int64_t> numbers_in(const fs::path& folder) {
    std::set<std::int64_t> numbers;
    for (const auto& entry : fs::directory_iterator(folder)) {
        const std::string stem = entry.path().stem().string();
        if (entry.path().extension() == ".png" && stem.size() >= 6 && stem.size() <= 18 &&
            stem.find_first_not_of("0123456789") == std::string::npos)
            numbers.insert(std::stoll(stem));
    }
    return numbers;
}

std::vector<TerrainClass> mask_of(const io::Image8& image) {
    std::vector<TerrainClass> mask;
    mask.reserve(image.bytes.size());
    for (const std::uint8_t id : image.bytes)
        mask.push_back(id < kTerrainClasses ? static_cast<TerrainClass>(id) : TerrainClass::kUnknown);
    return mask;
}

class Evaluator {
  public:
    Evaluator(const fs::path& truth, const fs::path& out)
        : truth_folder_(truth), out_(out), truth_(truth), labels_(truth_, truth) {
        std::error_code error;
        if (!fs::is_directory(out / "disparity", error) || !fs::is_directory(out / "mask", error) ||
            !fs::is_regular_file(out / "frames.jsonl", error))
            throw Refusal(ExitStatus::kInput,
                          fmt::format("the folder '{}' holds no result; expected disparity/, mask/ and "
                                      "frames.jsonl in it, as 'groundline replay --out' writes them",
                                      out.string()));
        lines_ = read_lines(out / "frames.jsonl");
    }

    SetReport run() {
        const std::set<std::int64_t> results = numbers_in(out_ / "disparity");
        for (const std::int64_t number : results)
            report_.without_truth += number >= truth_.frames() ? 1 : 0;
        for (int position = 0; position < truth_.frames(); ++position) {
            if (!results.contains(position)) {
                ++report_.without_result;
                continue;
            }
            try {
                frame(position);
                ++report_.evaluated;
            } catch (const Refusal&) {
                throw;
            } catch (const std::runtime_error& problem) {
                ++report_.unreadable;
                report_.remarks.emplace_back(problem.what());
            }
        }
        if (report_.evaluated == 0) {
            throw Refusal(ExitStatus::kInput, !report_.remarks.empty()
                                                  ? report_.remarks.front()
                                                  : fmt::format("no frame of '{}' has truth in '{}'",
                                                                out_.string(), truth_folder_.string()));
        }
        remark(report_.without_result, "of the truth without a result");
        remark(report_.without_truth, "of the result without truth");
        remark(groundless_, "without a ground plane in the disparity truth, so without terrain scores");
        return std::move(report_);
    }

  private:
    void remark(std::int64_t frames, const char* what) {
        if (frames > 0)
            report_.remarks.push_back(fmt::format("{} frame{} {}", frames, frames == 1 ? "" : "s", what));
    }

    // Everything is read and checked before the first count changes.
    void frame(int position) {
        const io::TruthFrame truth = truth_.read(position);
        const std::string name = fmt::format("{:06}.png", position);
        const io::Image16 disparity = io::read_disparity_truth(out_ / "disparity" / name);
        const io::Image8 mask_image = io::read_luma_png(out_ / "mask" / name);
        const int width = truth.disparity_q8.width;
        const int height = truth.disparity_q8.height;
        for (const auto& [folder, w, h] : {std::tuple{"disparity", disparity.width, disparity.height},
                                           std::tuple{"mask", mask_image.width, mask_image.height}}) {
            if (w != width || h != height)
                throw std::runtime_error(fmt::format("'{}' has {}x{} pixels; expected {}x{} like the truth",
                                                     (out_ / folder / name).string(), w, h, width, height));
        }
        const auto line = lines_.find(position);
        if (line == lines_.end())
            throw std::runtime_error(
                fmt::format("'{}' has no line for frame {}", (out_ / "frames.jsonl").string(), position));
        if (!rig_) find_rig(width, height);

        ++report_.verdicts[static_cast<std::size_t>(line->second.verdict)];
        disparity_scores(truth, disparity);
        terrain_scores(truth, mask_image, position, line->second);
    }

    void disparity_scores(const io::TruthFrame& truth, const io::Image16& disparity) {
        const DisparityQ8 wanted = truth.disparity_q8.view();
        const OcclusionTruth occlusion(truth);
        report_.occlusion = occlusion.origin();
        score_disparity(wanted, disparity.view(), occlusion.view(), report_.disparity);
    }

    void terrain_scores(const io::TruthFrame& truth, const io::Image8& mask_image, int position,
                        const FrameLine& line) {
        const DisparityQ8 wanted = truth.disparity_q8.view();
        std::vector<TerrainClass> label_pixels(truth.disparity_q8.pixels.size(), TerrainClass::kUnknown);
        const Mask labels(label_pixels.data(), wanted.width, wanted.height, wanted.width);
        const TruthLabels::Origin origin = labels_.label(truth, position, *rig_, labels);
        if (!origin.terrain.empty()) report_.terrain_truth = origin.terrain;
        if (!origin.pose.empty()) report_.pose_truth = origin.pose;
        groundless_ += origin.groundless ? 1 : 0;
        if (origin.true_pose && line.pose) score_pose(*line.pose, *origin.true_pose, report_.pose);
        std::vector<TerrainClass> mask = mask_of(mask_image);
        score_terrain(labels, Mask(mask.data(), wanted.width, wanted.height, wanted.width), report_.terrain);
    }

    void find_rig(int width, int height) {
        rig_ = rig_of_run(out_ / "summary.json", width, height);
        if (rig_) return;
        rig_.emplace();
        const std::vector<fs::path> files = io::find_calibration(truth_folder_);
        if (files.empty()) {
            if (!truth_.has_classes() && !truth_.has_heights())
                report_.remarks.emplace_back(
                    "no terrain scores: the truth has no class/ or height/, and no calibration to make them "
                    "from "
                    "its disparities");
            return;
        }
        Arena arena;
        rig_ = rig::Rectifier(io::read_calibration(files, width, height), width, height, arena).rig();
    }

    fs::path truth_folder_;
    fs::path out_;
    io::Truth truth_;
    TruthLabels labels_;
    std::map<std::int64_t, FrameLine> lines_;
    std::optional<RectifiedRig> rig_;  // set with the first frame
    std::int64_t groundless_ = 0;
    SetReport report_;
};

}  // namespace

SetReport evaluate_set(const fs::path& truth, const fs::path& out) {
    return Evaluator(truth, out).run();
}

}  // namespace groundline::cli
