#include "capture/synthetic.hpp"

#include <algorithm>
#include <cstdio>

namespace groundline::capture {

SyntheticSource::SyntheticSource(std::string_view spec) : renderer_(synth::scene_by_name(spec)) {
    info_.name = spec;
    info_.width = rig().width;
    info_.height = rig().height;
    info_.colour = true;
    info_.length = scene().frames;
    info_.rate_hz = scene().rate_hz;
}

Pull SyntheticSource::next(StereoFrame& frame) {
    if (position_ == scene().frames) return Pull::kEnd;
    FrameStamp& stamp = frame.stamp;
    stamp.sequence = sequence_;
    stamp.position = position_;
    const double seconds = static_cast<double>(sequence_) / scene().rate_hz;
    stamp.utime_us = static_cast<std::int64_t>(seconds * 1e6 + 0.5);
    stamp.exposure_mono_ns = static_cast<std::int64_t>(seconds * 1e9 + 0.5);
    stamp.skew_ns = 0;
    stamp.source = StampSource::kFile;
    char name[64];
    std::snprintf(name, sizeof name, "%s %06lld", scene().name.c_str(), static_cast<long long>(position_));
    stamp.set_name(name);
    renderer_.render(position_, serial_, frame.left, frame.left_bgr, frame.right);
    ++position_;
    ++sequence_;
    return Pull::kFrame;
}

bool SyntheticSource::rewind() {
    position_ = 0;
    return true;
}

const synth::Truth& SyntheticSource::truth(double tolerance_m) {
    if (truth_.seen.empty()) truth_ = synth::Truth::make(truth_memory_, info_.width, info_.height);
    renderer_.render_truth(std::max<std::int64_t>(0, position_ - 1), serial_, tolerance_m, truth_);
    return truth_;
}

std::unique_ptr<FrameSource> open_synthetic(std::string_view spec) {
    return std::make_unique<SyntheticSource>(spec);
}

}  // namespace groundline::capture
