// Renders both views of a scene and the exact truth of the left one.
#pragma once

#include <cstdint>
#include <utility>

#include "core/arena.hpp"
#include "core/ground.hpp"
#include "core/image.hpp"
#include "core/parallel.hpp"
#include "core/terrain_class.hpp"
#include "synth/scene.hpp"

namespace groundline::synth {

// Exact answers at the pixel centres of the left view.
struct Truth {
    ImageView<double> disparity_px;    // measured (offset included); 0 where `seen` is 0
    ImageView<double> height_m;        // above the mean ground plane; 0 where `seen` is 0
    ImageView<TerrainClass> terrain;   // unknown where `seen` is 0
    ImageView<std::uint8_t> seen;      // 1: a surface, 0: sky
    ImageView<std::uint8_t> occluded;  // 1: a surface that the right view does not show, or not inside it

    static Truth make(Arena& arena, int width, int height);
};

// Pure ray tracing: the same bytes for any number of lanes and on any processor. Allocates nothing after
// construction. Used by one thread.
class Renderer {
  public:
    explicit Renderer(Scene scene) : scene_(std::move(scene)) {}

    const Scene& scene() const { return scene_; }
    // Ground plane of this frame: that of the mean ground.
    DisparityPlane plane(std::int64_t frame) const;

    // Both views of frame `frame`. Images have the size of the rig; `left_bgr` may be empty. The left luma is
    // luma_of the left colour exactly. Pixel (u, v) is the mean of 2x2 rays around its centre.
    void render(std::int64_t frame, Parallel& parallel, Luma left, BgrView left_bgr, Luma right) const;

    // The truth of the same frame, one ray per pixel. A surface more than tolerance_m above the local ground
    // (the undulating one, without its trenches) is an obstacle, more than that below it a drop.
    void render_truth(std::int64_t frame, Parallel& parallel, double tolerance_m, const Truth& truth) const;

  private:
    Scene scene_;
};

}  // namespace groundline::synth
