// What happens to one pair: rectify, match, find the ground, decide, classify. The heart of the pipeline.
#pragma once

#include <memory>
#include <optional>

#include "core/arena.hpp"
#include "core/frame.hpp"
#include "core/parallel.hpp"
#include "core/result.hpp"
#include "rig/pair_monitor.hpp"
#include "rig/rectifier.hpp"
#include "rig/repeats.hpp"
#include "stereo/matcher.hpp"
#include "terrain/classifier.hpp"
#include "terrain/config.hpp"
#include "terrain/elevation_grid.hpp"
#include "terrain/ground_finder.hpp"
#include "terrain/persistence.hpp"
#include "terrain/sectors.hpp"
#include "verdict/verdict.hpp"

namespace groundline::pipeline {

struct ProcessorConfig {
    stereo::MatcherConfig matcher;
    terrain::TerrainConfig terrain;
    terrain::GridConfig grid;
    verdict::Limits limits;
    bool colour = false;  // the source has colour and a sink draws it
    bool live = false;    // pairs come from cameras, which never deliver the same picture twice
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
// is a function of the pairs given so far with their stamps and the configuration: of nothing else.
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

    const stereo::Matcher& matcher() const { return *matcher_; }

  private:
    void mark_unusable_pixels(const DisparityMap& map);

    ProcessorConfig config_;
    const rig::Rectifier& rectifier_;
    Parallel& parallel_;
    std::unique_ptr<stereo::Matcher> matcher_;
    terrain::GroundFinder ground_finder_;
    terrain::Classifier classifier_;
    terrain::SectorFinder sector_finder_;
    terrain::Persistence persistence_;
    std::optional<terrain::ElevationGrid> elevation_grid_;  // where the configuration asks for it
    Luma right_;
    // Where the window of a match would reach beyond the source picture or into the robot's own parts: the
    // reason, an Invalid; 0 elsewhere. Empty where it nowhere does.
    ConstImageView<std::uint8_t> unusable_left_;
    ConstImageView<std::uint8_t> unusable_right_;
    rig::PairMonitor pair_monitor_;
    rig::RepeatCounter repeats_;
    verdict::State state_;
};

}  // namespace groundline::pipeline
