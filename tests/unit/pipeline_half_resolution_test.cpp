// Pairs looked at at half the resolution: the same world, coarser, in the terms of the whole picture; and
// what changes of resolution do to state, bytes and memory.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "core/error.hpp"
#include "pipeline/processor.hpp"
#include "pipeline/worker_pool.hpp"
#include "support/allocation_count.hpp"
#include "support/random_images.hpp"
#include "synth/renderer.hpp"

namespace groundline::pipeline {
namespace {

using verdict::HalfResolution;

rig::StereoCalibration calibration_of(const RectifiedRig& rig) {
    rig::StereoCalibration calibration;
    calibration.rectified = true;
    for (rig::CameraModel* camera : {&calibration.left, &calibration.right}) {
        camera->width = rig.width;
        camera->height = rig.height;
        camera->fx = camera->fy = rig.focal_px;
        camera->cx = rig.cx_px;
        camera->cy = rig.cy_px;
    }
    calibration.translation_m = {-rig.baseline_m, 0.0, 0.0};
    return calibration;
}

// Rendered pairs of one rig, 33 ms apart, and a processor for them.
class Look {
  public:
    Look(const RectifiedRig& rig, HalfResolution half, Parallel& parallel)
        : parallel_(parallel),
          rectifier_(calibration_of(rig), rig.width, rig.height, arena_),
          processor_(config_of(rig, half), rectifier_, parallel, arena_),
          result_(processor_.make_result(arena_)),
          frame_(StereoFrame::make(arena_, rig.width, rig.height, false)) {
        arena_.seal();
    }
    const FrameResult& look(const synth::Renderer& renderer, std::int64_t frame, FrameMode mode) {
        renderer.render(frame, parallel_, frame_.left, {}, frame_.right);
        return look_again(mode);
    }
    const FrameResult& look(const StereoFrame& pictures, FrameMode mode) {
        copy_pixels<std::uint8_t>(pictures.left, frame_.left);
        copy_pixels<std::uint8_t>(pictures.right, frame_.right);
        return look_again(mode);
    }
    // At the pictures that are there already.
    const FrameResult& look_again(FrameMode mode) {
        frame_.mode = mode;
        ++frame_.stamp.sequence;
        frame_.stamp.exposure_mono_ns += 33'000'000;
        processor_.process(frame_, result_);
        return result_;
    }
    StereoFrame& frame() { return frame_; }
    Processor& processor() { return processor_; }

  private:
    static ProcessorConfig config_of(const RectifiedRig& rig, HalfResolution half) {
        ProcessorConfig config;
        config.matcher.disparities = (rig.width / 6 + 15) / 16 * 16;
        config.grid.on = true;
        config.half_resolution = half;
        return config;
    }

    Parallel& parallel_;
    Arena arena_;
    rig::Rectifier rectifier_;
    Processor processor_;
    FrameResult result_;
    StereoFrame frame_;
};

synth::Renderer scene(const std::string& spec) {
    return synth::Renderer{synth::scene_by_name("synthetic:" + spec)};
}

class Hash {
  public:
    void add(double value) { add(std::bit_cast<std::uint64_t>(value)); }
    template <typename Whole>
    requires std::is_integral_v<Whole>
    void add(Whole value) { hash_ = (hash_ ^ static_cast<std::uint64_t>(value)) * 1099511628211ULL; }
    template <typename T>
    void add(const ImageView<T>& image) {
        for (int y = 0; y < image.height; ++y)
            for (int x = 0; x < image.width; ++x)
                add(static_cast<std::int64_t>(image.at(x, y)));
    }
    std::uint64_t value() const { return hash_; }

  private:
    std::uint64_t hash_ = 1469598103934665603ULL;
};

std::uint64_t mask_hash(const FrameResult& result) {
    Hash hash;
    hash.add(result.mask);
    hash.add(result.disparity.disparity_q4);
    hash.add(result.disparity.invalid);
    return hash.value();
}

std::uint64_t whole_hash(const FrameResult& result) {
    Hash hash;
    hash.add(mask_hash(result));
    hash.add(result.v_disparity.histogram);
    hash.add(static_cast<int>(result.verdict));
    hash.add(result.reasons.bits());
    for (const double value :
         {result.ground.plane.du, result.ground.plane.dv, result.ground.plane.d0, result.ground.covariance[8],
          result.ground.pose.pitch_rad, result.ground.sigma.height_m, result.range_limit_m, result.share[1]})
        hash.add(value);
    for (const Obstacle& obstacle : result.obstacles) {
        hash.add(obstacle.left);
        hash.add(obstacle.pixels);
        hash.add(obstacle.range_m);
        hash.add(obstacle.disparity_px);
    }
    for (const Sector& sector : result.sectors) {
        hash.add(static_cast<int>(sector.held));
        hash.add(sector.nearest_m);
        hash.add(sector.free_range_m);
    }
    for (const GridCell& cell : result.grid.cells) {
        hash.add(static_cast<int>(cell.kind));
        hash.add(cell.points);
    }
    return hash.value();
}

double degrees(double radians) {
    return radians * 57.29577951308232;
}

TEST(HalfResolution, ShowsTheSameGroundAndTheSameThings) {
    Serial serial;
    for (const char* spec : {"boxes?seed=3", "boxes?seed=2&roll_deg=5"}) {
        SCOPED_TRACE(spec);
        const synth::Renderer renderer = scene(spec);
        Look whole(renderer.scene().rig, HalfResolution::kNever, serial);
        Look half(renderer.scene().rig, HalfResolution::kAlways, serial);
        const FrameResult& fine = whole.look(renderer, 0, FrameMode::kFull);
        const FrameResult& coarse = half.look(renderer, 0, FrameMode::kFull);
        ASSERT_EQ(fine.verdict, Verdict::kTrusted);
        ASSERT_TRUE(coarse.ground.found && coarse.ground.metric);
        EXPECT_EQ(coarse.rig.width, fine.rig.width);
        EXPECT_EQ(coarse.rig.focal_px, fine.rig.focal_px);

        const GroundPose truth = pose_of(renderer.plane(0), renderer.scene().rig);
        EXPECT_NEAR(degrees(coarse.ground.pose.pitch_rad), degrees(truth.pitch_rad), 0.4);
        EXPECT_NEAR(degrees(coarse.ground.pose.roll_rad), degrees(truth.roll_rad), 0.3);
        EXPECT_NEAR(coarse.ground.pose.height_m, truth.height_m, 0.015 * truth.height_m);
        const GroundPose told = pose_of(coarse.ground.plane, coarse.rig);
        EXPECT_NEAR(told.pitch_rad, coarse.ground.pose.pitch_rad, 1e-9) << "plane and pose say the same";
        EXPECT_NEAR(told.height_m, coarse.ground.pose.height_m, 1e-9);

        // Of a disparity's deviation, which is twice as large.
        EXPECT_GT(coarse.range_limit_m, 0.45 * fine.range_limit_m);
        EXPECT_LT(coarse.range_limit_m, 0.6 * fine.range_limit_m);

        int found = 0;
        for (const Obstacle& seen : fine.obstacles) {
            if (seen.overhang || seen.range_m > coarse.range_limit_m || seen.pixels < 2000) continue;
            const auto same =
                std::find_if(coarse.obstacles.begin(), coarse.obstacles.end(), [&](const Obstacle& other) {
                    return std::abs(other.left - seen.left) <= 16 &&
                           std::abs(other.right - seen.right) <= 16 &&
                           std::fabs(other.range_m - seen.range_m) <= 3.0 * other.range_sigma_m;
                });
            EXPECT_NE(same, coarse.obstacles.end()) << "at " << seen.range_m << " m, column " << seen.left;
            if (same == coarse.obstacles.end()) continue;
            ++found;
            EXPECT_NEAR(same->left_rad, seen.left_rad, 16.0 / fine.rig.focal_px);
            EXPECT_NEAR(same->disparity_px, seen.disparity_px, 1.5);
            EXPECT_NEAR(static_cast<double>(same->pixels) / seen.pixels, 1.0, 0.25);
            EXPECT_NEAR(same->range_sigma_m / seen.range_sigma_m, 2.0, 0.3);
        }
        EXPECT_GT(found, 0);

        ASSERT_EQ(coarse.sectors.size(), fine.sectors.size());
        for (std::size_t i = 0; i < fine.sectors.size(); ++i) {
            EXPECT_EQ(coarse.sectors[i].bearing_rad, fine.sectors[i].bearing_rad);
            if (!fine.sectors[i].blocked || fine.sectors[i].kind != TerrainClass::kObstacle ||
                fine.sectors[i].nearest_m > coarse.range_limit_m)
                continue;
            EXPECT_TRUE(coarse.sectors[i].blocked) << "sector " << i;
            EXPECT_LT(coarse.sectors[i].free_range_m,
                      fine.sectors[i].nearest_m + 3.0 * coarse.sectors[i].nearest_sigma_m)
                << "sector " << i;
        }
    }
}

// What is about the matcher stays, whose window has as many px at any size: less would show as free what is
// unknown. What is about far things is scaled.
TEST(HalfResolution, ScalesTheLimitsThatAreAboutTheWorld) {
    StagesConfig whole;
    whole.matcher.min_disparity = -6;
    whole.matcher.disparities = 96;
    whole.matcher.limits.speckle_px = 90;
    whole.terrain.gap_px = 7;
    whole.terrain.blur_px = 5;
    whole.terrain.blur_beyond_px = 9;
    whole.terrain.min_pixels = 11;
    struct Row {
        int whole, half;
    };
    // Rounded up, never below min_pixels, never raised.
    for (const Row row : {Row{400, 100}, Row{61, 16}, Row{60, 15}, Row{40, 11}, Row{11, 11}, Row{8, 8}}) {
        whole.terrain.min_pixels_far = row.whole;
        const StagesConfig half = halved(whole);
        EXPECT_EQ(half.terrain.min_pixels_far, row.half) << row.whole;
        EXPECT_EQ(half.terrain.min_pixels, 11);
        EXPECT_EQ(half.terrain.gap_px, 7);
        EXPECT_EQ(half.terrain.blur_px, 5);
        EXPECT_EQ(half.terrain.blur_beyond_px, 9);
        EXPECT_EQ(half.terrain.sigma_disparity_px, whole.terrain.sigma_disparity_px);
        EXPECT_EQ(half.terrain.min_area_m2, whole.terrain.min_area_m2);
        EXPECT_EQ(half.matcher.limits.speckle_px, 90);
        EXPECT_EQ(half.matcher.limits.left_right_px, whole.matcher.limits.left_right_px);
        EXPECT_EQ(half.matcher.min_disparity, -3);
        EXPECT_EQ(half.matcher.disparities, 48);
        EXPECT_EQ(half.matcher.kind, stereo::MatcherKind::kCensus);
    }
}

// Of what stands at least a quarter of a metre high and both cameras see.
TEST(HalfResolution, ShowsNoObstacleAsFree) {
    Serial serial;
    std::int64_t pixels = 0;
    std::int64_t found = 0;
    std::int64_t free = 0;
    for (const char* spec : {"boxes?seed=5", "plane?seed=5&rocks=20", "clutter?seed=5",
                             "boxes?seed=5&undulation_m=0.1&undulation_length_m=8&noise=4"}) {
        const synth::Renderer renderer = scene(spec);
        const RectifiedRig& rig = renderer.scene().rig;
        Look half(rig, HalfResolution::kAlways, serial);
        const FrameResult& result = half.look(renderer, 0, FrameMode::kFull);
        Arena arena;
        const synth::Truth truth = synth::Truth::make(arena, rig.width, rig.height);
        renderer.render_truth(0, serial, 0.25, truth);
        std::int64_t free_here = 0;
        for (int y = 0; y < rig.height; ++y)
            for (int x = 0; x < rig.width; ++x) {
                if (truth.terrain.at(x, y) != TerrainClass::kObstacle || truth.occluded.at(x, y) != 0)
                    continue;
                ++pixels;
                found += result.mask.at(x, y) == TerrainClass::kObstacle ? 1 : 0;
                free_here += result.mask.at(x, y) == TerrainClass::kTraversable ? 1 : 0;
            }
        free += free_here;
        EXPECT_LE(free_here, 20) << spec;
    }
    EXPECT_GT(pixels, 50'000);
    EXPECT_GT(static_cast<double>(found), 0.85 * static_cast<double>(pixels));
    EXPECT_LT(static_cast<double>(free), 1e-4 * static_cast<double>(pixels));
}

TEST(HalfResolution, EveryMaskSaysIt) {
    Serial serial;
    const synth::Renderer renderer = scene("boxes?seed=3&width=320&height=240");
    const RectifiedRig& rig = renderer.scene().rig;
    Look can(rig, HalfResolution::kWhenOverloaded, serial);
    EXPECT_TRUE(can.processor().may_halve());
    const FrameResult& result = can.look(renderer, 0, FrameMode::kFull);
    EXPECT_FALSE(result.reasons.has(Reason::kHalfResolution));
    EXPECT_FALSE(result.reasons.has(Reason::kOverload));
    EXPECT_EQ(result.verdict, Verdict::kTrusted);
    can.look_again(FrameMode::kHalfResolution);
    EXPECT_TRUE(result.reasons.has(Reason::kHalfResolution));
    EXPECT_TRUE(result.reasons.has(Reason::kOverload));
    EXPECT_EQ(result.verdict, Verdict::kDegraded);
    const std::uint64_t asked_for = mask_hash(result);

    Look always(rig, HalfResolution::kAlways, serial);
    EXPECT_FALSE(always.processor().may_halve()) << "overload has no say";
    const FrameResult& set = always.look(renderer, 0, FrameMode::kFull);
    EXPECT_TRUE(set.reasons.has(Reason::kHalfResolution));
    EXPECT_FALSE(set.reasons.has(Reason::kOverload));
    EXPECT_EQ(set.verdict, Verdict::kDegraded);
    EXPECT_EQ(mask_hash(set), asked_for);

    Look never(rig, HalfResolution::kNever, serial);
    EXPECT_FALSE(never.processor().may_halve());
    const FrameResult& whole = never.look(renderer, 0, FrameMode::kHalfResolution);
    EXPECT_FALSE(whole.reasons.has(Reason::kHalfResolution));
    EXPECT_TRUE(whole.reasons.has(Reason::kOverload));
}

// Every frame's bytes are a function of pairs and modes, for any number of threads; and a whole frame's mask
// is what it is without any half one before.
TEST(HalfResolution, TheSameModesGiveTheSameBytes) {
    using enum FrameMode;
    const std::vector<FrameMode> modes = {kFull,           kFull,           kHalfResolution,
                                          kHalfResolution, kFull,           kHalfResolution,
                                          kSkipping,       kHalfResolution, kFull};
    const synth::Renderer renderer = scene("drive?seed=2&width=320&height=240");
    Arena arena;
    Serial serial;
    std::vector<StereoFrame> frames;
    for (std::size_t i = 0; i < modes.size(); ++i) {
        frames.push_back(StereoFrame::make(arena, 320, 240, false));
        renderer.render(static_cast<std::int64_t>(i), serial, frames[i].left, {}, frames[i].right);
    }
    std::vector<std::uint64_t> first;
    for (const int threads : {1, 2, 3}) {
        WorkerPool pool(threads);
        Look run(renderer.scene().rig, HalfResolution::kWhenOverloaded, pool);
        std::vector<std::uint64_t> hashes;
        for (std::size_t i = 0; i < modes.size(); ++i)
            hashes.push_back(whole_hash(run.look(frames[i], modes[i])));
        if (first.empty()) first = hashes;
        EXPECT_EQ(hashes, first) << threads << " threads";
    }
    Look mixed(renderer.scene().rig, HalfResolution::kWhenOverloaded, serial);
    Look whole(renderer.scene().rig, HalfResolution::kNever, serial);
    for (std::size_t i = 0; i < modes.size(); ++i) {
        const std::uint64_t one = mask_hash(mixed.look(frames[i], modes[i]));
        const std::uint64_t other = mask_hash(whole.look(frames[i], modes[i]));
        EXPECT_EQ(one == other, modes[i] != kHalfResolution) << i;
    }
}

// What is remembered is metric, so it holds at either resolution; masks remember nothing.
TEST(HalfResolution, StateGoesOnAcrossAChange) {
    using enum FrameMode;
    Serial serial;
    const synth::Renderer boxes = scene("boxes?seed=3&width=320&height=240");
    const synth::Renderer plane = scene("plane?seed=3&width=320&height=240");
    for (const FrameMode before : {kFull, kHalfResolution})
        for (const FrameMode after : {kFull, kHalfResolution}) {
            SCOPED_TRACE(testing::Message() << static_cast<int>(before) << static_cast<int>(after));
            Look run(boxes.scene().rig, HalfResolution::kWhenOverloaded, serial);
            Look fresh(boxes.scene().rig, HalfResolution::kWhenOverloaded, serial);
            const FrameResult& result = run.look(boxes, 0, before);
            std::vector<double> blocked;
            for (const Sector& sector : result.sectors)
                blocked.push_back(sector.kind == TerrainClass::kObstacle ? sector.nearest_m : 0.0);
            ASSERT_GT(std::count_if(blocked.begin(), blocked.end(), [](double m) { return m > 0.0; }), 0);

            run.look(plane, 0, after);
            for (std::size_t i = 0; i < blocked.size(); ++i) {
                if (blocked[i] <= 0.0) continue;
                EXPECT_TRUE(result.sectors[i].held) << i;
                EXPECT_EQ(result.sectors[i].nearest_m, blocked[i]);
                EXPECT_LE(result.sectors[i].free_range_m, blocked[i]);
            }
            EXPECT_EQ(mask_hash(result), mask_hash(fresh.look(plane, 0, after)));

            // A view of nothing: the ground seen last stands in.
            const Ground last = result.ground;
            fill_pixels(run.frame().left, 128);
            fill_pixels(run.frame().right, 129);
            run.look_again(before);
            EXPECT_TRUE(result.reasons.has(Reason::kHeldGround));
            EXPECT_EQ(result.ground.plane.d0, last.plane.d0);
            EXPECT_EQ(result.ground.covariance, last.covariance);
            for (int y = 0; y < result.mask.height; ++y)
                for (int x = 0; x < result.mask.width; ++x)
                    ASSERT_NE(result.mask.at(x, y), TerrainClass::kTraversable);
        }
}

TEST(HalfResolution, ChangesTakeNoMemory) {
    using enum FrameMode;
    Serial serial;
    const synth::Renderer renderer = scene("boxes?seed=3&width=320&height=240");
    Look run(renderer.scene().rig, HalfResolution::kWhenOverloaded, serial);
    run.look(renderer, 0, kFull);
    const std::uint64_t allocations = test::allocations();
    const std::uint64_t locks = test::mutex_locks();
    for (const FrameMode mode : {kHalfResolution, kFull, kHalfResolution, kHalfResolution, kSkipping, kFull})
        run.look_again(mode);
    EXPECT_EQ(test::allocations(), allocations);
    EXPECT_EQ(test::mutex_locks(), locks);
}

// Odd sizes, no calibration: 2x2 px are alike, cut off at the border, and disparities are those of the pair.
TEST(HalfResolution, IsToldInTheTermsOfTheWholePicture) {
    constexpr int kWidth = 161;
    constexpr int kHeight = 95;
    Arena arena;
    Serial serial;
    const rig::Rectifier rectifier(kWidth, kHeight);
    ProcessorConfig config;
    config.matcher.disparities = 32;
    config.half_resolution = HalfResolution::kAlways;
    Processor processor(config, rectifier, serial, arena);
    FrameResult result = processor.make_result(arena);
    StereoFrame frame = StereoFrame::make(arena, kWidth, kHeight, false);
    const auto pair = test::shifted_pair(kWidth, kHeight, 9, 6);
    copy_pixels<std::uint8_t>(pair.left.view(), frame.left);
    copy_pixels<std::uint8_t>(pair.right.view(), frame.right);
    processor.process(frame, result);
    int right = 0;
    std::int64_t counted = 0;
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
            const int disparity = result.disparity.disparity_q4.at(x, y);
            ASSERT_EQ(disparity, result.disparity.disparity_q4.at(x / 2 * 2, y / 2 * 2));
            ASSERT_EQ(result.disparity.invalid.at(x, y), result.disparity.invalid.at(x / 2 * 2, y / 2 * 2));
            ASSERT_EQ(result.mask.at(x, y), result.mask.at(x / 2 * 2, y / 2 * 2));
            const bool valid = result.disparity.invalid.at(x, y) == Invalid::kNone;
            right += valid && std::abs(disparity - 6 * kDisparityOne) <= 6 ? 1 : 0;
        }
    for (int y = 0; y < kHeight; ++y)
        for (int k = 6 * 4 - 2; k <= 6 * 4 + 2; ++k)
            counted += result.v_disparity.histogram.at(k, y);
    EXPECT_GT(right, kWidth * kHeight * 3 / 4);
    EXPECT_NEAR(static_cast<double>(counted) / 16.0, right, 0.1 * right)
        << "the v-disparity is that of the map";
}

TEST(HalfResolution, PicturesTooSmallForItStayWhole) {
    Arena arena;
    Serial serial;
    const rig::Rectifier rectifier(40, 40);
    ProcessorConfig config;
    config.matcher.disparities = 16;
    config.half_resolution = HalfResolution::kWhenOverloaded;
    Processor processor(config, rectifier, serial, arena);
    EXPECT_FALSE(processor.may_halve());
    FrameResult result = processor.make_result(arena);
    StereoFrame frame = StereoFrame::make(arena, 40, 40, false);
    frame.mode = FrameMode::kHalfResolution;
    processor.process(frame, result);
    EXPECT_FALSE(result.reasons.has(Reason::kHalfResolution));
    config.half_resolution = HalfResolution::kAlways;
    EXPECT_THROW(Processor(config, rectifier, serial, arena), Refusal);
}

}  // namespace
}  // namespace groundline::pipeline
