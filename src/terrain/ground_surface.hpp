// The ground's shape about its plane: its heights and depths along the way, as far as pixels show them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "core/arena.hpp"
#include "core/disparity.hpp"
#include "core/ground.hpp"
#include "core/parallel.hpp"

namespace groundline::terrain {

// What this frame's own pixels say about one cell of the ground.
enum class CellSupport : std::uint8_t {
    kNone,          // too few pixels lie on it
    kSupported,     // enough of the cell's pixels lie on it
    kContradicted,  // what is seen is level, but lies elsewhere
};

// Heights are shares of the camera's height over the plane, ranges multiples of it, so that both hold without
// calibration. Cells are steps of disparity (half a pixel, about four rows of ground each) times kBandColumns
// columns of the picture.
//
// Found from a histogram of heights in each cell: the path from near to far, one height a step, that holds
// most pixels of all columns, has least beneath it and is nowhere steeper than kMaxSlope (dynamic
// programming; an upright face has one range, so no path climbs it). Where the plane holds as much as the
// path, the surface is the plane itself.
class GroundSurface {
  public:
    static constexpr int kBandColumns = 64;
    static constexpr double kMaxSlope = 0.25;

    // Disparities searched as in GroundFinder.
    void take(Arena& arena, int width, int height, int min_disparity, int disparities);

    // Uses every fourth pixel of every second row. `offset_px` is measured minus true disparity, `focal_px`
    // need only be about right, tolerance is a share of the camera's height.
    void find(ConstDisparityMap map, const DisparityPlane& plane, double offset_px, double focal_px,
              double tolerance, Parallel& parallel);
    // After the last find(): what lies behind a lip is cut off, cells are judged.
    void settle(double per_row_px);
    // The plane itself, every cell alike.
    void flatten(CellSupport support = CellSupport::kNone);

    // The plane that lies evenly between the profile's heights and depths, every metre counting alike.
    DisparityPlane levelled(const DisparityPlane& plane, double offset_px) const;

    bool flat() const { return flat_; }
    // Cell row of a measured disparity.
    int step_of(int disparity_q4) const { return step_of_q4_[index_of(disparity_q4)]; }
    int steps() const { return steps_; }
    int bands() const { return bands_; }
    // Of the surface above the plane.
    double rise(int disparity_q4) const {
        return flat_ ? 0.0 : static_cast<double>(rise_[index_of(disparity_q4)]);
    }
    CellSupport support(int step, int band) const { return support_[cell(step, band)]; }

  private:
    static constexpr int kHeights = 48;  // bins of a sixth of the tolerance
    static constexpr int kZero = kHeights / 2;
    static constexpr int kBeyond = kHeights;  // pixels of any other height
    static constexpr int kCounts = kHeights + 1;

    std::size_t cell(int step, int band) const { return static_cast<std::size_t>(step * bands_ + band); }
    std::size_t index_of(int disparity_q4) const {
        const int last = static_cast<int>(step_of_q4_.size()) - 1;
        return static_cast<std::size_t>(std::clamp(disparity_q4 - first_q4_, 0, last));
    }
    void count(ConstDisparityMap map, const DisparityPlane& plane, double offset_px, double tolerance);
    bool trace_profile(double per_row_px);
    void cut_behind_lip(double per_row_px);
    void judge_cells();
    void doubt_ramps();

    int bands_ = 1;
    int width_ = 0;
    int first_q4_ = 0;
    int steps_ = 0;
    int fine_px_ = 0;  // below, two steps a pixel
    bool flat_ = true;
    double height_bin_ = 0.0;
    double focal_times_normal_ = 0.0;  // f N, N the length of the plane's normal in disparity: Z/h = f N / d
    std::span<std::uint16_t> step_of_q4_;
    std::span<double> inverse_px_;     // 1 / true disparity by measured disparity
    std::span<double> range_;          // of each step
    std::span<std::uint16_t> counts_;  // [step][band][height, kBeyond]
    std::span<std::int32_t> pooled_;   // [step][height]
    std::span<std::int32_t> best_;     // [step][height] of the path so far
    std::span<std::int8_t> from_;      // [step][height] where it came from, in height bins
    std::span<double> profile_;        // [step], in height bins from kZero
    std::span<bool> profile_seen_;
    std::span<float> rise_;  // by measured disparity
    std::span<CellSupport> support_;
};

}  // namespace groundline::terrain
