// How the two rectified views lie to each other: exchanged, out of row, one of them blurred; from sparse
// features.
#pragma once

#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/evidence.hpp"
#include "core/image.hpp"
#include "core/parallel.hpp"
#include "core/rectified_rig.hpp"

namespace groundline::rig {

// Follows some hundred patches of the left view into the right one, without the matcher's assumptions: to
// both sides along the row, and up to 3 rows up and down. Used by one thread, which may lend it lanes.
class PairMonitor {
  public:
    // `rig` has the size of the pictures, at least 32 x 32 px. Disparities min_disparity .. min_disparity +
    // disparities - 1 are what the matcher searches; here as many are searched on the other side of zero too.
    // Where `excluded_left` and `excluded_right` (each empty, or of the pictures' size; borrowed) are not 0
    // there is no feature.
    PairMonitor(const RectifiedRig& rig, int min_disparity, int disparities,
                ConstImageView<std::uint8_t> excluded_left, ConstImageView<std::uint8_t> excluded_right,
                Arena& arena);

    // `gain` is how much brighter the left view is (PhotometricEvidence::gain). No allocation; the same on
    // any number of lanes; about 0.2 ms on one at 640x480x64.
    //
    // Patches of 8x8 px of the pictures shrunk to at most 320 px of width, the most textured of each cell in
    // evenly spaced rows, by normalised correlation; believed where one place is alone good. Around that
    // place 12x12 px of the full picture, a quadratic through the 3x3 correlations about the best.
    PairEvidence measure(ConstLuma left, ConstLuma right, double gain, Parallel& parallel);

  private:
    // What one patch says.
    struct Feature {
        bool tried = false;         // there is texture to follow
        bool matched = false;       // along the row
        bool placed = false;        // in the row too
        bool exact = false;         // not at the end of the search: sub-pixel, and steps compared
        double disparity_px = 0.0;  // measured
        double row_px = 0.0;        // right minus left
        double mean_left = 0.0;     // grey levels
        double mean_right = 0.0;
        double left_on_right = 0.0;  // slope of the left view's steps over the right view's
        double right_on_left = 0.0;
    };

    void measure_band(ConstLuma left, ConstLuma right, int band, int shift);
    void place(ConstLuma left, ConstLuma right, int x, int y, int shift, Feature& feature) const;
    int most_textured(ConstLuma left, int x, int top) const;
    double median(std::size_t count);
    double gain_of_features(double otherwise);
    void count(PairEvidence& evidence) const;
    bool is_free(ConstImageView<std::uint8_t> excluded, int x, int y, int reach) const;

    int width_;
    int height_;
    int scale_;  // full px in one of the shrunk picture
    int reach_;  // disparities searched to either side, shrunk px
    int bands_;
    double infinity_px_;  // measured disparity below which nothing can lie
    ConstImageView<std::uint8_t> excluded_left_;
    ConstImageView<std::uint8_t> excluded_right_;
    std::span<Feature> features_;
    std::span<std::size_t> placed_;  // of the features, in their order
    std::span<double> sorted_;
};

}  // namespace groundline::rig
