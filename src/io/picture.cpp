#include "io/picture.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "core/deterministic_math.hpp"

namespace groundline::io {
namespace {

constexpr int kLineShift = 4;  // lines are drawn with sixteenths of a pixel

cv::Scalar scalar_of(const Colour& colour) {
    return {static_cast<double>(colour[0]), static_cast<double>(colour[1]), static_cast<double>(colour[2])};
}

void resize(Image8& image, int width, int height) {
    image.width = width;
    image.height = height;
    image.channels = 3;
    image.bytes.resize(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
}

cv::Mat matrix_of(Image8& image) {
    return {image.height, image.width, CV_8UC3, image.bytes.data()};
}

std::uint8_t mix(unsigned own, unsigned tint, unsigned tint_share) {
    return static_cast<std::uint8_t>((own * (256 - tint_share) + tint * tint_share) >> 8U);
}

// A line between points far outside as well, cut to the picture first so that no coordinate overflows.
void draw_line(cv::Mat& image, double x0, double y0, double x1, double y1, const Colour& colour,
               int thickness = 1) {
    const double dx = x1 - x0, dy = y1 - y0;
    if (!std::isfinite(dx) || !std::isfinite(dy)) return;
    double from = 0.0, to = 1.0;
    const auto cut = [&](double start, double step, double least, double most) {
        if (step == 0.0) {
            if (start < least || start > most) to = -1.0;
            return;
        }
        const double a = (least - start) / step, b = (most - start) / step;
        from = std::max(from, std::min(a, b));
        to = std::min(to, std::max(a, b));
    };
    cut(x0, dx, -8.0, image.cols + 8.0);
    cut(y0, dy, -8.0, image.rows + 8.0);
    if (!(from < to)) return;
    constexpr double kOne = 1 << kLineShift;
    const auto point = [&](double t) {
        return cv::Point(static_cast<int>(std::floor((x0 + t * dx) * kOne + 0.5)),
                         static_cast<int>(std::floor((y0 + t * dy) * kOne + 0.5)));
    };
    cv::line(image, point(from), point(to), scalar_of(colour), thickness, cv::LINE_AA, kLineShift);
}

double offset_px(const FrameResult& result) {
    return result.rig.calibrated ? result.rig.offset_px() : 0.0;
}

// The largest true disparity that the histogram, and so the search, can hold.
double largest_disparity_px(const FrameResult& result) {
    const VDisparity& v = result.v_disparity;
    return v.first_px + static_cast<double>(v.histogram.width) / v.bins_per_px - offset_px(result);
}

// range_colour for each q4 disparity from 0 to the largest, so that a pixel costs one look-up.
std::vector<Colour> colour_table(double largest_px) {
    const int entries = std::clamp(static_cast<int>(largest_px * kDisparityOne), 1, 1 << 15) + 1;
    std::vector<Colour> table(static_cast<std::size_t>(entries));
    for (int i = 0; i < entries; ++i)
        table[static_cast<std::size_t>(i)] = range_colour(static_cast<double>(i) / kDisparityOne, largest_px);
    return table;
}

void paint_base(const FrameResult& result, Image8& to) {
    const int width = result.left.width;
    for (int y = 0; y < result.left.height; ++y) {
        std::uint8_t* target = to.bytes.data() + 3 * static_cast<std::ptrdiff_t>(y) * width;
        if (!result.left_bgr.empty()) {
            std::copy_n(result.left_bgr.row(y), 3 * width, target);
            continue;
        }
        const std::uint8_t* grey = result.left.row(y);
        for (int x = 0; x < width; ++x, target += 3)
            target[0] = target[1] = target[2] = grey[x];
    }
}

void tint_classes(const FrameResult& result, Image8& to) {
    const std::vector<Colour> table = colour_table(largest_disparity_px(result));
    const int last = static_cast<int>(table.size()) - 1;
    const int offset_q4 = static_cast<int>(std::floor(offset_px(result) * kDisparityOne + 0.5));
    for (int y = 0; y < to.height; ++y) {
        const TerrainClass* classes = result.mask.row(y);
        const std::int16_t* disparity = result.disparity.disparity_q4.row(y);
        const Invalid* invalid = result.disparity.invalid.row(y);
        std::uint8_t* pixel = to.bytes.data() + 3 * static_cast<std::ptrdiff_t>(y) * to.width;
        // Obstacle pixels without a disparity (nearer than the search range: range edge) take the hue on
        // their left.
        Colour hue = table.front();
        for (int x = 0; x < to.width; ++x, pixel += 3) {
            if (invalid[x] == Invalid::kNone)
                hue = table[static_cast<std::size_t>(std::clamp(disparity[x] - offset_q4, 0, last))];
            switch (classes[x]) {
                case TerrainClass::kTraversable:
                    break;
                case TerrainClass::kUnknown:
                    for (int c = 0; c < 3; ++c)
                        pixel[c] = mix(pixel[c], 0, 256 - kUnknownLight);
                    break;
                case TerrainClass::kObstacle:
                    for (int c = 0; c < 3; ++c)
                        pixel[c] = mix(pixel[c], hue[static_cast<std::size_t>(c)], kTintShare);
                    break;
                case TerrainClass::kDrop:
                    for (int c = 0; c < 3; ++c)
                        pixel[c] = mix(pixel[c], kDropColour[static_cast<std::size_t>(c)], kTintShare);
                    break;
            }
        }
    }
}

// Where the ground's true disparity is 0.
void draw_horizon(const FrameResult& result, cv::Mat& image) {
    const DisparityPlane& plane = result.ground.plane;
    if (!result.ground.found || plane.dv == 0.0) return;
    const auto row_at = [&](double u) { return (offset_px(result) - plane.d0 - plane.du * u) / plane.dv; };
    const double right = image.cols - 1.0;
    draw_line(image, 0.0, row_at(0.0), right, row_at(right), kHorizonColour);
}

// Lines no wider than the picture: words are the verdict and its reasons.
std::vector<std::string> caption_of(const FrameResult& result, double scale, int width) {
    std::vector<std::string> lines = {std::string(kVerdictNames[static_cast<std::size_t>(result.verdict)])};
    bool first = true;
    for (int i = 0; i < kReasons; ++i) {
        if (!result.reasons.has(static_cast<Reason>(i))) continue;
        const std::string_view name = kReasonNames[static_cast<std::size_t>(i)];
        const std::string word = fmt::format("{}{}", first ? ": " : ", ", name);
        first = false;
        int baseline = 0;
        if (cv::getTextSize(lines.back() + word, cv::FONT_HERSHEY_SIMPLEX, scale, 1, &baseline).width > width)
            lines.push_back(fmt::format("  {}", name));
        else
            lines.back() += word;
    }
    if (result.ground.found && result.ground.metric) {
        const GroundPose& pose = result.ground.pose;
        lines.push_back(fmt::format("camera {:.2f} m high, pitch {:.1f}, roll {:.1f} deg", pose.height_m,
                                    det::degrees(pose.pitch_rad), det::degrees(pose.roll_rad)));
    }
    return lines;
}

void draw_caption(const FrameResult& result, cv::Mat& image) {
    constexpr int kMargin = 6;
    static constexpr std::array<Colour, 3> kVerdictColours = {
        {{90, 90, 255}, {60, 190, 255}, {110, 230, 110}}};
    const double scale = std::clamp(image.rows / 900.0, 0.36, 0.9);
    const std::vector<std::string> lines = caption_of(result, scale, image.cols - 4 * kMargin);
    int baseline = 0;
    int box_width = 0;
    for (const std::string& line : lines)
        box_width =
            std::max(box_width, cv::getTextSize(line, cv::FONT_HERSHEY_SIMPLEX, scale, 1, &baseline).width);
    const int text_height = cv::getTextSize("Mg", cv::FONT_HERSHEY_SIMPLEX, scale, 1, &baseline).height;
    const int pitch = text_height + baseline + 2;
    const cv::Rect box =
        cv::Rect(0, 0, box_width + 2 * kMargin, pitch * static_cast<int>(lines.size()) + kMargin) &
        cv::Rect(0, 0, image.cols, image.rows);
    image(box) *= 0.35;
    for (std::size_t i = 0; i < lines.size(); ++i) {
        const Colour colour =
            i == 0 ? kVerdictColours[static_cast<std::size_t>(result.verdict)] : Colour{225, 225, 225};
        cv::putText(image, lines[i], {kMargin, pitch * (static_cast<int>(i) + 1) - baseline + 2},
                    cv::FONT_HERSHEY_SIMPLEX, scale, scalar_of(colour), 1, cv::LINE_AA);
    }
}

// log2(1 + n) in 1/256, linear between the powers of two: smooth enough for the eye, the same everywhere.
unsigned log2_q8(unsigned n) {
    const unsigned value = n + 1;
    const auto octave = static_cast<unsigned>(std::bit_width(value)) - 1;
    return octave * 256 + ((value - (1U << octave)) << 8U >> octave);
}

// `merge` bins make a column. A single bin's column shows the sum over one pixel of disparity around it, so
// that whole-pixel disparities do not leave three of four columns empty. Full brightness is a third of a row
// in one pixel of disparity; the square of the logarithm keeps single mismatches dim beside what many rows
// agree on.
void paint_counts(const FrameResult& result, int merge, Image8& to) {
    const VDisparity& v = result.v_disparity;
    const unsigned full = log2_q8(static_cast<unsigned>(kDisparityOne * std::max(1, result.left.width / 3)));
    const int before = merge == 1 ? v.bins_per_px / 2 : 0;
    const int after = merge == 1 ? v.bins_per_px - before : merge;
    for (int y = 0; y < to.height; ++y) {
        const std::uint16_t* row = v.histogram.row(y);
        std::uint8_t* pixel = to.bytes.data() + 3 * static_cast<std::ptrdiff_t>(y) * to.width;
        for (int x = 0; x < to.width; ++x, pixel += 3) {
            const int end = std::min(v.histogram.width, x * merge + after);
            unsigned sum = 0;
            for (int bin = std::max(0, x * merge - before); bin < end; ++bin)
                sum += row[bin];
            const unsigned share_q8 = std::min(256U, log2_q8(sum) * 256 / full);
            pixel[0] = pixel[1] = pixel[2] = static_cast<std::uint8_t>((share_q8 * share_q8 * 255) >> 16U);
        }
    }
}

// Ground line and tolerance at the middle column, all from the horizon down to the last row.
void draw_ground(const FrameResult& result, int merge, Image8& to) {
    const VDisparity& v = result.v_disparity;
    const Ground& ground = result.ground;
    if (!ground.found || ground.plane.dv == 0.0) return;
    const double offset = offset_px(result);
    const double first_row_px = ground.plane.at(0.5 * (result.left.width - 1.0), 0.0) - offset;  // true
    const double horizon_row = -first_row_px / ground.plane.dv;
    const double last_row = to.height - 1.0;
    const double last_row_px = first_row_px + ground.plane.dv * last_row;
    if (last_row_px <= 0.0) return;
    const auto column = [&](double true_px) {
        return ((true_px + offset - v.first_px) * v.bins_per_px + 0.5) / merge - 0.5;
    };
    cv::Mat image = matrix_of(to);
    const auto draw = [&](double factor, const Colour& colour, int thickness) {
        draw_line(image, column(0.0), horizon_row, column(factor * last_row_px), last_row, colour, thickness);
    };
    // H = h (1 - d_g / d): what stands t h above the ground has d = d_g / (1 - t).
    const double ratio = ground.metric && result.tolerance_m > 0.0 ? result.tolerance_m / ground.pose.height_m
                                                                   : result.tolerance_ratio;
    if (ratio > 0.0) {
        draw(1.0 / (1.0 + ratio), kToleranceColour, 1);
        if (ratio < 1.0) draw(1.0 / (1.0 - ratio), kToleranceColour, 1);
    }
    draw(1.0, kGroundLineColour, 2);
}

}  // namespace

Colour range_colour(double disparity_px, double largest_px) {
    const double share = largest_px > 0.0 ? std::clamp(disparity_px / largest_px, 0.0, 1.0) : 0.0;
    // Hue from blue (240 degrees) to red (0), one rise or fall per 60 degrees.
    const double sixths = 4.0 * (1.0 - std::sqrt(share));
    const auto channel = [&](double shift) {
        const double at = sixths + shift >= 6.0 ? sixths + shift - 6.0 : sixths + shift;
        const double distance = at > 3.0 ? at - 3.0 : 3.0 - at;  // 3 where the channel is full
        return static_cast<std::uint8_t>(255.0 * std::clamp(distance - 1.0, 0.0, 1.0) + 0.5);
    };
    return {channel(2.0), channel(4.0), channel(0.0)};
}

void paint_overlay(const FrameResult& result, Image8& to) {
    resize(to, result.left.width, result.left.height);
    if (to.bytes.empty()) return;
    paint_base(result, to);
    tint_classes(result, to);
    cv::Mat image = matrix_of(to);
    draw_horizon(result, image);
    draw_caption(result, image);
}

void paint_v_disparity(const FrameResult& result, Image8& to) {
    const VDisparity& v = result.v_disparity;
    const int merge = v.histogram.width > result.left.width ? v.bins_per_px : 1;
    resize(to, (v.histogram.width + merge - 1) / merge, v.histogram.height);
    if (to.bytes.empty()) return;
    paint_counts(result, merge, to);
    draw_ground(result, merge, to);
}

}  // namespace groundline::io
