// The stages for pictures at half their size, and what they find told in the terms of the whole ones.
#pragma once

#include "core/arena.hpp"
#include "core/parallel.hpp"
#include "core/rectified_rig.hpp"
#include "core/result.hpp"
#include "pipeline/stages.hpp"

namespace groundline::pipeline {

// Used by one thread, which lends it lanes. All memory is taken at construction.
class HalfStages {
  public:
    // For whole pictures of `rig`; `config` is for these: disparities searched are halved, so that the
    // nearest range stays. In place of the pyramid is the census matcher, which is its coarse level: a
    // pyramid of half the pictures would begin at a quarter, where 1.3 % of the pixels of rendered rocks were
    // shown as free, with it none. What else the configuration gives in px is px of the pictures that are
    // looked at. Throws Refusal where the half size is too small for it.
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
