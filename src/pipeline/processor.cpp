#include "pipeline/processor.hpp"

#include <algorithm>
#include <cassert>

#include "core/clock.hpp"
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

// Writes `reason` where a marked pixel lies within `reach` px, rows and columns alike.
void widen(ConstImageView<std::uint8_t> marked, int reach, Invalid reason, ImageView<std::uint8_t> result) {
    for (int y = 0; y < marked.height; ++y)
        for (int x = 0; x < marked.width; ++x) {
            if (marked.at(x, y) == 0) continue;
            for (int v = std::max(y - reach, 0); v <= std::min(y + reach, marked.height - 1); ++v)
                for (int u = std::max(x - reach, 0); u <= std::min(x + reach, marked.width - 1); ++u)
                    result.at(u, v) = static_cast<std::uint8_t>(reason);
        }
}

// The robot's own parts come last: there nothing is to be seen, matched or not.
ConstImageView<std::uint8_t> unusable(ConstImageView<std::uint8_t> outside, ConstImageView<std::uint8_t> body,
                                      const RectifiedRig& rig, Arena& arena) {
    if (outside.empty() && body.empty()) return {};
    const auto result = arena.image<std::uint8_t>(rig.width, rig.height);
    widen(outside, stereo::kWindowReach, Invalid::kNoImage, result);
    widen(body, stereo::kWindowReach, Invalid::kBody, result);
    return result;
}

}  // namespace

Processor::Processor(const ProcessorConfig& config, const rig::Rectifier& rectifier, Parallel& parallel,
                     Arena& arena)
    : config_(config),
      rectifier_(rectifier),
      parallel_(parallel),
      matcher_(stereo::make_matcher(config.matcher, rectifier.rig().width, rectifier.rig().height,
                                    parallel.lanes(), arena)),
      ground_finder_(config.terrain, rectifier.rig(), matcher_->min_disparity(), matcher_->disparities(),
                     arena),
      classifier_(config.terrain, rectifier.rig(), matcher_->min_disparity(), matcher_->disparities(), arena),
      sector_finder_(config.terrain, rectifier.rig(), matcher_->min_disparity(), matcher_->disparities(),
                     arena),
      persistence_(config.terrain),
      right_(arena.image<std::uint8_t>(rectifier.rig().width, rectifier.rig().height)),
      unusable_left_(unusable(rectifier.outside_left(), config.body, rectifier.rig(), arena)),
      unusable_right_(unusable(rectifier.outside_right(), {}, rectifier.rig(), arena)),
      pair_monitor_(rectifier.rig(), matcher_->min_disparity(), matcher_->disparities(), unusable_left_,
                    unusable_right_, arena) {
    assert(config.body.empty() || config.body.same_size(rectifier.rig().width, rectifier.rig().height));
    config_.body = {};
    if (config.grid.on)
        elevation_grid_.emplace(config.grid, config.terrain, rectifier.rig(), matcher_->min_disparity(),
                                matcher_->disparities(), arena);
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
        terrain::make_v_disparity(arena, rig.height, matcher_->min_disparity(), matcher_->disparities());
    return result;
}

void Processor::tune(const Tuning& tuning) {
    config_.limits = tuning.limits;
    config_.terrain.tune(tuning.terrain);
    ground_finder_.tune(tuning.terrain);
    classifier_.tune(tuning.terrain);
    sector_finder_.tune(tuning.terrain);
    if (elevation_grid_) elevation_grid_->tune(tuning.terrain);
}

void Processor::process(const StereoFrame& frame, FrameResult& result) {
    StageClock clock(result.times_ns);
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
    evidence.skew_ns = frame.stamp.skew_ns;
    evidence.attitude = frame.attitude;
    evidence.photometric = rig::measure_photometric(result.left, right_, parallel_);
    evidence.pair = pair_monitor_.measure(result.left, right_, evidence.photometric.gain, parallel_);
    evidence.pair.identical = rig::identical(frame.left, frame.right);
    if (config_.live) evidence.pair.same_pairs = repeats_.count(frame.left, frame.right);
    clock.end(Stage::kRectify);

    matcher_->match(result.left, right_, result.disparity, parallel_);
    mark_unusable_pixels(result.disparity);
    clock.end(Stage::kMatch);

    const std::int64_t now_mono_ns = frame.stamp.exposure_mono_ns;
    // Without a prior: a ground found wrongly once would narrow the search to itself.
    ground_finder_.find(result.disparity, result.v_disparity, parallel_, nullptr, evidence.ground_fit,
                        evidence.ground);
    const verdict::Decision decision = verdict::decide(evidence, state_, now_mono_ns, config_.limits);
    state_ = verdict::next_state(decision, state_, now_mono_ns, config_.limits);
    result.verdict = decision.verdict;
    result.reasons = decision.reasons;
    result.ground = decision.ground;
    clock.end(Stage::kGround);

    classifier_.classify(result.disparity, result.ground, decision.use, ground_finder_.surface(), result.mask,
                         result.obstacles, result.range_limit_m, parallel_);
    sector_finder_.find(result.disparity, result.ground, result.mask, result.range_limit_m, result.sectors);
    persistence_.apply(now_mono_ns, result.verdict, result.sectors);
    if (elevation_grid_) elevation_grid_->find(result.disparity, result.ground, result.mask, result.grid);
    terrain::shares_of(result.mask, result.share);
    clock.end(Stage::kClassify);
}

// What was matched through a window that rectification could not fill is no match; on the robot's own parts
// it is of no interest, and neither is why it is missing.
void Processor::mark_unusable_pixels(const DisparityMap& map) {
    const ConstImageView<std::uint8_t>& left = unusable_left_;
    const ConstImageView<std::uint8_t>& right = unusable_right_;
    if (left.empty() && right.empty()) return;
    for (int y = 0; y < map.height(); ++y) {
        std::int16_t* disparity = map.disparity_q4.row(y);
        Invalid* invalid = map.invalid.row(y);
        for (int x = 0; x < map.width(); ++x) {
            Invalid reason = left.empty() ? Invalid::kNone : static_cast<Invalid>(left.at(x, y));
            if (reason != Invalid::kBody && invalid[x] != Invalid::kNone) continue;
            if (reason == Invalid::kNone && !right.empty()) {
                const int matched = x - whole_px(disparity[x]);
                if (matched >= 0 && matched < map.width())
                    reason = static_cast<Invalid>(right.at(matched, y));
            }
            if (reason == Invalid::kNone) continue;
            invalid[x] = reason;
            disparity[x] = 0;
        }
    }
}

}  // namespace groundline::pipeline
