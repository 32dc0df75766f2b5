// What must never be trusted, from the first frame on, through all stages; and what must not be suspected.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "pipeline/processor.hpp"
#include "synth/renderer.hpp"

namespace groundline::pipeline {
namespace {

rig::StereoCalibration calibration_of(const RectifiedRig& rig) {
    rig::StereoCalibration calibration;
    calibration.rectified = true;
    for (rig::CameraModel* camera : {&calibration.left, &calibration.right}) {
        camera->width = rig.width;
        camera->height = rig.height;
        camera->fx = camera->fy = rig.focal_px;
        camera->cy = rig.cy_px;
    }
    calibration.left.cx = rig.cx_px;
    calibration.right.cx = rig.cx_right_px;
    calibration.translation_m = {-rig.baseline_m, 0.0, 0.0};
    return calibration;
}

// One pair of a scene. Rendering takes longer than all stages, so a pair is shown to all matchers.
class Shot {
  public:
    explicit Shot(const synth::Scene& scene, std::int64_t frame = 0)
        : rig(scene.rig), pair(StereoFrame::make(arena_, scene.rig.width, scene.rig.height, false)) {
        Serial serial;
        synth::Renderer(scene).render(frame, serial, pair.left, {}, pair.right);
    }

  private:
    Arena arena_;

  public:
    RectifiedRig rig;
    StereoFrame pair;
};

constexpr std::array kMatchers = {stereo::MatcherKind::kCensusPyramid, stereo::MatcherKind::kCensus,
                                  stereo::MatcherKind::kPaper};

// A processor for the cameras of a shot, which it is shown.
class Bench {
  public:
    explicit Bench(
        const Shot& shot, stereo::MatcherKind matcher = stereo::MatcherKind::kCensusPyramid,
        const std::function<void(ProcessorConfig&)>& change = [](ProcessorConfig&) {})
        : rectifier_(calibration_of(shot.rig), shot.rig.width, shot.rig.height, arena_) {
        ProcessorConfig config;
        config.matcher.kind = matcher;
        config.matcher.disparities = 64;
        config.matcher.normalise_local_mean = matcher == stereo::MatcherKind::kPaper;
        config.limits.photometric = verdict::kLocalOrder;
        change(config);
        processor_.emplace(config, rectifier_, serial_, arena_);
        result_ = processor_->make_result(arena_);
        frame_ = StereoFrame::make(arena_, shot.rig.width, shot.rig.height, false);
        show(shot);
    }
    void show(const Shot& shot) {
        copy_pixels<std::uint8_t>(shot.pair.left, frame_.left);
        copy_pixels<std::uint8_t>(shot.pair.right, frame_.right);
    }
    const FrameResult& process() {
        processor_->process(frame_, result_);
        frame_.stamp.exposure_mono_ns += 33'000'000;
        return result_;
    }
    StereoFrame& frame() { return frame_; }

  private:
    Arena arena_;
    Serial serial_;
    rig::Rectifier rectifier_;
    std::optional<Processor> processor_;
    FrameResult result_;
    StereoFrame frame_;
};

std::string names(Reasons reasons) {
    std::string text;
    for (int i = 0; i < kReasons; ++i)
        if (reasons.has(static_cast<Reason>(i)))
            text += std::string(kReasonNames.at(static_cast<std::size_t>(i))) + ' ';
    return text;
}

void fill_noise(Luma image, std::uint32_t seed) {
    std::mt19937 random(seed);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            image.at(x, y) = static_cast<std::uint8_t>(random() % 256);
}

void exchange(StereoFrame& frame) {
    for (int y = 0; y < frame.left.height; ++y)
        std::swap_ranges(frame.left.row(y), frame.left.row(y) + frame.left.width, frame.right.row(y));
}

// Rows of the right view `rows` down.
void move_down(StereoFrame& frame, int rows) {
    for (int y = frame.right.height - 1; y >= 0; --y)
        std::copy_n(frame.right.row(std::max(0, y - rows)), frame.right.width, frame.right.row(y));
}

void blur(Luma image) {
    // Twice a box of 5: like a Gaussian of sigma 2.
    for (int round = 0; round < 2; ++round)
        for (const bool across : {false, true})
            for (int line = 0; line < (across ? image.width : image.height); ++line) {
                const int length = across ? image.height : image.width;
                std::vector<int> before(static_cast<std::size_t>(length));
                const auto pixel = [&](int at) -> std::uint8_t& {
                    return across ? image.at(line, at) : image.at(at, line);
                };
                for (int at = 0; at < length; ++at)
                    before[static_cast<std::size_t>(at)] = pixel(at);
                for (int at = 0; at < length; ++at) {
                    int sum = 0;
                    for (int i = -2; i <= 2; ++i)
                        sum += before[static_cast<std::size_t>(std::clamp(at + i, 0, length - 1))];
                    pixel(at) = static_cast<std::uint8_t>((sum + 2) / 5);
                }
            }
}

synth::Scene scene_of(const char* name) {
    return synth::scene_by_name(name);
}

// A level camera 1 m above the ground sees the floor from 2.08 m on.
synth::Scene wall_at(double range_m, double yaw_deg = 0.0) {
    synth::Scene scene = scene_of("plane");
    scene.mount.pitch_rad = 0.0;
    synth::Thing wall;
    wall.z_m = range_m;
    wall.yaw_rad = yaw_deg * 3.14159265358979 / 180.0;
    wall.half_x_m = 30.0;
    wall.half_z_m = 0.05;
    wall.height_m = 20.0;
    wall.colour = {120.0, 120.0, 120.0};
    scene.things.push_back(wall);
    return scene;
}

synth::Scene sky_alone() {
    synth::Scene scene = scene_of("plane");
    scene.mount.pitch_rad = -0.7;
    return scene;
}

struct Case {
    const char* what;
    synth::Scene scene;
    std::function<void(StereoFrame&)> change;
    std::optional<Reason> reason;  // one that must be given
    Verdict most;
};

TEST(Guards, NeverTrustsWhatIsNoPictureOfGround) {
    const auto as_it_is = [](StereoFrame&) {};
    const auto all = [](int left, int right) {
        return [=](StereoFrame& frame) {
            fill_pixels(frame.left, static_cast<std::uint8_t>(left));
            fill_pixels(frame.right, static_cast<std::uint8_t>(right));
        };
    };
    const auto noise = [](StereoFrame& frame) {
        fill_noise(frame.left, 1);
        fill_noise(frame.right, 2);
    };
    const auto twice = [](StereoFrame& frame) { copy_pixels<std::uint8_t>(frame.left, frame.right); };
    const auto twice_with_noise = [](StereoFrame& frame) {
        std::mt19937 random(3);
        for (int y = 0; y < frame.left.height; ++y)
            for (int x = 0; x < frame.left.width; ++x)
                frame.right.at(x, y) = static_cast<std::uint8_t>(
                    std::clamp<int>(frame.left.at(x, y) + static_cast<int>(random() % 5) - 2, 0, 255));
    };
    const synth::Scene boxes = scene_of("boxes");
    const Case cases[] = {
        {"black", boxes, all(0, 0), Reason::kDark, Verdict::kBlind},
        {"white", boxes, all(255, 255), Reason::kOverexposed, Verdict::kBlind},
        {"grey", boxes, all(100, 101), Reason::kDark, Verdict::kBlind},
        {"noise", boxes, noise, {}, Verdict::kBlind},
        {"left twice", boxes, twice, Reason::kIdentical, Verdict::kBlind},
        {"left twice, with noise", boxes, twice_with_noise, {}, Verdict::kBlind},
        {"sky alone", sky_alone(), as_it_is, Reason::kNoGround, Verdict::kBlind},
        {"wall alone", wall_at(1.2), as_it_is, Reason::kWall, Verdict::kBlind},
        {"wall alone, nearer than the search range", wall_at(0.9), as_it_is, Reason::kBlockedView,
         Verdict::kBlind},
        {"wall alone, 30 deg", wall_at(1.5, 30.0), as_it_is, Reason::kWall, Verdict::kBlind},
        {"wall alone, -45 deg", wall_at(1.5, -45.0), as_it_is, Reason::kWall, Verdict::kBlind},
        {"wall and 10 rows of floor", wall_at(2.2), as_it_is, Reason::kWall, Verdict::kBlind},
        {"exchanged", boxes, exchange, Reason::kSwapped, Verdict::kBlind},
        {"exchanged, rolled", scene_of("boxes?roll_deg=8"), exchange, Reason::kSwapped, Verdict::kBlind},
        {"exchanged, wall", scene_of("wall"), exchange, Reason::kSwapped, Verdict::kBlind},
        {"exchanged, waves", scene_of("undulating"), exchange, Reason::kSwapped, Verdict::kBlind},
        {"exchanged, white sky", scene_of("sky"), exchange, Reason::kSwapped, Verdict::kBlind},
        {"exchanged, little texture", scene_of("low_texture"), exchange, Reason::kSwapped, Verdict::kBlind},
        {"dark", scene_of("dark"), as_it_is, Reason::kDark, Verdict::kDegraded},
        {"overexposed", scene_of("boxes?exposure=6"), as_it_is, Reason::kOverexposed, Verdict::kDegraded},
        {"rows off by one", boxes, [](StereoFrame& f) { move_down(f, 1); }, Reason::kEpipolar,
         Verdict::kDegraded},
        {"rows off by three", boxes, [](StereoFrame& f) { move_down(f, 3); }, Reason::kEpipolar,
         Verdict::kDegraded},
        {"rows off by six", boxes, [](StereoFrame& f) { move_down(f, 6); }, {}, Verdict::kDegraded},
        {"right blurred", boxes, [](StereoFrame& f) { blur(f.right); }, Reason::kBlurred, Verdict::kDegraded},
        {"left blurred", boxes, [](StereoFrame& f) { blur(f.left); }, Reason::kBlurred, Verdict::kDegraded},
        {"late", boxes, [](StereoFrame& f) { f.stamp.skew_ns = 5'000'000; }, Reason::kUnsynchronised,
         Verdict::kDegraded},
    };
    for (const Case& each : cases) {
        Shot shot(each.scene);
        each.change(shot.pair);
        for (const stereo::MatcherKind matcher : kMatchers) {
            SCOPED_TRACE(std::string(each.what) + ", matcher " + std::to_string(static_cast<int>(matcher)));
            Bench bench(shot, matcher);
            bench.frame().stamp = shot.pair.stamp;
            const FrameResult& result = bench.process();
            EXPECT_LE(result.verdict, each.most) << names(result.reasons);
            if (each.reason) {
                EXPECT_TRUE(result.reasons.has(*each.reason)) << names(result.reasons);
            }
            if (result.verdict != Verdict::kBlind) continue;
            EXPECT_EQ(result.share[0], 1.0) << "blind, and yet something is known";
        }
    }
}

TEST(Guards, SuspectsNoGoodPair) {
    for (const char* name : {"plane", "boxes", "wall", "clutter", "undulating", "sky", "mismatch", "drive",
                             "boxes?roll_deg=8", "boxes?pitch_deg=20", "boxes?gain=1.4", "boxes?noise=5",
                             "boxes?exposure=1.8", "boxes?camera_height_m=0.6"}) {
        const Shot shot(scene_of(name));
        for (const stereo::MatcherKind matcher : kMatchers) {
            Bench bench(shot, matcher);
            const FrameResult& result = bench.process();
            for (const Reason reason :
                 {Reason::kSwapped, Reason::kIdentical, Reason::kFrozen, Reason::kEpipolar, Reason::kBlurred,
                  Reason::kDark, Reason::kOverexposed, Reason::kPhotometric})
                EXPECT_FALSE(result.reasons.has(reason)) << name << ": " << names(result.reasons);
            // A white sky of half the picture is no fault of the ground below.
            if (std::string_view(name) == "sky") {
                EXPECT_EQ(result.verdict, Verdict::kTrusted) << names(result.reasons);
            }
        }
    }
}

// A yawed wall beside the robot leaves floor to be seen: that, and not the wall, is the ground.
TEST(Guards, BesideAWallTheFloorIsFound) {
    for (const double yaw_deg : {60.0, 75.0, -70.0}) {
        Bench bench{Shot(wall_at(1.6, yaw_deg))};
        const FrameResult& result = bench.process();
        if (!result.ground.found) continue;
        EXPECT_NEAR(result.ground.pose.height_m, 1.0, 0.05) << yaw_deg;
        EXPECT_NEAR(result.ground.pose.pitch_rad, 0.0, 0.03) << yaw_deg;
        EXPECT_NEAR(result.ground.pose.roll_rad, 0.0, 0.03) << yaw_deg;
    }
}

TEST(Guards, AFrozenCameraIsBlindAtItsThirdPicture) {
    const synth::Scene drive = scene_of("drive?frames=2");
    Bench bench(Shot(drive), stereo::MatcherKind::kCensusPyramid,
                [](ProcessorConfig& config) { config.live = true; });
    for (const bool frozen : {false, false, true, true}) {
        const FrameResult& result = bench.process();
        EXPECT_EQ(result.reasons.has(Reason::kFrozen), frozen);
        EXPECT_EQ(result.verdict, frozen ? Verdict::kBlind : Verdict::kTrusted) << names(result.reasons);
    }
    bench.show(Shot(drive, 1));
    const FrameResult& alive = bench.process();
    EXPECT_FALSE(alive.reasons.has(Reason::kFrozen));
    EXPECT_NE(alive.verdict, Verdict::kBlind) << names(alive.reasons);
}

TEST(Guards, AFileThatRepeatsAPictureIsNotFrozen) {
    Bench bench{Shot(scene_of("plane"))};
    for (int frame = 0; frame < 5; ++frame)
        EXPECT_EQ(bench.process().verdict, Verdict::kTrusted);
}

TEST(Guards, AnAttitudeVouchesForAStep) {
    const Shot level(scene_of("plane"));
    const Shot tilted(scene_of("plane?pitch_deg=17"));
    for (const bool witnessed : {false, true}) {
        Bench bench(level);
        bench.frame().attitude = {witnessed, 0.2, 0.0, 0.005};
        ASSERT_EQ(bench.process().verdict, Verdict::kTrusted);
        bench.show(tilted);
        bench.frame().attitude.pitch_rad += 5.0 * 3.14159265358979 / 180.0;
        const FrameResult& result = bench.process();
        EXPECT_EQ(result.reasons.has(Reason::kPoseJump), !witnessed);
        EXPECT_EQ(result.verdict, witnessed ? Verdict::kTrusted : Verdict::kDegraded);
    }
}

// --- the robot's own parts

// A bumper across the lower picture: near, textured, and where no ground can be.
constexpr int kBumperTop = 400;
void mount_bumper(StereoFrame& frame) {
    std::mt19937 random(5);
    constexpr int kDisparity = 58;
    for (int y = kBumperTop; y < frame.left.height; ++y) {
        std::vector<std::uint8_t> paint(static_cast<std::size_t>(frame.left.width + kDisparity));
        for (std::uint8_t& grey : paint)
            grey = static_cast<std::uint8_t>(40 + random() % 100);
        std::copy_n(paint.begin(), frame.left.width, frame.left.row(y));
        std::copy_n(paint.begin() + kDisparity, frame.left.width, frame.right.row(y));
    }
}

struct Body {
    Arena arena;
    ImageView<std::uint8_t> mask = arena.image<std::uint8_t>(640, 480);
    Body() {
        for (int y = kBumperTop; y < 480; ++y)
            std::fill_n(mask.row(y), 640, std::uint8_t{255});
    }
};

TEST(Guards, TheRobotsOwnBumperIsNoObstacle) {
    const Body body;
    Shot shot(scene_of("plane"));
    mount_bumper(shot.pair);
    for (const stereo::MatcherKind matcher : kMatchers) {
        SCOPED_TRACE(static_cast<int>(matcher));
        Bench open(shot, matcher);
        const FrameResult& suspected = open.process();
        std::int64_t seen = 0;
        for (int y = kBumperTop; y < 480; ++y)
            seen += std::count(suspected.mask.row(y), suspected.mask.row(y) + 640, TerrainClass::kObstacle);
        ASSERT_GT(seen, 10000) << "without the mask it is one, or the test shows nothing";

        Bench masked(shot, matcher, [&](ProcessorConfig& config) { config.body = body.mask; });
        const FrameResult& result = masked.process();
        EXPECT_EQ(result.verdict, Verdict::kTrusted) << names(result.reasons);
        EXPECT_NEAR(result.ground.pose.height_m, 1.0, 0.02);
        for (const Obstacle& obstacle : result.obstacles)
            EXPECT_LT(obstacle.bottom, kBumperTop - 50) << "something at the bumper's edge";
        for (int y = 0; y < 480; ++y)
            for (int x = 0; x < 640; ++x) {
                const bool excluded = y >= kBumperTop - stereo::kWindowReach;
                ASSERT_EQ(result.disparity.invalid.at(x, y) == Invalid::kBody, excluded) << x << ' ' << y;
                if (!excluded) continue;
                ASSERT_EQ(result.mask.at(x, y), TerrainClass::kUnknown);
                ASSERT_EQ(result.disparity.disparity_q4.at(x, y), 0);
            }
    }
}

// Nor does its mask take anything from the rest of the picture.
TEST(Guards, ABodyMaskChangesNothingElsewhere) {
    Body body;
    fill_pixels(body.mask, std::uint8_t{0});
    for (int y = 430; y < 480; ++y)
        std::fill_n(body.mask.row(y), 60, std::uint8_t{1});
    const Shot shot(scene_of("boxes"));
    Bench open(shot);
    Bench masked(shot, stereo::MatcherKind::kCensusPyramid,
                 [&](ProcessorConfig& config) { config.body = body.mask; });
    const FrameResult& without = open.process();
    const FrameResult& with = masked.process();
    EXPECT_EQ(with.verdict, without.verdict);
    for (int y = 0; y < 480; ++y)
        for (int x = 0; x < 640; ++x) {
            if (with.disparity.invalid.at(x, y) == Invalid::kBody) continue;
            ASSERT_EQ(with.disparity.invalid.at(x, y), without.disparity.invalid.at(x, y));
            ASSERT_EQ(with.disparity.disparity_q4.at(x, y), without.disparity.disparity_q4.at(x, y));
        }
}

}  // namespace
}  // namespace groundline::pipeline
