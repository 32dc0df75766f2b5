#include "pipeline/processor.hpp"

#include <cassert>

#include "core/clock.hpp"
#include "core/error.hpp"
#include "core/half_size.hpp"
#include "rig/photometric.hpp"
#include "terrain/shares.hpp"
#include "terrain/v_disparity.hpp"

namespace groundline::pipeline {
namespace {

// Gives each stage the time since the one before it ended.
class StageClock {
  public:
    explicit StageClock(StageTimes& times) : times_(times), last_ns_(now_mono_ns()) {}
    void end(Stage stage) {
        const std::int64_t now_ns = now_mono_ns();
        times_[static_cast<std::size_t>(stage)] = now_ns - last_ns_;
        last_ns_ = now_ns;
    }

  private:
    StageTimes& times_;
    std::int64_t last_ns_;
};

Unusable unusable_of(const ProcessorConfig& config, const rig::Rectifier& rectifier) {
    return {rectifier.outside_left(), rectifier.outside_right(), config.body};
}

}  // namespace

Processor::Processor(const ProcessorConfig& config, const rig::Rectifier& rectifier, Parallel& parallel,
                     Arena& arena)
    : config_(config),
      rectifier_(rectifier),
      parallel_(parallel),
      whole_({config.matcher, config.terrain, config.grid}, rectifier.rig(), rectifier.rig(),
             unusable_of(config, rectifier), parallel.lanes(), arena),
      persistence_(config.terrain),
      right_(arena.image<std::uint8_t>(rectifier.rig().width, rectifier.rig().height)),
      pair_monitor_(rectifier.rig(), matcher().min_disparity(), matcher().disparities(), whole_.unusable_left,
                    whole_.unusable_right, arena) {
    assert(config.body.empty() || config.body.same_size(rectifier.rig().width, rectifier.rig().height));
    config_.body = {};
    if (config.half_resolution == verdict::HalfResolution::kNever) return;
    try {
        half_.emplace(StagesConfig{config.matcher, config.terrain, config.grid}, rectifier.rig(),
                      unusable_of(config, rectifier), parallel.lanes(), arena);
    } catch (const Refusal&) {
        // Pictures that are hardly large enough as they are stay whole, however late.
        if (config.half_resolution == verdict::HalfResolution::kAlways) throw;
    }
}

FrameResult Processor::make_result(Arena& arena) const {
    const RectifiedRig& rig = rectifier_.rig();
    FrameResult result;
    result.rig = rig;
    result.left = arena.image<std::uint8_t>(rig.width, rig.height);
    if (config_.colour) result.left_bgr = arena.bgr_image(rig.width, rig.height);
    result.disparity = DisparityMap::make(arena, rig.width, rig.height);
    result.mask = arena.image<TerrainClass>(rig.width, rig.height);
    result.grid = terrain::make_terrain_grid(config_.grid, arena);
    result.v_disparity =
        terrain::make_v_disparity(arena, rig.height, matcher().min_disparity(), matcher().disparities());
    return result;
}

void Processor::tune(const Tuning& tuning) {
    config_.limits = tuning.limits;
    config_.terrain.tune(tuning.terrain);
    whole_.tune(tuning.terrain);
    if (half_) half_->stages.tune(tuning.terrain);
}

void Processor::process(const StereoFrame& frame, FrameResult& result) {
    StageClock clock(result.times_ns);
    const bool half = half_ && (config_.half_resolution == verdict::HalfResolution::kAlways ||
                                frame.mode == FrameMode::kHalfResolution);
    const RectifiedRig& rig = rectifier_.rig();
    result.stamp = frame.stamp;
    result.tolerance_m = rig.calibrated ? config_.terrain.tolerance_up_m : 0.0;
    result.tolerance_ratio = rig.calibrated ? 0.0 : config_.terrain.tolerance_ratio;

    rectifier_.rectify(frame, result.left, right_, result.left_bgr, parallel_);
    Evidence& evidence = result.evidence;
    evidence = {};
    evidence.calibrated = rig.calibrated;
    evidence.checked = config_.matcher.checks;
    evidence.mount_prior = config_.terrain.mount_known;
    evidence.overloaded = frame.mode != FrameMode::kFull;
    evidence.half_resolution = half;
    evidence.skew_ns = frame.stamp.skew_ns;
    evidence.attitude = frame.attitude;
    evidence.photometric = rig::measure_photometric(result.left, right_, parallel_);
    evidence.pair = pair_monitor_.measure(result.left, right_, evidence.photometric.gain, parallel_);
    evidence.pair.identical = rig::identical(frame.left, frame.right);
    if (config_.live) evidence.pair.same_pairs = repeats_.count(frame.left, frame.right);
    if (half) half_->halve(result.left, right_, parallel_);
    clock.end(Stage::kRectify);

    Stages& stages = half ? half_->stages : whole_;
    const DisparityMap disparity = half ? half_->disparity : result.disparity;
    const Mask mask = half ? half_->mask : result.mask;
    stages.matcher->match(half ? half_->left : result.left, half ? half_->right : right_, disparity,
                          parallel_);
    stages.mark_unusable_pixels(disparity);
    clock.end(Stage::kMatch);

    const std::int64_t now_mono_ns = frame.stamp.exposure_mono_ns;
    // Without a prior: a ground found wrongly once would narrow the search to itself.
    stages.ground_finder.find(disparity, half ? half_->v_disparity : result.v_disparity, parallel_, nullptr,
                              evidence.ground_fit, evidence.ground);
    // What is decided and remembered is in the terms of the whole picture, whatever this frame is.
    if (half) evidence.ground = doubled(evidence.ground);
    const verdict::Decision decision = verdict::decide(evidence, state_, now_mono_ns, config_.limits);
    state_ = verdict::next_state(decision, state_, now_mono_ns, config_.limits);
    result.verdict = decision.verdict;
    result.reasons = decision.reasons;
    result.ground = decision.ground;
    clock.end(Stage::kGround);

    const Ground ground = half ? halved(result.ground) : result.ground;
    stages.classifier.classify(disparity, ground, decision.use, stages.ground_finder.surface(), mask,
                               result.obstacles, result.range_limit_m, parallel_);
    stages.sector_finder.find(disparity, ground, mask, result.range_limit_m, result.sectors);
    persistence_.apply(now_mono_ns, result.verdict, result.sectors);
    if (stages.elevation_grid) stages.elevation_grid->find(disparity, ground, mask, result.grid);
    if (half) half_->deliver(result, parallel_);
    terrain::shares_of(result.mask, result.share);
    clock.end(Stage::kClassify);
}

}  // namespace groundline::pipeline
