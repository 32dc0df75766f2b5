// The pictures of rendered scenes: the same surface in both views, light, noise, and the same bytes always.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>

#include "core/image.hpp"
#include "synth/texture.hpp"
#include "unit/synth_support.hpp"

namespace groundline::synth {
namespace {

using test::hash_of;
using test::Shuffled;
using test::Studio;

struct Moments {
    double mean = 0.0;
    double deviation = 0.0;
};
template <typename Value>
Moments moments(int count, Value value) {
    double sum = 0.0, squares = 0.0;
    for (int i = 0; i < count; ++i) {
        sum += value(i);
        squares += value(i) * value(i);
    }
    const double mean = sum / count;
    return {mean, std::sqrt(squares / count - mean * mean)};
}

std::uint64_t hash_of_pair(const Studio& studio) {
    return hash_of(studio.right, hash_of(studio.left, hash_of(studio.left_bgr)));
}
std::uint64_t hash_of_truth(const Truth& truth) {
    return hash_of(truth.occluded,
                   hash_of(truth.terrain, hash_of(truth.height_m, hash_of(truth.disparity_px))));
}

TEST(SynthPicture, LeftLumaIsTheLumaOfTheColour) {
    Studio studio("clutter?noise=2&width=160&height=120");
    studio.shoot();
    int coloured = 0;
    for (int v = 0; v < 120; ++v)
        for (int u = 0; u < 160; ++u) {
            const std::uint8_t* bgr = studio.left_bgr.row(v) + 3 * u;
            ASSERT_EQ(studio.left.at(u, v), luma_of(bgr[2], bgr[1], bgr[0]));
            coloured += std::abs(bgr[2] - bgr[0]) > 20 ? 1 : 0;
        }
    EXPECT_GT(coloured, 5000);
    // Without room for colour the luma is the same.
    const std::uint64_t luma = hash_of(studio.left);
    Serial serial;
    studio.renderer.render(0, serial, studio.left, {}, studio.right);
    EXPECT_EQ(hash_of(studio.left), luma);
}

TEST(SynthPicture, WallAtAWholeDisparityIsTheSameInBothViews) {
    // f b / Z = 500 * 0.12 / 6 = 10 px exactly.
    Studio studio("wall?wall_m=6&pitch_deg=0&wall_height_m=100&width=320&height=240&focal=500");
    studio.shoot();
    int pixels = 0, different = 0;
    for (int v = 0; v < 180; ++v)
        for (int u = 10; u < 320; ++u) {
            ++pixels;
            const int difference = std::abs(studio.left.at(u, v) - studio.right.at(u - 10, v));
            ASSERT_LE(difference, 1) << u << ' ' << v;
            different += difference;
        }
    EXPECT_LE(different, pixels / 1000) << "only where a level lies on the edge of rounding";
    const Moments spread =
        moments(320 * 180, [&](int i) { return double(studio.left.at(i % 320, i / 320)); });
    EXPECT_GT(spread.deviation, 8.0) << "a wall without texture would prove nothing";
}

TEST(SynthPicture, EveryVisibleSurfaceMatchesAtItsTrueDisparity) {
    for (const char* spec :
         {"plane?", "clutter?roll_deg=10&pitch_deg=20&", "undulating?", "drive?noise=0&", "ditch?"}) {
        Studio studio(std::string(spec) + "width=320&height=240&focal=400");
        studio.shoot();
        const Truth& truth = studio.truth;
        // Squared differences between left(u) and right(u - d + shift), and of the left picture's own steps.
        double squares[3] = {};
        int pixels = 0;
        for (int v = 0; v < 240; ++v)
            for (int u = 2; u < 318; ++u) {
                if (truth.seen.at(u, v) == 0 || truth.disparity_px.at(u, v) < 2.0) continue;
                bool smooth = true;  // away from edges of things, which no interpolation follows
                for (int k = -2; k <= 2; ++k)
                    smooth = smooth && truth.occluded.at(u + k, v) == 0 &&
                             std::abs(truth.disparity_px.at(u + k, v) - truth.disparity_px.at(u, v)) < 0.1;
                if (!smooth) continue;
                const double at = u - truth.disparity_px.at(u, v);
                if (at < 2.0 || at > 316.0) continue;
                ++pixels;
                for (int shift = -1; shift <= 1; ++shift) {
                    const int left_of = static_cast<int>(at) + shift;
                    const double share = at - static_cast<int>(at);
                    const double right =
                        (1.0 - share) * studio.right.at(left_of, v) + share * studio.right.at(left_of + 1, v);
                    const double difference = right - studio.left.at(u, v);
                    squares[shift + 1] += difference * difference;
                }
            }
        ASSERT_GT(pixels, 20000) << spec;
        const double at_truth = std::sqrt(squares[1] / pixels);
        EXPECT_LT(at_truth, 3.0) << spec;
        EXPECT_LT(at_truth, 0.4 * std::sqrt(squares[0] / pixels)) << spec;
        EXPECT_LT(at_truth, 0.4 * std::sqrt(squares[2] / pixels)) << spec;
    }
}

TEST(SynthPicture, SameBytesForAnyNumberOfLanesAndEveryRun) {
    Studio studio("drive?width=96&height=72&ditch_m=2");
    studio.shoot(3);
    const std::uint64_t pair = hash_of_pair(studio);
    const std::uint64_t truth = hash_of_truth(studio.truth);
    for (int lanes = 1; lanes <= 3; ++lanes) {
        Studio again("drive?width=96&height=72&ditch_m=2");
        Shuffled shuffled(lanes);
        again.renderer.render(3, shuffled, again.left, again.left_bgr, again.right);
        again.renderer.render_truth(3, shuffled, 0.2, again.truth);
        EXPECT_EQ(hash_of_pair(again), pair) << lanes;
        EXPECT_EQ(hash_of_truth(again.truth), truth) << lanes;
    }
    studio.shoot(4);
    EXPECT_NE(hash_of_pair(studio), pair);
    studio.shoot(3);
    EXPECT_EQ(hash_of_pair(studio), pair);
    EXPECT_EQ(hash_of_truth(studio.truth), truth);
}

TEST(SynthPicture, GoldenScenesAreTheSameOnEveryProcessor) {
    Studio drive("drive?width=96&height=72&ditch_m=2");
    drive.shoot(3);
    EXPECT_EQ(hash_of_pair(drive), 0x7B46738B046851DFU);
    EXPECT_EQ(hash_of_truth(drive.truth), 0x68021ADB9E85B04BU);
    Studio clutter("clutter?width=96&height=72&seed=5&roll_deg=7&noise=1.5&gain=1.06&offset=4");
    clutter.shoot();
    EXPECT_EQ(hash_of_pair(clutter), 0xEF49FCD26DA80D5EU);
    EXPECT_EQ(hash_of_truth(clutter.truth), 0xBD212243893A7D15U);
}

TEST(SynthPicture, SeedsAndFramesDiffer) {
    Studio one("boxes?width=96&height=72&seed=1"), two("boxes?width=96&height=72&seed=2");
    EXPECT_NE(hash_of_pair(one.shoot()), hash_of_pair(two.shoot()));
    const std::uint64_t still = hash_of_pair(one.shoot(0));
    EXPECT_EQ(hash_of_pair(one.shoot(1)), still) << "nothing moves and nothing is noisy";
    Studio noisy("boxes?width=96&height=72&seed=1&noise=1");
    EXPECT_NE(hash_of_pair(noisy.shoot(0)), hash_of_pair(noisy.shoot(1)));
}

TEST(SynthPicture, MismatchIsGainAndOffsetOfTheRightView) {
    Studio equal("boxes?width=160&height=120"), unequal("boxes?width=160&height=120&gain=1.06&offset=4");
    equal.shoot();
    unequal.shoot();
    for (int v = 0; v < 120; ++v)
        for (int u = 0; u < 160; ++u) {
            ASSERT_EQ(unequal.left.at(u, v), equal.left.at(u, v));
            const double expected = std::min(255.0, std::floor(1.06 * equal.right.at(u, v) + 4.0 + 0.5));
            ASSERT_EQ(unequal.right.at(u, v), static_cast<int>(expected)) << u << ' ' << v;
        }
}

TEST(SynthPicture, NoiseHasItsDeviationAndIsIndependent) {
    // A darker scene keeps every pixel more than 6 sigma from 0 and 255.
    constexpr int kWidth = 320, kHeight = 240, kPixels = kWidth * kHeight;
    Studio clean("plane?width=320&height=240&contrast=0.3"),
        noisy("plane?width=320&height=240&contrast=0.3&noise=3");
    clean.shoot();
    noisy.shoot();
    const auto left = [&](int i) {
        return double(noisy.left.at(i % kWidth, i / kWidth)) - clean.left.at(i % kWidth, i / kWidth);
    };
    const auto right = [&](int i) {
        return double(noisy.right.at(i % kWidth, i / kWidth)) - clean.right.at(i % kWidth, i / kWidth);
    };
    // Rounding adds up to 1/4 to the variance; five standard errors of the estimates.
    const double mean_error = 5.0 * 3.0 / std::sqrt(double(kPixels));
    for (const Moments& found : {moments(kPixels, left), moments(kPixels, right)}) {
        EXPECT_NEAR(found.mean, 0.0, mean_error);
        EXPECT_NEAR(found.deviation, 3.0, 0.05 + mean_error);
    }
    double common = 0.0, neighbour = 0.0;
    for (int i = 1; i < kPixels; ++i) {
        common += left(i) * right(i);
        neighbour += left(i) * left(i - 1);
    }
    const double limit = 5.0 / std::sqrt(double(kPixels));
    EXPECT_LT(std::abs(common / kPixels / 9.0), limit);
    EXPECT_LT(std::abs(neighbour / kPixels / 9.0), limit);
    const Moments unit_noise =
        moments(kPixels, [](int i) { return normal_noise(static_cast<std::uint64_t>(i) * 7919U); });
    EXPECT_NEAR(unit_noise.mean, 0.0, 5.0 / std::sqrt(double(kPixels)));
    EXPECT_NEAR(unit_noise.deviation, 1.0, 5.0 / std::sqrt(2.0 * kPixels));
}

TEST(SynthPicture, LightAndContrastDoWhatTheySay) {
    Studio usual("plane?width=160&height=120&pitch_deg=40");  // nothing but ground
    Studio faint("plane?width=160&height=120&pitch_deg=40&contrast=0.25");
    Studio dark("plane?width=160&height=120&pitch_deg=40&exposure=0.08");
    Studio blank("plane?width=160&height=120&pitch_deg=40&contrast=0");
    usual.shoot();
    faint.shoot();
    dark.shoot();
    blank.shoot();
    double ratio_sum = 0.0;
    for (int v = 0; v < 120; ++v)
        for (int u = 0; u < 160; ++u) {
            // luma = base (1 + contrast * texture): the texture's part shrinks to a quarter.
            const double base = blank.left.at(u, v);
            ASSERT_NEAR(faint.left.at(u, v) - base, 0.25 * (usual.left.at(u, v) - base), 2.0);
            ASSERT_NEAR(dark.left.at(u, v), 0.08 * usual.left.at(u, v), 1.1);
            ratio_sum += std::abs(usual.left.at(u, v) - base);
        }
    EXPECT_GT(ratio_sum / (160 * 120), 10.0) << "the usual texture is strong";
    Studio sky("sky?width=160&height=120");
    sky.shoot();
    for (int u = 0; u < 160; ++u) {
        EXPECT_EQ(sky.left.at(u, 10), 255);
        EXPECT_EQ(sky.right.at(u, 10), 255);
    }
    EXPECT_LT(sky.left.at(80, 115), 250) << "the ground is not saturated";
}

TEST(SynthPicture, TheSunStandsOnTheLeft) {
    Scene scene = scene_by_name("plane?contrast=0&pitch_deg=20&width=320&height=240");
    Studio bare(scene);
    scene.things = {{Shape::kBox, -0.6, 3.0, 0.0, 0.3, 0.3, 0.5, {100, 100, 100}},
                    {Shape::kPole, 0.6, 3.0, 0.0, 0.1, 0.1, 1.0, {100, 100, 100}}};
    Studio lit(scene);
    bare.shoot();
    lit.shoot();
    struct Pixel {
        int u, v;
    };
    const auto pixel_of = [&](double x, double height, double z) -> Pixel {
        const double sin_pitch = std::sin(scene.mount.pitch_rad), cos_pitch = std::cos(scene.mount.pitch_rad);
        const double scale = scene.rig.focal_px / (sin_pitch * (1.0 - height) + cos_pitch * z);
        const double down = cos_pitch * (1.0 - height) - sin_pitch * z;
        return {static_cast<int>(scene.rig.cx_px + x * scale + 0.5),
                static_cast<int>(scene.rig.cy_px + down * scale + 0.5)};
    };
    // Brightness of the ground at a point of it, with things over without.
    const auto share = [&](double x, double z) {
        const auto [u, v] = pixel_of(x, 0.0, z);
        EXPECT_NEAR(lit.truth.height_m.at(u, v), 0.0, 1e-9) << "not the ground";
        return static_cast<double>(lit.left.at(u, v)) / bare.left.at(u, v);
    };
    EXPECT_EQ(share(-1.1, 3.0), 1.0) << "on the sunny side of the box";
    EXPECT_LT(share(-0.15, 3.1), 0.6) << "in its shadow, which is 0.3 m long and falls to the right";
    EXPECT_GT(share(-0.15, 3.1), 0.3) << "but not black";
    EXPECT_EQ(share(0.1, 3.1), 1.0) << "behind its end";
    const auto level = [&](double x) {
        const auto [u, v] = pixel_of(x, 0.5, 2.93);
        EXPECT_GT(lit.truth.height_m.at(u, v), 0.4) << "not the pole";
        return static_cast<int>(lit.left.at(u, v));
    };
    EXPECT_GT(level(0.54), level(0.66) + 10);
}

TEST(SynthPicture, TextureFadesBelowThePixel) {
    const Vec3 point{0.123, 0.456, 7.89};
    EXPECT_EQ(texture(point, 0.9, 1), 0.0);
    EXPECT_EQ(texture(point, 5.0, 1), 0.0);
    EXPECT_NE(texture(point, 0.5, 1), 0.0);
    EXPECT_EQ(texture(point, 0.006, 1), texture(point, 0.0001, 1)) << "all there from half the finest cell";
    // Fading is continuous: no rings around the camera.
    for (double footprint = 0.004; footprint < 1.0; footprint *= 1.01)
        EXPECT_NEAR(texture(point, footprint, 1), texture(point, footprint * 1.0001, 1), 2e-4) << footprint;
    EXPECT_NE(texture(point, 0.001, 1), texture(point, 0.001, 2));
}

TEST(SynthPicture, ValueNoiseIsSmoothAndBounded) {
    double least = 1.0, most = -1.0;
    for (int i = 0; i < 20000; ++i) {
        const double x = -3.0 + i * 3.1e-4;
        const double here = value_noise({x, 0.3, -0.7}, 0.25, 9);
        EXPECT_NEAR(here, value_noise({x + 1e-7, 0.3, -0.7}, 0.25, 9), 3e-6);
        least = std::min(least, here);
        most = std::max(most, here);
    }
    EXPECT_GE(least, -1.0);
    EXPECT_LE(most, 1.0);
    EXPECT_LT(least, -0.3);
    EXPECT_GT(most, 0.3);
}

}  // namespace
}  // namespace groundline::synth
