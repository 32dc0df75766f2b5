// What happens to one pair: rectify, match, find the ground, decide, classify. The heart of the pipeline.
#pragma once

#include <optional>

#include "core/arena.hpp"
#include "core/frame.hpp"
#include "core/parallel.hpp"
#include "core/result.hpp"
#include "pipeline/half_stages.hpp"
#include "pipeline/stages.hpp"
#include "rig/pair_monitor.hpp"
#include "rig/rectifier.hpp"
#include "rig/repeats.hpp"
#include "stereo/matcher.hpp"
#include "terrain/config.hpp"
#include "terrain/elevation_grid.hpp"
#include "terrain/persistence.hpp"
#include "verdict/overload.hpp"
#include "verdict/verdict.hpp"

namespace groundline::pipeline {

struct ProcessorConfig {
    stereo::MatcherConfig matcher;
    terrain::TerrainConfig terrain;
    terrain::GridConfig grid;
    verdict::Limits limits;
    bool colour = false;  // the source has colour and a sink draws it
    bool live = false;    // pairs come from cameras, which never deliver the same picture twice
    // Of pairs looked at at half the resolution all results are in the terms of the whole picture, coarser.
    verdict::HalfResolution half_resolution = verdict::HalfResolution::kNever;
    // Of the rectified left picture, not 0 where the robot's own parts are; empty where none are. Borrowed
    // for the construction.
    ConstImageView<std::uint8_t> body;
};

// What may change between two frames: no memory depends on it.
struct Tuning {
    terrain::TerrainConfig terrain;  // of which TerrainConfig::tune() takes its part
    verdict::Limits limits;
};

// Holds the state of one camera pair. Used by one thread, which lends it the lanes of `parallel`. The result
// is a function of the pairs given so far with their stamps and modes and the configuration: of nothing else.
// That state (the ground last believed, what sectors are blocked by) is metric, in the body frame or in the
// terms of the whole picture, so it goes on unchanged where the resolution changes from pair to pair.
class Processor {
  public:
    // All working memory comes from `arena`. Borrows rectifier and parallel. Throws Refusal for a
    // configuration that cannot work at this size.
    Processor(const ProcessorConfig& config, const rig::Rectifier& rectifier, Parallel& parallel,
              Arena& arena);

    // Memory for one result of this processor.
    FrameResult make_result(Arena& arena) const;

    // Writes all of `result`, its stage times included. No allocation, no exception.
    void process(const StereoFrame& frame, FrameResult& result);

    // From the next frame on. Same thread as process(); no allocation, no exception.
    void tune(const Tuning& tuning);

    const stereo::Matcher& matcher() const { return *whole_.matcher; }
    // Whether a frame's mode can have it looked at at half the resolution.
    bool may_halve() const {
        return half_ && config_.half_resolution == verdict::HalfResolution::kWhenOverloaded;
    }

  private:
    ProcessorConfig config_;
    const rig::Rectifier& rectifier_;
    Parallel& parallel_;
    Stages whole_;
    std::optional<HalfStages> half_;
    terrain::Persistence persistence_;
    Luma right_;
    rig::PairMonitor pair_monitor_;
    rig::RepeatCounter repeats_;
    verdict::State state_;
};

}  // namespace groundline::pipeline
