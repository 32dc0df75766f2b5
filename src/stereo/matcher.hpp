// What every stereo matcher is: a rectified pair in, a disparity map out, in memory taken at construction.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/image.hpp"
#include "core/parallel.hpp"
#include "stereo/checks.hpp"
#include "stereo/paper_reading.hpp"

namespace groundline::stereo {

class Matcher {
  public:
    Matcher() = default;
    Matcher(const Matcher&) = delete;
    Matcher& operator=(const Matcher&) = delete;
    virtual ~Matcher() = default;

    // Matches one rectified pair. All views have the size given at construction and keep the padding contract
    // of image.hpp: kRowPadding bytes behind each row of `out` may be written, as many behind the last row of
    // the views be read; the arena's images have them. `out` is written whole. `parallel` may have at most
    // the lanes given at construction. The result depends on the pixels and the configuration alone. No
    // allocation, no exception; one call at a time.
    virtual void match(ConstLuma left, ConstLuma right, const DisparityMap& out, Parallel& parallel) = 0;

    // Memory taken from the arena at construction.
    virtual std::size_t state_bytes() const = 0;
    // The search range is min_disparity() .. min_disparity() + disparities() - 1, px.
    virtual int min_disparity() const = 0;
    virtual int disparities() const = 0;
};

enum class MatcherKind : std::uint8_t {
    kPaper,          // the paper's: truncated differences, Gaussian window, two rules
    kCensus,         // census words, semi-global over three paths
    kCensusPyramid,  // the same at half the resolution, then refined
};

struct MatcherConfig {
    MatcherKind kind = MatcherKind::kCensusPyramid;
    // Smallest disparity searched, px; may be negative. Results are absolute: left(x) matches right(x - d).
    int min_disparity = 0;
    int disparities = 64;  // multiple of 16, 16 .. 256
    // Paper only: take the 15x15 mean out of both views first. Without it a brightness difference of some ten
    // grey levels between the cameras ruins its cost.
    bool normalise_local_mean = false;
    // Validity tests. Off, every pixel is answered; the paper's pure form then is in whole pixels, too.
    bool checks = true;
    PaperReading paper;
    CheckLimits limits;
};

// The configuration with everything filled in that is left to the kind of matcher.
MatcherConfig resolved(const MatcherConfig& config);

// The matcher for images of width x height, usable with up to `lanes` lanes. The arena must outlive it.
// Throws Refusal (kConfig) for a configuration that cannot work at this size.
std::unique_ptr<Matcher> make_matcher(const MatcherConfig& config, int width, int height, int lanes,
                                      Arena& arena);

}  // namespace groundline::stereo
