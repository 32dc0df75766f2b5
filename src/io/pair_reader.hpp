// Reads stereo pairs from files, one after another, into memory that was taken before.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/frame_source.hpp"

namespace groundline::io {

// Stamps of sources without any count up at this rate and are marked StampSource::kUnknown.
inline constexpr double kNominalRateHz = 10.0;

// Used by one thread. Opening decodes the first pair and throws Refusal(kInput) with the file and what was
// expected; after that nothing throws.
class PairReader {
  public:
    PairReader() = default;
    PairReader(const PairReader&) = delete;
    PairReader& operator=(const PairReader&) = delete;
    virtual ~PairReader() = default;

    virtual const SourceInfo& info() const = 0;
    // Fills images and stamp, all but the stamp's sequence. kBad leaves the images undefined, sets the stamp
    // and goes on to the next pair: missing, empty, truncated, or another size than the first pair's.
    virtual Pull next(StereoFrame& frame) = 0;
    virtual const std::string& error() const = 0;
    virtual bool rewind() = 0;
    // One sentence about what of the source is left out, else empty.
    virtual const std::string& note() const = 0;
};

struct OpenedPairs {
    std::unique_ptr<PairReader> reader;
    std::filesystem::path folder;  // where calibration is looked for
    bool colour_pair = false;      // KITTI's colour cameras, whose calibration is P2 and P3
};

// One word: a folder in a layout of pair_list.hpp, or a side-by-side video; two words: left and right image.
// Throws Refusal(kInput); kUsage for another number of words.
OpenedPairs open_pairs(const std::vector<std::string>& words);

}  // namespace groundline::io
