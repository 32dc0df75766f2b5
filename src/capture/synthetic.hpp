// Rendered scenes as a source of stereo pairs, with their calibration and truth.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "core/arena.hpp"
#include "core/frame_source.hpp"
#include "core/rectified_rig.hpp"
#include "synth/renderer.hpp"

namespace groundline::capture {

// Pairs of a scene on a simulated clock: frame n is exposed at n / rate_hz seconds after 0, on both clocks,
// and the clock goes on when the source is rewound. Rendering happens in next(), on the caller's thread, and
// allocates nothing.
class SyntheticSource final : public FrameSource {
  public:
    // `spec` as for synth::scene_by_name. Throws Refusal(kUsage).
    explicit SyntheticSource(std::string_view spec);

    const SourceInfo& info() const override { return info_; }
    Pull next(StereoFrame& frame) override;
    const std::string& error() const override { return error_; }
    bool rewind() override;

    // The views are rectified as they come.
    const RectifiedRig& rig() const { return renderer_.scene().rig; }
    const synth::Scene& scene() const { return renderer_.scene(); }
    // Truth of the frame that next() delivered last (of the first one before that), rendered in this call.
    // The first call takes memory. Valid until the next call.
    const synth::Truth& truth(double tolerance_m);

  private:
    synth::Renderer renderer_;
    SourceInfo info_;
    std::string error_;
    std::int64_t position_ = 0;
    std::int64_t sequence_ = 0;
    Serial serial_;
    Arena truth_memory_;
    synth::Truth truth_;
};

std::unique_ptr<FrameSource> open_synthetic(std::string_view spec);

}  // namespace groundline::capture
