// The whole way from rendered pairs to encoded messages, by every matcher, as hashes: the same on every
// processor.
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "pipeline/processor.hpp"
#include "publish/messages.hpp"
#include "support/vector_units.hpp"
#include "synth/renderer.hpp"

namespace groundline {
namespace {

// In the order of the data flow: the first that differs says where to look.
enum class Part : std::uint8_t {
    kRendered,
    kRectified,
    kDisparity,
    kGround,
    kMask,
    kThings,
    kMessages,
    kCount
};
constexpr std::size_t kParts = static_cast<std::size_t>(Part::kCount);
constexpr std::array<const char*, kParts> kPartNames = {"rendered", "rectified", "disparity", "ground",
                                                        "mask",     "things",    "messages"};
using Hashes = std::array<std::uint64_t, kParts>;

struct Golden {
    const char* name;  // of kCases
    Hashes hashes;
};

// Written anew by GROUNDLINE_WRITE_GOLDEN=1 test_golden
constexpr Golden kGolden[] = {
#include "golden/hashes.inc"
};

// How the pairs reach the matcher.
enum class Cameras : std::uint8_t {
    kIdeal,         // rectified as they are rendered
    kUncalibrated,  // the same, and nobody says so
    kLenses,  // taken for pictures of lenses that bend, one turned a little; a part of the robot in view
};

struct Case {
    const char* name;
    const char* scene;
    int frames;
    stereo::MatcherKind matcher;
    bool normalise = false;
    Cameras cameras = Cameras::kIdeal;
    terrain::LineMode line = terrain::LineMode::kVotes;
    bool inertial = false;  // another sensor tells the attitude, 1 degree beside what is rendered
    verdict::HalfResolution half = verdict::HalfResolution::kNever;
    std::array<FrameMode, 4> modes = {};  // of the frames, in their order
};
using stereo::MatcherKind;
using verdict::HalfResolution;

// Each frame has 320x240 pixels: emulated, all of them take 40 s of a processor.
constexpr Case kCases[] = {
    {"paper", "drive?seed=5", 2, MatcherKind::kPaper},
    {"paper_local_mean", "drive?seed=5", 2, MatcherKind::kPaper, true},
    {"census", "drive?seed=5", 2, MatcherKind::kCensus},
    {"census_pyramid", "drive?seed=5", 4, MatcherKind::kCensusPyramid},
    {"clutter", "clutter", 1, MatcherKind::kCensusPyramid},
    {"ditch", "plane?ditch_m=4&roll_deg=5&noise=3", 2, MatcherKind::kCensusPyramid},
    {"waves", "boxes?undulation_m=0.08&pitch_deg=15&poles=2", 1, MatcherKind::kCensusPyramid},
    {"low_texture", "low_texture", 1, MatcherKind::kCensusPyramid},
    {"unlike_cameras", "mismatch", 1, MatcherKind::kCensus},
    {"wall", "plane?wall_m=2", 1, MatcherKind::kCensusPyramid},
    {"uncalibrated", "boxes?seed=2", 1, MatcherKind::kCensusPyramid, false, Cameras::kUncalibrated},
    {"lenses", "boxes?seed=3&rocks=3", 1, MatcherKind::kCensusPyramid, false, Cameras::kLenses},
    {"longest_line", "boxes?seed=4", 1, MatcherKind::kCensus, false, Cameras::kIdeal,
     terrain::LineMode::kLongest},
    {"attitude", "boxes?seed=6&pitch_deg=15&roll_deg=3", 1, MatcherKind::kCensusPyramid, false,
     Cameras::kIdeal, terrain::LineMode::kVotes, true},
    {.name = "half",
     .scene = "boxes?seed=3&rocks=3",
     .frames = 1,
     .matcher = MatcherKind::kCensusPyramid,
     .cameras = Cameras::kLenses,
     .half = HalfResolution::kAlways},
    {.name = "full_half_full",
     .scene = "drive?seed=5",
     .frames = 4,
     .matcher = MatcherKind::kCensusPyramid,
     .half = HalfResolution::kWhenOverloaded,
     .modes = {FrameMode::kFull, FrameMode::kHalfResolution, FrameMode::kHalfResolution, FrameMode::kFull}},
};

// FNV-1a, low byte first; numbers by their bits.
class Hash {
  public:
    template <typename T>
    void add(T value) {
        if constexpr (std::is_same_v<T, double>)
            add_bytes(std::bit_cast<std::uint64_t>(value), sizeof value);
        else if constexpr (std::is_same_v<T, float>)
            add_bytes(std::bit_cast<std::uint32_t>(value), sizeof value);
        else
            add_bytes(static_cast<std::uint64_t>(value), sizeof value);
    }
    template <typename T>
    void add(ImageView<T> image) {
        for (int y = 0; y < image.height; ++y)
            for (int x = 0; x < image.width; ++x)
                add(image.at(x, y));
    }
    void add(std::span<const std::uint8_t> bytes) {
        for (const std::uint8_t byte : bytes)
            add(byte);
    }
    template <typename T, std::size_t kCount>
    void add(const std::array<T, kCount>& values) {
        for (const T& value : values)
            add(value);
    }
    void add(const DisparityPlane& plane) {
        for (const double value : {plane.du, plane.dv, plane.d0})
            add(value);
    }
    void add(const GroundPose& pose) {
        for (const double value : {pose.pitch_rad, pose.roll_rad, pose.height_m})
            add(value);
    }
    std::uint64_t value() const { return hash_; }

  private:
    void add_bytes(std::uint64_t bits, std::size_t bytes) {
        for (std::size_t i = 0; i < bytes; ++i)
            hash_ = (hash_ ^ (bits >> (8 * i) & 255U)) * 0x100000001B3U;
    }
    std::uint64_t hash_ = 0xCBF29CE484222325U;
};

rig::StereoCalibration calibration_of(const RectifiedRig& rig, Cameras cameras) {
    rig::StereoCalibration calibration;
    calibration.rectified = cameras == Cameras::kIdeal;
    for (rig::CameraModel* camera : {&calibration.left, &calibration.right}) {
        camera->width = rig.width;
        camera->height = rig.height;
        camera->fx = camera->fy = rig.focal_px;
        camera->cx = rig.cx_px;
        camera->cy = rig.cy_px;
        camera->distortion = {-0.04, 0.01, 0.0005, -0.0003};
    }
    calibration.right.distortion[0] = -0.039;
    // A turn about the optical axis by an angle whose sine and cosine are rational: 2 t / (1 + t^2).
    constexpr double kHalfTan = 0.0005;
    constexpr double kSine = 2.0 * kHalfTan / (1.0 + kHalfTan * kHalfTan);
    constexpr double kCosine = (1.0 - kHalfTan * kHalfTan) / (1.0 + kHalfTan * kHalfTan);
    calibration.rotation = {kCosine, -kSine, 0.0, kSine, kCosine, 0.0, 0.0, 0.0, 1.0};
    calibration.translation_m = {-rig.baseline_m, 0.0, 0.0};
    return calibration;
}

// Pairs of a scene, rendered when they are first asked for and kept: rendering takes longer than all the
// rest.
class Pairs {
  public:
    explicit Pairs(const std::string& spec) : renderer_(synth::scene_by_name(spec)) {}
    const RectifiedRig& rig() const { return renderer_.scene().rig; }
    const StereoFrame& at(int index) {
        while (std::ssize(frames_) <= index) {
            const int number = static_cast<int>(std::ssize(frames_));
            StereoFrame& frame =
                frames_.emplace_back(StereoFrame::make(arena_, rig().width, rig().height, false));
            Serial serial;
            renderer_.render(number, serial, frame.left, {}, frame.right);
            frame.stamp.sequence = frame.stamp.position = number;
            frame.stamp.utime_us = 1'600'000'000'000'000 + 100'000 * number;
            frame.stamp.exposure_mono_ns = 100'000'000LL * number;
        }
        return frames_[static_cast<std::size_t>(index)];
    }

    static Pairs& of(const std::string& scene) {
        static std::map<std::string, Pairs> all;
        const char* const first = scene.find('?') == std::string::npos ? "?" : "&";
        return all.try_emplace(scene, scene + first + "width=320&height=240&focal=250").first->second;
    }

  private:
    Arena arena_;
    synth::Renderer renderer_;
    std::vector<StereoFrame> frames_;
};

// One case: its parts in the order in which they borrow from each other.
class Replay {
  public:
    explicit Replay(const Case& of)
        : of_(of),
          pairs_(Pairs::of(of.scene)),
          rectifier_(
              of.cameras == Cameras::kUncalibrated
                  ? rig::Rectifier(rig().width, rig().height)
                  : rig::Rectifier(calibration_of(rig(), of.cameras), rig().width, rig().height, arena_)),
          body_(arena_.image<std::uint8_t>(rig().width, rig().height)),
          processor_(config(), rectifier_, serial_, arena_),
          result_(processor_.make_result(arena_)) {}

    Hashes hashes() {
        for (int frame = 0; frame < of_.frames; ++frame) {
            StereoFrame pair = pairs_.at(frame);
            pair.mode = of_.modes[static_cast<std::size_t>(frame)];
            if (of_.inertial) pair.attitude = {true, 0.28, 0.05, 0.02};
            processor_.process(pair, result_);
            add_frame(pair);
        }
        Hashes hashes;
        for (std::size_t part = 0; part < kParts; ++part)
            hashes[part] = parts_[part].value();
        return hashes;
    }
    bool any_obstacle() const { return any_obstacle_; }

  private:
    const RectifiedRig& rig() const { return pairs_.rig(); }
    pipeline::ProcessorConfig config() {
        pipeline::ProcessorConfig config;
        config.matcher.kind = of_.matcher;
        config.matcher.normalise_local_mean = of_.normalise;
        config.matcher.disparities = 64;
        config.terrain.line = of_.line;
        config.half_resolution = of_.half;
        config.grid.on = of_.cameras != Cameras::kUncalibrated;
        if (of_.cameras == Cameras::kLenses) {
            for (int y = 0; y < rig().height; ++y)
                for (int x = 0; x < rig().width; ++x)
                    body_.at(x, y) = y > 220 && x > 200 ? 255 : 0;
            config.body = body_;
        }
        return config;
    }

    Hash& part(Part of) { return parts_[static_cast<std::size_t>(of)]; }

    void add_frame(const StereoFrame& pair) {
        part(Part::kRendered).add(pair.left);
        part(Part::kRendered).add(pair.right);
        part(Part::kRectified).add(result_.left);
        part(Part::kDisparity).add(result_.disparity.disparity_q4);
        part(Part::kDisparity).add(result_.disparity.invalid);
        add_ground();
        part(Part::kMask).add(result_.mask);
        part(Part::kMask).add(result_.share);
        part(Part::kMask).add(result_.range_limit_m);
        add_things();
        for (const publish::MessageEncoder::Bytes bytes :
             {encoder_.mask(result_), encoder_.sectors(result_), encoder_.ground(result_),
              encoder_.v_disparity(result_), encoder_.preview(result_), encoder_.grid(result_),
              encoder_.obstacles(result_)}) {
            part(Part::kMessages).add(std::uint64_t{bytes.size()});
            part(Part::kMessages).add(bytes);
        }
        any_obstacle_ |= result_.share[static_cast<std::size_t>(TerrainClass::kObstacle)] > 0.0;
    }
    void add_ground() {
        Hash& hash = part(Part::kGround);
        hash.add(result_.v_disparity.histogram);
        hash.add(result_.ground.found);
        hash.add(result_.ground.plane);
        hash.add(result_.ground.covariance);
        hash.add(result_.ground.pose);
        hash.add(result_.ground.sigma);
        const GroundEvidence& fit = result_.evidence.ground_fit;
        for (const double value : {fit.density, fit.inlier_share, fit.line_run_share, fit.second_peak_ratio,
                                   fit.residual_rms_px, fit.row_residual_px, fit.blocked_share})
            hash.add(value);
        const PhotometricEvidence& light = result_.evidence.photometric;
        const PairEvidence& pair = result_.evidence.pair;
        for (const double value : {light.gain, light.offset, light.mismatch, light.overexposed_share,
                                   light.dark_share, light.contrast, pair.behind_share, pair.row_offset_px,
                                   pair.row_sigma_px, pair.left_sharper, pair.right_sharper})
            hash.add(value);
        hash.add(static_cast<int>(result_.verdict));
        hash.add(result_.reasons.bits());
    }
    void add_things() {
        Hash& hash = part(Part::kThings);
        for (const Sector& sector : result_.sectors) {
            hash.add(sector.blocked);
            hash.add(sector.held);
            hash.add(static_cast<int>(sector.kind));
            for (const double value : {sector.bearing_rad, sector.width_rad, sector.nearest_m,
                                       sector.nearest_sigma_m, sector.free_range_m, sector.coverage})
                hash.add(value);
        }
        for (const Obstacle& thing : result_.obstacles) {
            for (const std::int32_t value : {thing.left, thing.top, thing.right, thing.bottom, thing.pixels,
                                             static_cast<int>(thing.kind)})
                hash.add(value);
            for (const double value : {thing.disparity_px, thing.range_m, thing.range_sigma_m,
                                       thing.bearing_rad, thing.width_m, thing.height_m, thing.lowest_m})
                hash.add(value);
        }
        for (const GridCell& cell : result_.grid.cells) {
            hash.add(static_cast<int>(cell.kind));
            hash.add(cell.points);
            // What was not measured is NaN, whose bits mean nothing.
            for (const float value : {cell.elevation_m, cell.highest_m, cell.slope_rad, cell.roughness_m,
                                      cell.step_m, cell.index})
                hash.add(std::isnan(value) ? -1.0e9F : value);
        }
    }

    const Case& of_;
    Pairs& pairs_;
    Arena arena_;
    Serial serial_;
    rig::Rectifier rectifier_;
    ImageView<std::uint8_t> body_;
    pipeline::Processor processor_;
    FrameResult result_;
    publish::MessageEncoder encoder_;
    std::array<Hash, kParts> parts_;
    bool any_obstacle_ = false;
};

void write_table() {
    std::ofstream file(GROUNDLINE_SOURCE_DIR "/tests/golden/hashes.inc");
    file
        << "// Written by golden_test.cpp: rendered, rectified, disparity, ground, mask, things, messages.\n";
    for (const Case& of : kCases) {
        file << "{\"" << of.name << "\",\n {";
        const char* between = "";
        for (const std::uint64_t hash : Replay(of).hashes()) {
            std::array<char, 32> text{};
            std::snprintf(text.data(), text.size(), "0x%016" PRIX64, hash);
            file << between << text.data();
            between = ", ";
        }
        file << "}},\n";
    }
    ASSERT_TRUE(file.good());
    GTEST_SKIP() << "The table is written; build again to compare with it.";
}

TEST(Golden, ResultsAreTheSameOnEveryVectorUnit) {
    if (std::getenv("GROUNDLINE_WRITE_GOLDEN") != nullptr) return write_table();
    ASSERT_EQ(std::size(kGolden), std::size(kCases));
    on_every_vector_unit([] {
        for (std::size_t i = 0; i < std::size(kCases); ++i) {
            ASSERT_STREQ(kGolden[i].name, kCases[i].name);
            const Hashes now = Replay(kCases[i]).hashes();
            for (std::size_t part = 0; part < kParts; ++part)
                EXPECT_EQ(now[part], kGolden[i].hashes[part])
                    << kCases[i].name << ": " << kPartNames[part]
                    << " differs from the table, which GROUNDLINE_WRITE_GOLDEN=1 test_golden writes anew";
        }
    });
}

// The table would hold as well for frames in which nothing is found.
TEST(Golden, ScenesHoldObstacles) {
    for (const Case& of : kCases) {
        if (std::string(of.scene).find("plane") == 0) continue;
        Replay replay(of);
        replay.hashes();
        EXPECT_TRUE(replay.any_obstacle()) << of.name;
    }
}

}  // namespace
}  // namespace groundline
