// One stereo pair as it came from a source, with everything known about when it was taken.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/arena.hpp"
#include "core/attitude.hpp"
#include "core/image.hpp"

namespace groundline {

// What instant of the exposure a stamp means. The numbers go out in messages.
enum class StampSource : std::uint8_t {
    kUnknown = 0,
    kStartOfExposure = 1,
    kEndOfFrame = 2,
    kFirstRow = 3,
    kArrival = 4,
    kFile = 5,
};

// Which pair this is and when it was taken.
struct FrameStamp {
    std::int64_t sequence = 0;          // counts the pairs a source has handed out, from 0, across loops
    std::int64_t position = 0;          // position in the source, from 0; names the output files
    std::int64_t utime_us = 0;          // exposure, microseconds since the epoch
    std::int64_t exposure_mono_ns = 0;  // exposure on the monotonic clock (of a file: its own stamp in ns)
    std::int64_t skew_ns = 0;           // right exposure minus left exposure
    StampSource source = StampSource::kUnknown;
    std::array<char, 128> name{};  // what the source calls it, e.g. the file name of the left image

    void set_name(std::string_view text) {
        name.fill('\0');
        const std::size_t kept = text.size() < name.size() ? text.size() : name.size() - 1;
        text.copy(name.data(), kept);
    }
    std::string_view name_view() const { return {name.data()}; }
};

// What was given up for this pair because the machine could not keep up. Decided while running live, recorded
// with the pair, and from then on an input like its pixels.
enum class FrameMode : std::uint8_t {
    kFull = 0,
    kSkipping = 1,        // pairs before it were skipped, again and again
    kHalfResolution = 2,  // nor did skipping suffice: this pair is looked at at half the resolution
};

// Memory for one pair, allocated once; sources write into it. Images are as delivered, not yet rectified.
struct StereoFrame {
    FrameStamp stamp;
    Luma left;
    Luma right;
    BgrView left_bgr;  // empty where the source has no colour
    FrameMode mode = FrameMode::kFull;
    AttitudeInput attitude;  // a source that ever sets it sets it for every pair

    static StereoFrame make(Arena& arena, int width, int height, bool colour) {
        StereoFrame frame;
        frame.left = arena.image<std::uint8_t>(width, height);
        frame.right = arena.image<std::uint8_t>(width, height);
        if (colour) frame.left_bgr = arena.bgr_image(width, height);
        return frame;
    }
};

}  // namespace groundline
