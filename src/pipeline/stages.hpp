// The stages behind rectification, with their memory, for pictures of one size.
#pragma once

#include <memory>
#include <optional>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/image.hpp"
#include "core/rectified_rig.hpp"
#include "stereo/matcher.hpp"
#include "terrain/classifier.hpp"
#include "terrain/config.hpp"
#include "terrain/elevation_grid.hpp"
#include "terrain/ground_finder.hpp"
#include "terrain/sectors.hpp"

namespace groundline::pipeline {

struct StagesConfig {
    stereo::MatcherConfig matcher;
    terrain::TerrainConfig terrain;
    terrain::GridConfig grid;
};

// Pixels that are of no use, each not 0 where it is so; empty where there are none.
struct Unusable {
    ConstImageView<std::uint8_t> outside_left;  // rectification has no source for them
    ConstImageView<std::uint8_t> outside_right;
    ConstImageView<std::uint8_t> body;  // the robot's own parts in the left view
};

// Used by one thread.
struct Stages {
    // `rig` has the size of the pictures, and `unusable` too, which is borrowed for the construction;
    // `shared` as for terrain::SectorFinder. All working memory comes from `arena`. Throws Refusal for a
    // configuration that cannot work at this size.
    Stages(const StagesConfig& config, const RectifiedRig& rig, const RectifiedRig& shared,
           const Unusable& unusable, int lanes, Arena& arena);

    // What was matched through a window that rectification could not fill is no match; on the robot's own
    // parts it is of no interest, and neither is why it is missing.
    void mark_unusable_pixels(const DisparityMap& map) const;
    // From the next frame on; see TerrainConfig::tune().
    void tune(const terrain::TerrainConfig& config);

    std::unique_ptr<stereo::Matcher> matcher;
    terrain::GroundFinder ground_finder;
    terrain::Classifier classifier;
    terrain::SectorFinder sector_finder;
    std::optional<terrain::ElevationGrid> elevation_grid;  // where the configuration asks for it
    // Where the window of a match would reach beyond the source picture or into the robot's own parts: the
    // reason, an Invalid; 0 elsewhere. Empty where it nowhere does.
    ConstImageView<std::uint8_t> unusable_left;
    ConstImageView<std::uint8_t> unusable_right;
};

}  // namespace groundline::pipeline
