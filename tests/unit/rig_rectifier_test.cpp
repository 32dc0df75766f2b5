// The fixed-point remap: its own specification, a plain double one, odd sizes, rims, identity.
#include "rig/rectifier.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "rig/photometric.hpp"
#include "support/allocation_count.hpp"
#include "unit/rig_support.hpp"

namespace groundline::rig {
namespace {

using test::Random;

// Smooth texture with a little noise: gradients up to some 30 grey levels a pixel.
void fill_texture(Luma image, std::uint32_t seed) {
    std::mt19937 random(seed);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const double wave = 60 * std::sin(0.31 * x + 0.05 * y) + 50 * std::cos(0.23 * y - 0.07 * x);
            image.at(x, y) = static_cast<std::uint8_t>(128 + wave + static_cast<int>(random() % 11) - 5);
        }
}

StereoFrame sample_frame(Arena& arena, int width, int height, bool colour) {
    StereoFrame frame = StereoFrame::make(arena, width, height, colour);
    fill_texture(frame.left, 1);
    fill_texture(frame.right, 2);
    for (int y = 0; y < frame.left_bgr.height; ++y)
        for (int x = 0; x < 3 * frame.left_bgr.width; ++x)
            frame.left_bgr.row(y)[x] = static_cast<std::uint8_t>(frame.left.at(x / 3, y) ^ (x % 3 * 40));
    return frame;
}

bool same(ConstLuma a, ConstLuma b) {
    for (int y = 0; y < a.height; ++y)
        if (!std::equal(a.row(y), a.row(y) + a.width, b.row(y))) return false;
    return a.same_size(b.width, b.height);
}

// The specification in its own words.
int remapped(const SourcePixel& p, ConstLuma image) {
    if (p.x == SourcePixel::kNoSource) return 0;
    int sum = 512, weights = 0;
    for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 2; ++i) {
            const int weight = (i == 1 ? p.right32 : 32 - p.right32) * (j == 1 ? p.below32 : 32 - p.below32);
            sum += weight * image.at(p.x + i, p.y + j);
            weights += weight;
        }
    EXPECT_EQ(weights, 1024);
    return sum >> 10;
}

class RemapOf : public testing::TestWithParam<std::pair<int, int>> {};

TEST_P(RemapOf, RemapsAsSpecified) {
    const auto [width, height] = GetParam();
    Random random(31);
    Arena arena;
    const StereoCalibration rig = test::sample_rig(random, Lens::kPinhole, width, height);
    const Rectifier rectifier(rig, width, height, arena);
    ASSERT_FALSE(rectifier.identity());
    const StereoFrame frame = sample_frame(arena, width, height, true);
    StereoFrame out = StereoFrame::make(arena, width, height, true);
    Serial serial;
    rectifier.rectify(frame, out.left, out.right, out.left_bgr, serial);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            ASSERT_EQ(out.left.at(x, y), remapped(rectifier.map_left().at(x, y), frame.left))
                << x << "," << y;
            ASSERT_EQ(out.right.at(x, y), remapped(rectifier.map_right().at(x, y), frame.right))
                << x << "," << y;
        }
    for (int channel = 0; channel < 3; ++channel) {
        const Luma plane = arena.image<std::uint8_t>(width, height);
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                plane.at(x, y) = frame.left_bgr.row(y)[3 * x + channel];
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                ASSERT_EQ(out.left_bgr.row(y)[3 * x + channel],
                          remapped(rectifier.map_left().at(x, y), plane));
    }
}

INSTANTIATE_TEST_SUITE_P(, RemapOf,
                         testing::Values(std::pair{640, 480}, std::pair{641, 479}, std::pair{97, 65},
                                         std::pair{33, 17}, std::pair{16, 15}),
                         [](const auto& size) {
                             return std::to_string(size.param.first) + "x" +
                                    std::to_string(size.param.second);
                         });

// Against positions and interpolation in double, from the independent camera model. The position is rounded
// to 1/32 px, so an axis moves the value by at most 1/64 of the steepest step nearby, and the output by 1/2.
TEST(Remap, StaysWithinItsErrorBoundOfPlainBilinear) {
    for (const Lens lens : {Lens::kPinhole, Lens::kEquidistant}) {
        const int width = 321, height = 240;
        Random random(32);
        Arena arena;
        const StereoCalibration rig = test::sample_rig(random, lens, width, height);
        const Rectifier rectifier(rig, width, height, arena);
        const StereoFrame frame = sample_frame(arena, width, height, false);
        StereoFrame out = StereoFrame::make(arena, width, height, false);
        Serial serial;
        rectifier.rectify(frame, out.left, out.right, {}, serial);
        // The rotation is the one thing taken from the code under test; rig_rectification_test.cpp proves it.
        const Vector3 x_axis =
            normalised(transposed(rig.rotation) *
                       Vector3{-rig.translation_m[0], -rig.translation_m[1], -rig.translation_m[2]});
        const Vector3 other_axis = {rig.rotation[6], rig.rotation[7], rig.rotation[8] + 1.0};
        const double along = dot(other_axis, x_axis);
        const Vector3 z_axis =
            normalised({other_axis[0] - along * x_axis[0], other_axis[1] - along * x_axis[1],
                        other_axis[2] - along * x_axis[2]});
        const Vector3 y_axis = cross(z_axis, x_axis);
        const RectifiedRig& view = rectifier.rig();
        double sum_error = 0.0;
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const double a = (x - view.cx_px) / view.focal_px, b = (y - view.cy_px) / view.focal_px;
                Vector3 ray{};
                for (std::size_t i = 0; i < 3; ++i)
                    ray[i] = a * x_axis[i] + b * y_axis[i] + z_axis[i];
                const test::Point2 p = test::pixel_of(rig.left, ray);
                const int u = std::clamp(static_cast<int>(std::floor(p.x)), 0, width - 2);
                const int v = std::clamp(static_cast<int>(std::floor(p.y)), 0, height - 2);
                const double s = p.x - u, t = p.y - v;
                const double exact =
                    (1 - t) * ((1 - s) * frame.left.at(u, v) + s * frame.left.at(u + 1, v)) +
                    t * ((1 - s) * frame.left.at(u, v + 1) + s * frame.left.at(u + 1, v + 1));
                int step_x = 0, step_y = 0;  // steepest in the cell and those around it
                for (int j = std::max(v - 1, 0); j <= std::min(v + 2, height - 1); ++j)
                    for (int i = std::max(u - 1, 0); i <= std::min(u + 2, width - 1); ++i) {
                        if (i + 1 < width)
                            step_x =
                                std::max(step_x, std::abs(frame.left.at(i + 1, j) - frame.left.at(i, j)));
                        if (j + 1 < height)
                            step_y =
                                std::max(step_y, std::abs(frame.left.at(i, j + 1) - frame.left.at(i, j)));
                    }
                const double error = std::abs(out.left.at(x, y) - exact);
                ASSERT_LE(error, (step_x + step_y) / 64.0 + 0.5 + 1e-6) << x << "," << y;
                sum_error += error;
            }
        // Uniform rounding alone is 0.25 in the mean.
        EXPECT_LT(sum_error / (width * height), 0.35);
    }
}

TEST(Remap, DoesNotDependOnOrderOrLanes) {
    Random random(33);
    Arena arena;
    const StereoCalibration rig = test::sample_rig(random, Lens::kPinhole, 201, 155);
    const Rectifier rectifier(rig, 201, 155, arena);
    const StereoFrame frame = sample_frame(arena, 201, 155, false);
    StereoFrame a = StereoFrame::make(arena, 201, 155, false);
    StereoFrame b = StereoFrame::make(arena, 201, 155, false);
    Serial serial;
    test::Backwards backwards;
    rectifier.rectify(frame, a.left, a.right, {}, serial);
    rectifier.rectify(frame, b.left, b.right, {}, backwards);
    EXPECT_TRUE(same(a.left, b.left));
    EXPECT_TRUE(same(a.right, b.right));
    EXPECT_FALSE(same(a.left, a.right));
}

TEST(Remap, TheLastRowAndColumnNeedNothingBeyondThePicture) {
    // A pure half-pixel shift to the right: the last column has no source, the last row is read in full.
    StereoCalibration rig;
    for (CameraModel* camera : {&rig.left, &rig.right}) {
        camera->fx = camera->fy = 32;
        camera->cx = 8;
        camera->cy = 7;
        camera->width = 17;
        camera->height = 15;
    }
    rig.translation_m = {-0.1, 0, 0};
    GivenRectification given;
    given.projection_left = {32, 0, 7.5, 0, 0, 32, 7, 0, 0, 0, 1, 0};
    given.projection_right = {32, 0, 8, -3.2, 0, 32, 7, 0, 0, 0, 1, 0};
    rig.rectification = given;
    Arena arena;
    const Rectifier rectifier(rig, 17, 15, arena);
    ASSERT_FALSE(rectifier.identity());
    ASSERT_TRUE(rectifier.outside_left().same_size(17, 15));
    EXPECT_TRUE(rectifier.outside_right().empty());
    const StereoFrame frame = sample_frame(arena, 17, 15, false);
    StereoFrame out = StereoFrame::make(arena, 17, 15, false);
    fill_pixels(out.left, 77);
    Serial serial;
    rectifier.rectify(frame, out.left, out.right, {}, serial);
    for (int y = 0; y < 15; ++y) {
        for (int x = 0; x < 16; ++x) {
            EXPECT_EQ(rectifier.outside_left().at(x, y), 0);
            EXPECT_EQ(out.left.at(x, y), (frame.left.at(x, y) + frame.left.at(x + 1, y) + 1) / 2);
        }
        EXPECT_EQ(rectifier.outside_left().at(16, y), 1);
        EXPECT_EQ(out.left.at(16, y), 0);
    }
    EXPECT_TRUE(same(out.right, frame.right));
    EXPECT_DOUBLE_EQ(rectifier.rig().offset_px(), -0.5);
}

TEST(Rectifier, CopiesRectifiedPictures) {
    StereoCalibration rig;
    rig.rectified = true;
    rig.left.fx = rig.left.fy = rig.right.fx = rig.right.fy = 90;
    rig.left.cx = 50;
    rig.right.cx = 56;
    rig.left.cy = rig.right.cy = 30;
    rig.translation_m = {-0.2, 0, 0};
    Arena arena;
    const Rectifier rectifier(rig, 101, 63, arena);
    EXPECT_EQ(arena.bytes(), 0U);
    EXPECT_TRUE(rectifier.identity());
    EXPECT_TRUE(rectifier.warnings().empty());
    EXPECT_TRUE(rectifier.rig().calibrated);
    EXPECT_EQ(rectifier.rig().focal_px, 90);
    EXPECT_EQ(rectifier.rig().offset_px(), -6);
    EXPECT_EQ(rectifier.rig().baseline_m, 0.2);
    const StereoFrame frame = sample_frame(arena, 101, 63, true);
    StereoFrame out = StereoFrame::make(arena, 101, 63, true);
    Serial serial;
    rectifier.rectify(frame, out.left, out.right, out.left_bgr, serial);
    EXPECT_TRUE(same(out.left, frame.left));
    EXPECT_TRUE(same(out.right, frame.right));
    for (int y = 0; y < 63; ++y)
        EXPECT_TRUE(std::equal(out.left_bgr.row(y), out.left_bgr.row(y) + 303, frame.left_bgr.row(y)));
}

TEST(Rectifier, NoticesThatAnIdealRigNeedsNoRemap) {
    StereoCalibration rig;
    for (CameraModel* camera : {&rig.left, &rig.right}) {
        camera->fx = camera->fy = 300;
        camera->cx = 159.5;
        camera->cy = 119.5;
    }
    rig.translation_m = {-0.1, 0, 0};
    GivenRectification given;
    given.projection_left = {300, 0, 159.5, 0, 0, 300, 119.5, 0, 0, 0, 1, 0};
    given.projection_right = {300, 0, 159.5, -30, 0, 300, 119.5, 0, 0, 0, 1, 0};
    rig.rectification = given;
    Arena arena;
    EXPECT_TRUE(Rectifier(rig, 320, 240, arena).identity());
    rig.right.cx += 1.0;
    EXPECT_FALSE(Rectifier(rig, 320, 240, arena).identity());
}

TEST(Rectifier, WithoutCalibrationKnowsOnlyTheSize) {
    const Rectifier rectifier(320, 200);
    EXPECT_TRUE(rectifier.identity());
    EXPECT_FALSE(rectifier.rig().calibrated);
    EXPECT_EQ(rectifier.rig().width, 320);
    EXPECT_EQ(rectifier.rig().height, 200);
    EXPECT_TRUE(rectifier.outside_left().empty());
}

TEST(Rectifier, WarnsOfUnequalFocalLengths) {
    StereoCalibration rig;
    rig.rectified = true;
    rig.left.fx = rig.right.fx = 100;
    rig.left.fy = rig.right.fy = 100.6;
    rig.left.cx = rig.right.cx = 50;
    rig.left.cy = rig.right.cy = 40;
    rig.translation_m = {-0.1, 0, 0};
    Arena arena;
    EXPECT_EQ(Rectifier(rig, 100, 80, arena).warnings().size(), 1U);
    rig.left.fy = rig.right.fy = 100.4;
    EXPECT_TRUE(Rectifier(rig, 100, 80, arena).warnings().empty());
}

TEST(Rectifier, AllocatesNothingPerFrame) {
    Random random(34);
    Arena arena;
    const StereoCalibration rig = test::sample_rig(random, Lens::kPinhole, 160, 120);
    const Rectifier rectifier(rig, 160, 120, arena);
    const StereoFrame frame = sample_frame(arena, 160, 120, true);
    StereoFrame out = StereoFrame::make(arena, 160, 120, true);
    Serial serial;
    const std::uint64_t before = groundline::test::allocations();
    rectifier.rectify(frame, out.left, out.right, out.left_bgr, serial);
    const PhotometricEvidence evidence = measure_photometric(out.left, out.right, serial);
    EXPECT_EQ(groundline::test::allocations(), before);
    EXPECT_GT(evidence.contrast, 0.0);
}

// The same maps on every processor: FNV-1a over every field of both maps.
std::uint64_t fingerprint(const Rectifier& rectifier) {
    std::uint64_t hash = 14695981039346656037ULL;
    const auto add = [&](int value) {
        for (int byte = 0; byte < 2; ++byte) {
            hash ^= static_cast<std::uint8_t>(value >> (8 * byte));
            hash *= 1099511628211ULL;
        }
    };
    for (const auto& map : {rectifier.map_left(), rectifier.map_right()})
        for (int y = 0; y < map.height; ++y)
            for (int x = 0; x < map.width; ++x) {
                const SourcePixel& p = map.at(x, y);
                add(p.x);
                add(p.y);
                add(p.right32);
                add(p.below32);
            }
    return hash;
}

StereoCalibration golden_rig(Lens lens) {
    StereoCalibration rig;
    rig.left = {320, 240, 251.5, 252.25, 161.0, 117.5, lens, {-0.05, 0.02, 0.001, -0.0005}};
    rig.right = {320, 240, 249.75, 250.5, 157.25, 121.0, lens, {-0.045, 0.018, -0.0008, 0.0007}};
    // A rotation with rational elements: no sine is needed to write it down.
    rig.rotation = {0.9998000199980001,    0, 0.019998000199980002, 0, 1, 0,
                    -0.019998000199980002, 0, 0.9998000199980001};
    rig.translation_m = {-0.12, 0.0025, -0.0015};
    return rig;
}

TEST(Rectifier, MakesTheSameMapsEverywhere) {
    Arena arena;
    EXPECT_EQ(fingerprint(Rectifier(golden_rig(Lens::kPinhole), 320, 240, arena)), 15722674121544464342ULL);
    EXPECT_EQ(fingerprint(Rectifier(golden_rig(Lens::kEquidistant), 320, 240, arena)),
              18215042005412525256ULL);
}

}  // namespace
}  // namespace groundline::rig
