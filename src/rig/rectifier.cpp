#include "rig/rectifier.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <optional>

#include "rig/lens.hpp"
#include "rig/rectification.hpp"

namespace groundline::rig {
namespace {

constexpr int kBandRows = 16;  // one task; at VGA about 50 us of work
constexpr double kOne = 32.0;  // steps of a source pixel
constexpr SourcePixel kOutside = {SourcePixel::kNoSource, 0, 0, 0};

// Position on one axis: the lower of the two source pixels and the share of the upper one. The last pixel is
// the upper one with the full share, so that reading both never leaves the picture.
struct Split {
    int lower;
    int share32;
};

// None beyond the outermost pixel centres (after rounding to 1/32 px).
std::optional<Split> split(double position, int size) {
    // Before the conversion, which is undefined far outside.
    if (!(position > -1.0 && position < size)) return std::nullopt;
    const int steps = static_cast<int>(std::floor(position * kOne + 0.5));
    if (steps < 0 || steps > (size - 1) * 32) return std::nullopt;
    const int lower = std::min(steps / 32, size - 2);
    return Split{lower, steps - lower * 32};
}

SourcePixel source_pixel(const std::optional<Pixel>& pixel, int width, int height) {
    if (!pixel) return kOutside;
    const std::optional<Split> u = split(pixel->u, width);
    const std::optional<Split> v = split(pixel->v, height);
    if (!u || !v) return kOutside;
    return {static_cast<std::int16_t>(u->lower), static_cast<std::int16_t>(v->lower),
            static_cast<std::uint16_t>(u->share32), static_cast<std::uint16_t>(v->share32)};
}

void fill_map(const CameraModel& camera, const Matrix3& rotation, const Rectification& frame, double cx,
              ImageView<SourcePixel> map) {
    const LensProjection lens(camera);
    const Matrix3 back = transposed(rotation);
    for (int y = 0; y < map.height; ++y) {
        SourcePixel* row = map.row(y);
        for (int x = 0; x < map.width; ++x) {
            const Vector3 ray = {(x - cx) / frame.fx, (y - frame.cy) / frame.fy, 1.0};
            row[x] = source_pixel(lens.project(back * ray), map.width, map.height);
        }
    }
}

bool is_identity(ConstImageView<SourcePixel> map) {
    for (int y = 0; y < map.height; ++y)
        for (int x = 0; x < map.width; ++x) {
            const SourcePixel& p = map.at(x, y);
            if (p.x < 0 || 32 * p.x + p.right32 != 32 * x || 32 * p.y + p.below32 != 32 * y) return false;
        }
    return true;
}

ImageView<std::uint8_t> outside_of(ConstImageView<SourcePixel> map, Arena& arena) {
    bool any = false;
    for (int y = 0; y < map.height && !any; ++y)
        any = std::any_of(map.row(y), map.row(y) + map.width,
                          [](const SourcePixel& p) { return p.x == SourcePixel::kNoSource; });
    if (!any) return {};
    const ImageView<std::uint8_t> outside = arena.image<std::uint8_t>(map.width, map.height);
    for (int y = 0; y < map.height; ++y)
        for (int x = 0; x < map.width; ++x)
            outside.at(x, y) = map.at(x, y).x == SourcePixel::kNoSource ? 1 : 0;
    return outside;
}

// One row of output; `kChannels` bytes a pixel, `stride` bytes from row to row of the source.
template <int kChannels>
void remap_row(const SourcePixel* map, int width, const std::uint8_t* source, std::ptrdiff_t stride,
               std::uint8_t* target) {
    for (int x = 0; x < width; ++x) {
        const SourcePixel p = map[x];
        if (p.x == SourcePixel::kNoSource) {
            for (int channel = 0; channel < kChannels; ++channel)
                target[kChannels * x + channel] = 0;
            continue;
        }
        const std::uint8_t* upper = source + p.y * stride + kChannels * p.x;
        const std::uint8_t* lower = upper + stride;
        const int right = p.right32;
        const int below = p.below32;
        for (int channel = 0; channel < kChannels; ++channel) {
            const int above_value = (32 - right) * upper[channel] + right * upper[channel + kChannels];
            const int below_value = (32 - right) * lower[channel] + right * lower[channel + kChannels];
            const int sum = (32 - below) * above_value + below * below_value;
            target[kChannels * x + channel] = static_cast<std::uint8_t>((sum + 512) >> 10);
        }
    }
}

}  // namespace

Rectifier::Rectifier(int width, int height) {
    rig_.width = width;
    rig_.height = height;
}

Rectifier::Rectifier(const StereoCalibration& calibration, int width, int height, Arena& arena)
    : Rectifier(width, height) {
    require_usable(calibration, width, height);
    Rectification frame;
    if (calibration.rectified) {
        frame.fx = calibration.left.fx;
        frame.fy = calibration.left.fy;
        frame.cx_left = calibration.left.cx;
        frame.cx_right = calibration.right.cx;
        frame.cy = calibration.left.cy;
        frame.baseline_m = -calibration.translation_m[0];
    } else {
        frame = rectification_of(calibration, width, height);
        left_.map = arena.image<SourcePixel>(width, height);
        right_.map = arena.image<SourcePixel>(width, height);
        fill_map(calibration.left, frame.rotation_left, frame, frame.cx_left, left_.map);
        fill_map(calibration.right, frame.rotation_right, frame, frame.cx_right, right_.map);
        if (is_identity(left_.map) && is_identity(right_.map)) {
            left_.map = {};
            right_.map = {};
        } else {
            left_.outside = outside_of(left_.map, arena);
            right_.outside = outside_of(right_.map, arena);
        }
    }
    rig_.calibrated = true;
    rig_.focal_px = frame.fx;
    rig_.cx_px = frame.cx_left;
    rig_.cy_px = frame.cy;
    rig_.cx_right_px = frame.cx_right;
    rig_.baseline_m = frame.baseline_m;
    if (const double off = std::abs(frame.fy / frame.fx - 1.0); off > 0.005)
        warnings_.push_back(fmt::format(
            "{}: the rectified focal lengths {:.6g} and {:.6g} px differ by {:.1f} %; heights and pitch are "
            "off by about as much, since {:.6g} px is used for both",
            calibration.source, frame.fx, frame.fy, 100.0 * off, frame.fx));
}

void Rectifier::rectify(const StereoFrame& from, Luma left, Luma right, BgrView left_bgr,
                        Parallel& parallel) const {
    assert(from.left.same_size(rig_.width, rig_.height) && from.right.same_size(rig_.width, rig_.height));
    assert(left.same_size(rig_.width, rig_.height) && right.same_size(rig_.width, rig_.height));
    const bool colour = !from.left_bgr.empty() && !left_bgr.empty();
    const int bands = (rig_.height + kBandRows - 1) / kBandRows;
    parallel.for_each(bands, [&](int band, int) {
        const int end = std::min((band + 1) * kBandRows, rig_.height);
        for (int y = band * kBandRows; y < end; ++y) {
            if (identity()) {
                std::copy_n(from.left.row(y), rig_.width, left.row(y));
                std::copy_n(from.right.row(y), rig_.width, right.row(y));
                if (colour) std::copy_n(from.left_bgr.row(y), 3 * rig_.width, left_bgr.row(y));
                continue;
            }
            remap_row<1>(left_.map.row(y), rig_.width, from.left.data, from.left.stride, left.row(y));
            remap_row<1>(right_.map.row(y), rig_.width, from.right.data, from.right.stride, right.row(y));
            if (colour)
                remap_row<3>(left_.map.row(y), rig_.width, from.left_bgr.data, from.left_bgr.stride,
                             left_bgr.row(y));
        }
    });
}

}  // namespace groundline::rig
