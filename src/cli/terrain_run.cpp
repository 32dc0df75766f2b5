#include "cli/terrain_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <stdexcept>

#include "capture/open.hpp"
#include "cli/terrain_baseline.hpp"
#include "cli/truth_labels.hpp"
#include "core/arena.hpp"
#include "core/error.hpp"
#include "io/calibration/calibration_reader.hpp"
#include "io/truth.hpp"
#include "pipeline/processor.hpp"
#include "rig/rectifier.hpp"
#include "setup/run_setup.hpp"
#include "synth/renderer.hpp"
#include "synth/texture.hpp"

namespace groundline::cli {
namespace {

namespace fs = std::filesystem;

// A processor for judging and, so that times are those of warm memory, another of which they are taken.
class Ours {
  public:
    Ours(const settings::Settings& settings, const SourceInfo& source, const rig::Rectifier& rectifier)
        : config_(setup::processor_config(settings, source, false, arena_)),
          judged_(config_, rectifier, serial_, arena_),
          timed_(config_, rectifier, serial_, arena_),
          result_(judged_.make_result(arena_)),
          timed_result_(judged_.make_result(arena_)) {}

    const FrameResult& run(const StereoFrame& frame) {
        judged_.process(frame, result_);
        return result_;
    }
    const StageTimes& time(const StereoFrame& frame) {
        if (!warm_) timed_.process(frame, timed_result_);
        warm_ = true;
        timed_.process(frame, timed_result_);
        return timed_result_.times_ns;
    }

  private:
    Arena arena_;
    Serial serial_;
    pipeline::ProcessorConfig config_;
    pipeline::Processor judged_;
    pipeline::Processor timed_;
    FrameResult result_;
    FrameResult timed_result_;
    bool warm_ = false;
};

FrameAnswer answer_of(const FrameResult& result) {
    FrameAnswer answer;
    answer.verdict = result.verdict;
    answer.reasons = result.reasons;
    answer.mask = result.mask;
    if (result.ground.found && result.ground.metric) answer.pose = result.ground.pose;
    for (const Obstacle& obstacle : result.obstacles)
        if (obstacle.kind == TerrainClass::kObstacle && !obstacle.overhang)
            answer.obstacle_ranges_m.push_back(obstacle.range_m);
    answer.sectors = std::span<const Sector>(result.sectors.data(), result.sectors.size());
    return answer;
}

std::int64_t at(const StageTimes& times, Stage stage) {
    return times[static_cast<std::size_t>(stage)];
}

// Both methods for pictures of one rig.
class Judge {
  public:
    Judge(const settings::Settings& settings, const SourceInfo& source, const rig::Rectifier& rectifier)
        : rectifier_(rectifier),
          ours_(settings, source, rectifier),
          baseline_(rectifier.rig(), settings.matcher.min_disparity, settings.matcher.disparities,
                    settings.terrain.tolerance_up_m),
          mask_(arena_.image<TerrainClass>(rectifier.rig().width, rectifier.rig().height)),
          left_(arena_.image<std::uint8_t>(rectifier.rig().width, rectifier.rig().height)),
          right_(arena_.image<std::uint8_t>(rectifier.rig().width, rectifier.rig().height)) {}

    // Every frame is to be run, also one that is not judged: a processor knows the frames before.
    void run(const StereoFrame& frame) { result_ = &ours_.run(frame); }

    // Of the frame that was run last.
    std::array<FrameScore, kTerrainMethods> judge(const StereoFrame& frame, const FrameTruth& truth) {
        std::array<FrameScore, kTerrainMethods> scores;
        FrameScore& ours = scores[static_cast<std::size_t>(TerrainMethod::kOurs)];
        ours = cli::judge(truth, answer_of(*result_));
        const StageTimes& times = ours_.time(frame);
        ours.match_ns = at(times, Stage::kMatch);
        ours.terrain_ns = at(times, Stage::kGround) + at(times, Stage::kClassify);

        rectifier_.rectify(frame, left_, right_, {}, serial_);
        if (!warm_) baseline_.run(left_, right_, mask_);
        warm_ = true;
        TerrainBaseline::Answer found = baseline_.run(left_, right_, mask_);
        FrameAnswer answer;
        answer.verdict = found.pose ? Verdict::kTrusted : Verdict::kBlind;
        answer.mask = mask_;
        answer.pose = found.pose;
        answer.obstacle_ranges_m = std::move(found.obstacle_ranges_m);
        FrameScore& baseline = scores[static_cast<std::size_t>(TerrainMethod::kBaseline)];
        baseline = cli::judge(truth, answer);
        baseline.match_ns = found.match_ns;
        baseline.terrain_ns = found.terrain_ns;
        return scores;
    }

  private:
    Arena arena_;
    Serial serial_;
    const rig::Rectifier& rectifier_;
    Ours ours_;
    TerrainBaseline baseline_;
    Mask mask_;
    Luma left_, right_;
    const FrameResult* result_ = nullptr;
    bool warm_ = false;
};

void show(Picture picture, std::uint32_t seed, const StereoFrame& frame) {
    const auto noise = [&](const Luma& image, std::uint64_t view) {
        for (int y = 0; y < image.height; ++y)
            for (int x = 0; x < image.width; ++x)
                image.at(x, y) = static_cast<std::uint8_t>(
                    synth::mix(synth::mix(seed, view),
                               static_cast<std::uint64_t>(y) << 32U | static_cast<std::uint64_t>(x)) >>
                    56U);
    };
    switch (picture) {
        case Picture::kBlack:
        case Picture::kWhite:
            for (const Luma& image : {frame.left, frame.right})
                fill_pixels(image, picture == Picture::kBlack ? 0 : 255);
            break;
        case Picture::kNoise:
            noise(frame.left, 0);
            noise(frame.right, 1);
            break;
        case Picture::kLeftTwice:
            copy_pixels<std::uint8_t>(frame.left, frame.right);
            break;
        case Picture::kSwapped:
            for (int y = 0; y < frame.left.height; ++y)
                std::swap_ranges(frame.left.row(y), frame.left.row(y) + frame.left.width, frame.right.row(y));
            break;
        case Picture::kRendered:
        case Picture::kFrozen:
            break;
    }
}

constexpr int kFrozenPairs = 3;
constexpr std::int64_t kFrameNs = 33'000'000;

std::string empty_remark(int frames, const char* why) {
    return fmt::format("{} frame{} {}", frames, frames == 1 ? "" : "s", why);
}

// One folder with truth: its pairs and what is true of them.
class SetJudge {
  public:
    SetJudge(const fs::path& set, const settings::Settings& settings) : truth_(set), labels_(truth_, set) {
        unit_.name = set.filename().string();
        opened_ = capture::open_source({set.string()});
        const SourceInfo& info = opened_.source->info();
        const std::vector<fs::path> files = io::find_calibration(opened_.folder);
        if (files.empty()) throw Refusal(ExitStatus::kDone, "no calibration, so no heights to judge by");
        const rig::StereoCalibration calibration =
            io::read_calibration(files, info.width, info.height, opened_.colour_pair);
        rectifier_ = std::make_unique<rig::Rectifier>(calibration, info.width, info.height, arena_);
        settings::Settings chosen = settings;
        setup::choose_disparities(info.width, calibration.disparities_hint, chosen);
        judge_ = std::make_unique<Judge>(chosen, info, *rectifier_);
        frame_ = StereoFrame::make(arena_, info.width, info.height, info.colour);
        seen_ = arena_.image<TerrainClass>(info.width, info.height);
        all_ = arena_.image<TerrainClass>(info.width, info.height);
    }

    JudgedUnit run(const std::atomic<bool>& stop) {
        for (;;) {
            if (stop.load(std::memory_order_relaxed)) return std::move(unit_);
            const Pull pull = opened_.source->next(frame_);
            if (pull == Pull::kEnd) {
                leave_out(opened_.source->error());
                break;
            }
            const std::int64_t position = frame_.stamp.position;
            if (pull == Pull::kBad) {
                leave_out(fmt::format("pair {}: {}", position, opened_.source->error()));
                continue;
            }
            judge_->run(frame_);
            if (position < truth_.frames()) read_and_judge(static_cast<int>(position));
        }
        if (groundless_ > 0)
            unit_.remarks.push_back(
                empty_remark(groundless_, "without a ground plane in the disparity truth, so not judged"));
        unit_.done = true;
        return std::move(unit_);
    }

  private:
    void leave_out(const std::string& why) {
        if (why.empty()) return;
        unit_.remarks.push_back(why);
        unit_.status = static_cast<int>(ExitStatus::kInput);
    }

    void read_and_judge(int position) {
        try {
            const io::TruthFrame truth = truth_.read(position);
            if (!truth.disparity_q8.view().same_size(all_.width, all_.height))
                throw std::runtime_error(fmt::format(
                    "the truth of pair {} has {}x{} pixels; expected {}x{} like the pictures", position,
                    truth.disparity_q8.width, truth.disparity_q8.height, all_.width, all_.height));
            const TruthLabels::Origin origin = labels_.label(truth, position, rectifier_->rig(), all_);
            if (origin.terrain.empty()) {
                ++groundless_;
                return;
            }
            const OcclusionTruth occlusion(truth);
            for (int y = 0; y < all_.height; ++y)
                for (int x = 0; x < all_.width; ++x) {
                    const bool hidden = !occlusion.view().empty() && occlusion.view().at(x, y) != 0;
                    seen_.at(x, y) = hidden ? TerrainClass::kUnknown : all_.at(x, y);
                }
            FrameTruth judged;
            judged.rig = rectifier_->rig();
            judged.seen = seen_;
            judged.all = all_;
            judged.pose = origin.true_pose;
            unit_.frames.push_back({unit_.name, position, {}, judged.range_m, judge_->judge(frame_, judged)});
        } catch (const Refusal&) {
            throw;
        } catch (const std::runtime_error& problem) {
            leave_out(problem.what());
        }
    }

    JudgedUnit unit_;
    io::Truth truth_;
    TruthLabels labels_;
    capture::OpenedSource opened_;
    Arena arena_;
    std::unique_ptr<rig::Rectifier> rectifier_;
    std::unique_ptr<Judge> judge_;
    StereoFrame frame_;
    Mask seen_, all_;
    int groundless_ = 0;
};

}  // namespace

JudgedUnit judge_rendered(const SuiteFrame& asked, const settings::Settings& settings) {
    const synth::Renderer renderer(synth::scene_by_name(asked.spec));
    const synth::Scene& scene = renderer.scene();
    settings::Settings chosen = settings;
    setup::choose_disparities(scene.rig.width, 0, chosen);
    const double tolerance_m = chosen.terrain.tolerance_up_m;

    Arena arena;
    Serial serial;
    const rig::Rectifier rectifier(setup::calibration_of(scene.rig), scene.rig.width, scene.rig.height,
                                   arena);
    StereoFrame frame = StereoFrame::make(arena, scene.rig.width, scene.rig.height, false);
    frame.stamp.source = StampSource::kStartOfExposure;
    renderer.render(0, serial, frame.left, {}, frame.right);
    show(asked.picture, asked.seed, frame);
    const synth::Truth rendered = synth::Truth::make(arena, scene.rig.width, scene.rig.height);
    renderer.render_truth(0, serial, tolerance_m, rendered);
    const bool dug = !scene.trenches.empty();
    const synth::Truth deep =
        dug ? synth::Truth::make(arena, scene.rig.width, scene.rig.height) : synth::Truth{};
    if (dug) renderer.render_truth(0, serial, tolerance_m + kDeeperThanDrop, deep);

    const Mask seen = arena.image<TerrainClass>(scene.rig.width, scene.rig.height);
    const Mask all = arena.image<TerrainClass>(scene.rig.width, scene.rig.height);
    FrameTruth truth;
    truth.rig = scene.rig;
    truth.pose = synth::camera_at(scene, 0).pose;
    truth.range_m = judged_range(scene.rig, truth.pose->height_m, tolerance_m);
    label_rendered(rendered, dug ? &deep : nullptr, scene.rig, truth.range_m, seen, all);
    truth.seen = seen;
    truth.all = all;
    truth.empty = scene.things.empty() && !scene.strewn && scene.wall_z_m <= 0.0;
    if (dug) truth.ditch_lip_m = scene.trenches.front().near_m;

    const bool frozen = asked.picture == Picture::kFrozen;
    SourceInfo source;
    source.width = scene.rig.width;
    source.height = scene.rig.height;
    source.live = frozen;
    Judge both(chosen, source, rectifier);
    both.run(frame);
    for (int i = 1; frozen && i < kFrozenPairs; ++i) {
        ++frame.stamp.sequence;
        frame.stamp.position = frame.stamp.sequence;
        frame.stamp.exposure_mono_ns += kFrameNs;
        frame.stamp.utime_us += kFrameNs / 1000;
        both.run(frame);
    }
    JudgedUnit unit;
    unit.name = asked.scene;
    unit.done = true;
    unit.frames.push_back({asked.scene, asked.seed, asked.spec, truth.range_m, both.judge(frame, truth)});
    return unit;
}

JudgedUnit judge_set(const fs::path& set, const settings::Settings& settings, const std::atomic<bool>& stop) {
    return SetJudge(set, settings).run(stop);
}

}  // namespace groundline::cli
