// Rendered scenes as a FrameSource: stamps, order, calibration, truth, and no allocation per frame.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "capture/synthetic.hpp"
#include "core/error.hpp"
#include "core/ground.hpp"
#include "support/allocation_count.hpp"
#include "unit/synth_support.hpp"

namespace groundline::capture {
namespace {

TEST(SyntheticSource, SaysWhatItIs) {
    const SyntheticSource source("synthetic:drive?width=64&height=48&frames=7&rate_hz=20");
    EXPECT_EQ(source.info().name, "synthetic:drive?width=64&height=48&frames=7&rate_hz=20");
    EXPECT_EQ(source.info().width, 64);
    EXPECT_EQ(source.info().height, 48);
    EXPECT_TRUE(source.info().colour);
    EXPECT_FALSE(source.info().live);
    EXPECT_EQ(source.info().length, 7);
    EXPECT_EQ(source.info().rate_hz, 20.0);
    EXPECT_TRUE(source.rig().calibrated);
    EXPECT_EQ(source.rig().focal_px, 50.0);
    EXPECT_THROW(SyntheticSource("synthetic:drove"), Refusal);
}

TEST(SyntheticSource, DeliversThePairsOfTheRendererInOrder) {
    const std::string spec = "drive?width=64&height=48&frames=3&rate_hz=8";
    const auto source = open_synthetic(spec);
    synth::test::Studio studio(spec);
    Arena arena;
    StereoFrame frame = StereoFrame::make(arena, 64, 48, true);
    for (int n = 0; n < 3; ++n) {
        ASSERT_EQ(source->next(frame), Pull::kFrame);
        EXPECT_EQ(frame.stamp.sequence, n);
        EXPECT_EQ(frame.stamp.position, n);
        EXPECT_EQ(frame.stamp.utime_us, n * 125000);
        EXPECT_EQ(frame.stamp.exposure_mono_ns, n * 125000000LL);
        EXPECT_EQ(frame.stamp.skew_ns, 0);
        EXPECT_EQ(frame.stamp.source, StampSource::kFile);
        EXPECT_EQ(frame.stamp.name_view(), "drive 00000" + std::to_string(n));
        studio.shoot(n);
        EXPECT_EQ(synth::test::hash_of(frame.left), synth::test::hash_of(studio.left));
        EXPECT_EQ(synth::test::hash_of(frame.right), synth::test::hash_of(studio.right));
        EXPECT_EQ(synth::test::hash_of(frame.left_bgr), synth::test::hash_of(studio.left_bgr));
    }
    EXPECT_EQ(source->next(frame), Pull::kEnd);
    EXPECT_EQ(source->next(frame), Pull::kEnd);
    EXPECT_EQ(source->error(), "");
}

TEST(SyntheticSource, ClockGoesOnAfterARewind) {
    SyntheticSource source("boxes?width=32&height=24&frames=2&noise=1");
    Arena arena;
    StereoFrame frame = StereoFrame::make(arena, 32, 24, true);
    ASSERT_EQ(source.next(frame), Pull::kFrame);
    const std::uint64_t first = synth::test::hash_of(frame.left);
    ASSERT_EQ(source.next(frame), Pull::kFrame);
    ASSERT_EQ(source.next(frame), Pull::kEnd);
    ASSERT_TRUE(source.rewind());
    ASSERT_EQ(source.next(frame), Pull::kFrame);
    EXPECT_EQ(frame.stamp.position, 0);
    EXPECT_EQ(frame.stamp.sequence, 2);
    EXPECT_EQ(frame.stamp.utime_us, 200000);
    EXPECT_EQ(synth::test::hash_of(frame.left), first);
}

TEST(SyntheticSource, KnowsTheTruthOfTheLastFrame) {
    const std::string spec = "drive?width=64&height=48&frames=3";
    SyntheticSource source(spec);
    synth::test::Studio studio(spec);
    Arena arena;
    StereoFrame frame = StereoFrame::make(arena, 64, 48, true);
    for (int n = 0; n < 3; ++n) {
        ASSERT_EQ(source.next(frame), Pull::kFrame);
        studio.look(n, 0.1);
        const synth::Truth& truth = source.truth(0.1);
        EXPECT_EQ(synth::test::hash_of(truth.disparity_px), synth::test::hash_of(studio.truth.disparity_px));
        EXPECT_EQ(synth::test::hash_of(truth.terrain), synth::test::hash_of(studio.truth.terrain));
    }
}

TEST(SyntheticSource, AllocatesNothingPerFrame) {
    SyntheticSource source("clutter?width=64&height=48&frames=5&noise=1");
    SyntheticSource drive("drive?width=64&height=48&frames=5");
    Arena arena;
    StereoFrame frame = StereoFrame::make(arena, 64, 48, true);
    const std::uint64_t before = test::allocations();
    for (int n = 0; n < 5; ++n) {
        source.next(frame);
        drive.next(frame);
    }
    EXPECT_EQ(test::allocations(), before);
}

}  // namespace
}  // namespace groundline::capture
