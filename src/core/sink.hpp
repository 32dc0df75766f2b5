// Where results go: files, LCM, the recorder.
#pragma once

#include <string>

#include "core/result.hpp"

namespace groundline {

// Used by one thread, the one behind the last hand-over. The result is the sink's only during the call.
class Sink {
  public:
    Sink() = default;
    Sink(const Sink&) = delete;
    Sink& operator=(const Sink&) = delete;
    virtual ~Sink() = default;

    // May block (disk, network). Never throws: false when it failed, with a sentence in error().
    virtual bool consume(const FrameResult& result) = 0;
    virtual const std::string& error() const = 0;
};

}  // namespace groundline
