// Turns pairs as delivered into rectified pairs: precomputed maps and a fixed-point bilinear remap.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/arena.hpp"
#include "core/frame.hpp"
#include "core/parallel.hpp"
#include "core/rectified_rig.hpp"
#include "rig/calibration.hpp"

namespace groundline::rig {

// Where a rectified pixel comes from: between source pixels (x, y) and (x + 1, y + 1), in 1/32 px.
struct SourcePixel {
    std::int16_t x;         // 0 .. width - 2; kNoSource outside the source picture
    std::int16_t y;         // 0 .. height - 2
    std::uint16_t right32;  // 0 .. 32, share of column x + 1
    std::uint16_t below32;  // 0 .. 32, share of row y + 1
    static constexpr std::int16_t kNoSource = -1;
    friend bool operator==(const SourcePixel&, const SourcePixel&) = default;
};

// Set up on one thread; rectify() is then const and free of allocation, locks and exceptions. Rectified
// pictures have the size of the delivered ones. Memory (8 bytes a pixel and view, plus one where there are
// pixels without source) belongs to the arena and must outlive this.
class Rectifier {
  public:
    // Maps in deterministic arithmetic: the same bits on every processor. Throws Refusal(kConfig) as
    // require_usable() does. Without a given rectification one is computed, see rectification.hpp.
    Rectifier(const StereoCalibration& calibration, int width, int height, Arena& arena);
    // Without calibration: pictures are taken as they are, rig().calibrated is false.
    Rectifier(int width, int height);

    const RectifiedRig& rig() const { return rig_; }
    // True where rectify() only copies.
    bool identity() const { return left_.map.empty(); }
    // What an operator should know at start, a sentence each.
    const std::vector<std::string>& warnings() const { return warnings_; }

    // `left`, `right` and, where `from` has colour and it is not empty, `left_bgr` receive the rectified
    // views; all of the size given at construction, none overlapping `from`. Output is (sum of w I + 512) >>
    // 10 with the four weights w summing to 1024 (algorithm.md 4.1), 0 where there is no source.
    void rectify(const StereoFrame& from, Luma left, Luma right, BgrView left_bgr, Parallel& parallel) const;

    // 1 where a rectified pixel has no source; empty where every pixel has one.
    ConstImageView<std::uint8_t> outside_left() const { return left_.outside; }
    ConstImageView<std::uint8_t> outside_right() const { return right_.outside; }

    // The maps, empty for the identity.
    ConstImageView<SourcePixel> map_left() const { return left_.map; }
    ConstImageView<SourcePixel> map_right() const { return right_.map; }

  private:
    struct View {
        ImageView<SourcePixel> map;
        ImageView<std::uint8_t> outside;
    };

    RectifiedRig rig_;
    View left_;
    View right_;
    std::vector<std::string> warnings_;
};

}  // namespace groundline::rig
