// Luma out of one JPEG picture, as cameras deliver them.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "core/image.hpp"

namespace groundline::capture {

// libjpeg-turbo's decoder, made once. For each picture the library itself takes memory from the heap and
// gives it back: a few blocks of one pool, whose sizes repeat, so that the C library serves them from its
// free lists; nothing of ours allocates. Colour is skipped, never transformed. The accurate inverse
// transform, whose bytes do not depend on the processor. libjpeg and not TurboJPEG, because that one cannot
// tell damage from the stray bytes that some cameras put before a marker, and takes the size of the next
// picture wrongly after a cut one (2.1.5). One thread at a time.
class MjpegDecoder {
  public:
    MjpegDecoder();
    ~MjpegDecoder();
    MjpegDecoder(const MjpegDecoder&) = delete;
    MjpegDecoder& operator=(const MjpegDecoder&) = delete;

    // Decodes `jpeg` into the whole of `into`. False where it is not a whole, undamaged JPEG of exactly that
    // size; what `into` holds then means nothing. Pictures without Huffman tables, as many cameras send them,
    // are taken, as are zeros behind the picture. Reads nothing beyond `jpeg`.
    [[nodiscard]] bool decode(std::span<const std::uint8_t> jpeg, Luma into);
    // What was wrong with the last picture that was not decoded. Valid until the next call.
    const char* problem() const;

  private:
    struct Library;
    std::unique_ptr<Library> library_;
};

}  // namespace groundline::capture
