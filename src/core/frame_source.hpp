// Where stereo pairs come from: cameras, files and the renderer all stand behind this.
#pragma once

#include <cstdint>
#include <string>

#include "core/frame.hpp"

namespace groundline {

struct SourceInfo {
    std::string name;  // as the operator gave it
    int width = 0;
    int height = 0;
    bool colour = false;       // fills StereoFrame::left_bgr
    bool live = false;         // pairs arrive by themselves: newest first; otherwise they wait to be read
    std::int64_t length = -1;  // pairs in one pass, -1 unknown
    double rate_hz = 0.0;      // from the stamps or the container, 0 unknown
};

enum class Pull : std::uint8_t {
    kFrame,  // the frame is filled
    kBad,    // this pair cannot be read; error() says why; its position is in the frame's stamp; go on
    kEnd,    // no more pairs
    kIdle,   // nothing came within the source's own waiting time; call again. Only live sources give it
};

// Used by one thread. The constructor of an implementation opens the source and throws Refusal when it
// cannot; it also reads the first pair's header, so that info() holds the size before any memory is taken.
class FrameSource {
  public:
    FrameSource() = default;
    FrameSource(const FrameSource&) = delete;
    FrameSource& operator=(const FrameSource&) = delete;
    virtual ~FrameSource() = default;

    virtual const SourceInfo& info() const = 0;
    // Writes the next pair into `frame`, whose images have the size info() says. May block on a disk; a live
    // source waits at most 100 ms and then returns kIdle, so that whoever calls can see that it shall stop.
    // Never throws: what goes wrong is kBad or kEnd with a sentence in error(). After kIdle the frame's
    // pixels and stamp mean nothing.
    virtual Pull next(StereoFrame& frame) = 0;
    // One sentence about the last kBad, or about a kEnd that came from a failure; empty after a clean end.
    virtual const std::string& error() const = 0;
    // Starts again at the first pair. False where the source cannot.
    virtual bool rewind() = 0;
};

}  // namespace groundline
