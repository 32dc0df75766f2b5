// The stages for pictures at half their size, and what they find told in the terms of the whole ones.
#pragma once

#include "core/arena.hpp"
#include "core/parallel.hpp"
#include "core/rectified_rig.hpp"
#include "core/result.hpp"
#include "pipeline/stages.hpp"

namespace groundline::pipeline {

// The configuration for pictures at half their size, from that for whole ones. Disparities searched are
// halved, so that the nearest range stays. In place of the pyramid is the census matcher, which is its coarse
// level: a pyramid of half the pictures would begin at a quarter, where 1.3 % of the pixels of rendered rocks
// were shown as free, with it none.
//
// Of what is given in px that which is about things in the world is scaled, and that which is about the
// matcher, whose window has as many px, stays. Shares are of obstacle pixels of the rendered scenes.
// - min_pixels_far is scaled by 1/4, down to min_pixels: far things have a quarter of the pixels, a box of
//   0.3 m at 20 m has 14. Left as it is, 0.005 % are shown as free instead of 0.001 %.
// - min_pixels stays: outliers touch each other by chance as often among as many matched pixels.
// - blur_px and blur_beyond_px stay: a window sees thing and ground as many px from the edge. Halved, 0.006 %
//   are shown as free.
// - gap_px stays: what spoils one match spoils all windows that see it. And the ground about a gap that is
//   closed is unknown; about one that is not it could be free.
// - speckle_px stays: a false match is a patch as large as the windows that agree on it, and one more
//   believed could be free. At a quarter as many obstacle pixels are found.
StagesConfig halved(const StagesConfig& config);

// Used by one thread, which lends it lanes. All memory is taken at construction.
class HalfStages {
  public:
    // For whole pictures of `rig`; `config` is for these. Throws Refusal where the half size is too small for
    // it.
    HalfStages(const StagesConfig& config, const RectifiedRig& rig, const Unusable& unusable, int lanes,
               Arena& arena);

    // Writes left, right: means of 2x2 px.
    void halve(ConstLuma whole_left, ConstLuma whole_right, Parallel& parallel);
    // From disparity, mask, v_disparity and result.obstacles as found at half the size: each disparity, class
    // and reason for 2x2 px, disparities doubled, obstacles' px and disparities too. The v-disparity image is
    // that of the doubled disparities.
    void deliver(FrameResult& result, Parallel& parallel) const;

    Stages stages;
    Luma left, right;
    DisparityMap disparity;
    Mask mask;
    VDisparity v_disparity;
};

}  // namespace groundline::pipeline
