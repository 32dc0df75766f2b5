// The bytes of every message, against a second, independent writer; what blind looks like; sizes; no
// allocation.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "groundline/grid_t.hpp"
#include "groundline/ground_t.hpp"
#include "groundline/health_t.hpp"
#include "groundline/image_t.hpp"
#include "groundline/mask_decoder.hpp"
#include "groundline/mask_t.hpp"
#include "groundline/obstacles_t.hpp"
#include "groundline/sectors_t.hpp"
#include "groundline/vdisparity_t.hpp"
#include "publish/mask_codec.hpp"
#include "publish/messages.hpp"
#include "support/allocation_count.hpp"
#include "unit/publish_fixture.hpp"

namespace groundline::publish {
namespace {

using test::Frame;
using Bytes = std::vector<std::uint8_t>;

// A NaN as it must be on the wire: quiet, positive, no payload.
constexpr std::uint64_t kWireNaN = 0x7ff8000000000000ULL;
const double kNaN = std::bit_cast<double>(kWireNaN);

// Writes LCM's encoding as its specification has it: big-endian, nothing between the fields.
class Golden {
  public:
    Golden& i64(std::int64_t value) { return number(static_cast<std::uint64_t>(value), 8); }
    Golden& i32(std::int64_t value) { return number(static_cast<std::uint64_t>(value), 4); }
    Golden& i16(std::initializer_list<int> values) {
        for (const int value : values)
            number(static_cast<std::uint64_t>(value), 2);
        return *this;
    }
    Golden& i8(int value) { return number(static_cast<std::uint64_t>(value), 1); }
    Golden& fingerprint(std::uint64_t value) { return number(value, 8); }
    Golden& real(double value) { return number(std::bit_cast<std::uint64_t>(value), 8); }
    Golden& reals(std::initializer_list<double> values) {
        for (const double value : values)
            real(value);
        return *this;
    }
    Golden& raw(std::initializer_list<int> values) {
        for (const int value : values)
            bytes.push_back(static_cast<std::uint8_t>(value));
        return *this;
    }
    Golden& text(const std::string& value) {  // length counts the NUL that follows
        i32(static_cast<std::int64_t>(value.size()) + 1);
        bytes.insert(bytes.end(), value.begin(), value.end());
        return i8(0);
    }
    // The six fields that every message about a frame begins with, as the fixture has them.
    Golden& head(int verdict, std::int64_t reasons) {
        return i64(1'600'000'000'123'456).i64(77'000'000'123).i8(1).i64(41).i8(verdict).i32(reasons);
    }
    Bytes bytes;

  private:
    Golden& number(std::uint64_t value, int count) {
        for (int i = count - 1; i >= 0; --i)
            bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
        return *this;
    }
};

Bytes copy(MessageEncoder::Bytes message) {
    return {message.begin(), message.end()};
}

template <typename Message>
Message read(MessageEncoder::Bytes bytes) {
    Message message;
    EXPECT_EQ(message.decode(bytes.data(), 0, static_cast<int>(bytes.size())),
              static_cast<int>(bytes.size()));
    return message;
}

TEST(Messages, FingerprintsAreThoseThatOthersCompiledAgainst) {
    EXPECT_EQ(static_cast<std::uint64_t>(mask_t::getHash()), 0x282646649fea32a4U);
    EXPECT_EQ(static_cast<std::uint64_t>(sectors_t::getHash()), 0xbf7d697723feefecU);
    EXPECT_EQ(static_cast<std::uint64_t>(ground_t::getHash()), 0xece73ec4bb2bb165U);
    EXPECT_EQ(static_cast<std::uint64_t>(health_t::getHash()), 0x50beec97c7e42e58U);
    EXPECT_EQ(static_cast<std::uint64_t>(vdisparity_t::getHash()), 0xc372905163392668U);
    EXPECT_EQ(static_cast<std::uint64_t>(grid_t::getHash()), 0xe719f93181ce58e1U);
    EXPECT_EQ(static_cast<std::uint64_t>(obstacles_t::getHash()), 0x852949dfa65e8652U);
    // bot_core.image_t: members 0x6fee6cb20472ff6a plus its image_metadata_t, rotated by one.
    EXPECT_EQ(static_cast<std::uint64_t>(image_t::getHash()), 0x14739ffe13d5f5f0U);
}

TEST(Messages, MaskBytes) {
    const Frame frame(8, 4);
    MessageEncoder encoder;
    Golden golden;
    golden.fingerprint(0x282646649fea32a4).head(2, 0x4).i32(8).i32(4).i32(1).i8(1);
    golden.reals({500.0, 320.5, 240.25, 0.125, 2.0, 0.2, kNaN, 11.5, 0.001, 0.0625, -15.0});
    // 16 unknown, 4 traversable, 1 obstacle, 11 traversable.
    golden.i32(4).raw({15 * 4 + 0, 3 * 4 + 1, 0 * 4 + 2, 10 * 4 + 1});
    EXPECT_EQ(copy(encoder.mask(frame.result)), golden.bytes);
}

TEST(Messages, MaskBytesWithoutCalibration) {
    Frame frame(8, 4);
    frame.result.rig.calibrated = false;
    frame.result.verdict = Verdict::kDegraded;
    frame.result.reasons = Reasons(0x6);
    MessageEncoder encoder;
    Golden golden;
    golden.fingerprint(0x282646649fea32a4).head(1, 0x6).i32(8).i32(4).i32(1).i8(1);
    golden.reals({kNaN, kNaN, kNaN, kNaN, kNaN, kNaN, 0.15, kNaN, 0.001, 0.0625, -15.0});
    golden.i32(4).raw({15 * 4 + 0, 3 * 4 + 1, 0 * 4 + 2, 10 * 4 + 1});
    EXPECT_EQ(copy(encoder.mask(frame.result)), golden.bytes);
}

TEST(Messages, SectorBytes) {
    const Frame frame(8, 4);
    MessageEncoder encoder;
    Golden golden;
    golden.fingerprint(0xbf7d697723feefec).head(2, 0x4).i32(2);
    golden.reals({0.25, 0.5}).i8(1).i8(1).i8(3).reals({3.5, 0.125, 2.5, 0.75});
    golden.reals({-0.25, 0.5}).i8(0).i8(0).i8(0).reals({kNaN, kNaN, 6.5, 1.0});
    EXPECT_EQ(copy(encoder.sectors(frame.result)), golden.bytes);
}

TEST(Messages, SectorBytesWithoutFrames) {
    const Frame frame(8, 4);
    MessageEncoder encoder;
    encoder.sectors(frame.result);  // nothing of an earlier message may stay
    Golden golden;
    golden.fingerprint(0xbf7d697723feefec).i64(123).i64(456).i8(0).i64(-1).i8(0).i32(0x1).i32(0);
    EXPECT_EQ(copy(encoder.sectors_without_frames(123, 456)), golden.bytes);
}

TEST(Messages, GroundBytes) {
    const Frame frame(8, 4);
    MessageEncoder encoder;
    Golden golden;
    golden.fingerprint(0xece73ec4bb2bb165).head(2, 0x4).i8(1).i8(0).i8(1);
    golden.reals({0.001, 0.0625, -15.0}).reals({0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5});
    golden.reals({0.2, -0.05, 1.5, 0.002, 0.001, 0.01});
    golden.reals({0.75, 0.625, 0.875, 0.25, 0.375, 0.125, 0.0625}).reals({0.5, 0.25, 0.125, 0.125});
    EXPECT_EQ(copy(encoder.ground(frame.result)), golden.bytes);
}

TEST(Messages, VDisparityBytes) {
    Frame frame(4, 2);
    Arena arena;
    frame.result.v_disparity.histogram = arena.image<std::uint16_t>(7, 2);
    // Quarter bins 0 1 | 2 3 4 5 | 6 are whole pixels 0, 1 and 2; sixteen units are one pixel counted.
    const std::uint16_t rows[2][7] = {{8, 8, 0, 0, 0, 0, 1}, {0, 0, 1000, 1000, 1000, 1000, 160}};
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 7; ++x)
            frame.result.v_disparity.histogram.at(x, y) = rows[y][x];
    MessageEncoder encoder;
    Golden golden;
    golden.fingerprint(0xc372905163392668).head(2, 0x4).i32(2).i32(1).i32(2).i32(3);
    golden.reals({2.0, 250.0, 0.0625, 0.001 * 1.5 + 0.0625 * 0.0 + -15.0});
    golden.i32(6).raw(
        {1, 0, 1, 0, 255, 10});  // 16/4000 * 255 = 1.02; 1/4000: at least 1; 160/4000 * 255 = 10.2
    EXPECT_EQ(copy(encoder.v_disparity(frame.result)), golden.bytes);
}

TEST(Messages, PreviewBytes) {
    const Frame frame(2, 2);
    MessageEncoder encoder;
    Golden golden;
    golden.fingerprint(0x14739ffe13d5f5f0).i64(1'600'000'000'123'456);
    golden.i32(2).i32(2).i32(6).i32(859981650).i32(12);
    golden.raw({100, 100, 100, 101, 101, 101, 50, 177, 50, 178, 50, 50}).i32(0);
    EXPECT_EQ(copy(encoder.preview(frame.result)), golden.bytes);
}

TEST(Messages, GridBytes) {
    const Frame frame(8, 4);
    MessageEncoder encoder;
    Golden golden;
    golden.fingerprint(0xe719f93181ce58e1).head(2, 0x4).i32(2).i32(3);
    golden.reals({0.25, 0.5, -0.375}).reals({0.001, 0.00625, 0.002, 0.005, 0.004}).i32(6);
    golden.raw({0, 1, 0, 2, 0, 3}).raw({255, 125, 255, 0, 255, 0});              // kind, index
    golden.i16({-32768, 13, -32768, 750, -32768, -313});                         // elevation
    golden.i16({-32768, 30, -32768, 32767, -32768, -32768});                     // highest
    golden.raw({255, 5, 255, 255, 255, 255}).raw({255, 4, 255, 255, 255, 255});  // slope, roughness
    golden.raw({255, 5, 255, 254, 255, 255}).raw({0, 17, 0, 255, 0, 0});         // step, points
    EXPECT_EQ(copy(encoder.grid(frame.result)), golden.bytes);
}

// The largest grid there may be, full of what takes most: arrays whose length is fixed by the cells alone.
TEST(Messages, TheLargestGridFitsADatagramAndComesBack) {
    Frame frame(8, 4);
    TerrainGrid& grid = frame.result.grid;
    grid.rows = 65;
    grid.columns = 100;
    grid.cells = frame.arena.take<GridCell>(kMaxGridCells);
    for (std::size_t k = 0; k < grid.cells.size(); ++k) {
        const auto part = static_cast<float>(k) / static_cast<float>(grid.cells.size());
        grid.cells[k] = {static_cast<TerrainClass>(k % 4),
                         static_cast<std::int32_t>(k),
                         4.0F * part - 2.0F,
                         3.0F * part,
                         1.5F * part,
                         0.5F * part,
                         part,
                         1.0F - part};
    }
    MessageEncoder encoder;
    const MessageEncoder::Bytes bytes = encoder.grid(frame.result);
    EXPECT_GT(bytes.size(), 65'000U);
    EXPECT_LE(bytes.size() + 63 + 1, 65499U);
    const auto message = read<grid_t>(bytes);
    ASSERT_EQ(message.cells, 6500);
    ASSERT_EQ(message.rows * message.columns, message.cells);
    for (std::size_t k = 0; k < grid.cells.size(); ++k) {
        const GridCell& cell = grid.cells[k];
        ASSERT_EQ(message.kind[k], static_cast<int>(cell.kind));
        ASSERT_NEAR(message.index[k] * message.index_scale, cell.index, 0.501 * message.index_scale);
        ASSERT_NEAR(message.elevation[k] * message.elevation_scale_m, cell.elevation_m, 0.000501);
        ASSERT_NEAR(message.highest[k] * message.elevation_scale_m, cell.highest_m, 0.000501);
        ASSERT_NEAR(message.slope[k] * message.slope_scale_rad, cell.slope_rad,
                    0.501 * message.slope_scale_rad);
        ASSERT_NEAR(message.roughness[k] * message.roughness_scale_m, cell.roughness_m,
                    0.501 * message.roughness_scale_m);
        ASSERT_NEAR(message.step[k] * message.step_scale_m, cell.step_m, 0.501 * message.step_scale_m);
    }
    frame.result.grid = {};
    EXPECT_TRUE(encoder.grid(frame.result).empty());
}

TEST(Messages, ObstaclesBytes) {
    Frame frame(8, 4);
    MessageEncoder encoder;
    Golden golden;
    golden.fingerprint(0x852949dfa65e8652).head(2, 0x4).i32(2);
    golden.i8(2).i8(0).i32(3).i32(1).i32(5).i32(2).i32(6);
    golden.reals({12.5, 5.25, 0.0625, -0.125, 0.0625, -0.25, 1.5, 0.75, -0.03125});
    golden.i8(3).i8(1).i32(0).i32(0).i32(1).i32(3).i32(4);
    golden.reals({2.5, 25.0, 0.5, 0.375, 0.5, 0.25, 3.0, 2.5, 2.25});
    EXPECT_EQ(copy(encoder.obstacles(frame.result)), golden.bytes);

    frame.result.rig.calibrated = false;
    const auto uncalibrated = read<obstacles_t>(encoder.obstacles(frame.result));
    ASSERT_EQ(uncalibrated.count, 2);
    EXPECT_EQ(uncalibrated.obstacles[0].disparity_px, 12.5);
    for (const double metres : {uncalibrated.obstacles[0].range_m, uncalibrated.obstacles[0].bearing_rad,
                                uncalibrated.obstacles[1].width_m, uncalibrated.obstacles[1].height_m})
        EXPECT_TRUE(std::isnan(metres));
}

TEST(Messages, AFullListOfObstaclesFitsADatagramAndComesBack) {
    Frame frame(8, 4);
    frame.result.obstacles.clear();
    for (int i = 0; i < obstacles_t::MOST; ++i) {
        Obstacle obstacle;
        obstacle.pixels = i;
        frame.result.obstacles.push_back(obstacle);
    }
    MessageEncoder encoder;
    const MessageEncoder::Bytes bytes = encoder.obstacles(frame.result);
    EXPECT_LE(bytes.size() + 63 + 1, 65499U);
    const auto message = read<obstacles_t>(bytes);
    ASSERT_EQ(message.count, 128);
    EXPECT_EQ(message.obstacles[127].pixels, 127);
}

HealthReport full_report() {
    HealthReport report;
    report.utime_us = 99;
    report.exposure_mono_ns = 98;
    report.stamp_source = StampSource::kArrival;
    report.sequence = 97;
    report.verdict = Verdict::kDegraded;
    report.reasons = Reasons(0x4000);
    report.state = LifeState::kRunning;
    report.result_age_s = 0.5;
    report.source_rate_hz = 30.0;
    report.process_rate_hz = 29.0;
    report.publish_rate_hz = 28.0;
    for (std::size_t i = 0; i < report.stages.size(); ++i)
        report.stages.at(i) = {1.0 + static_cast<double>(i), 2.0, 3.0};
    report.all_stages = {25.0, 26.0, 27.0};
    report.exposure_to_publish = {50.0, 60.0, 70.0};
    for (std::size_t i = 0; i < report.counts.size(); ++i)
        report.counts.at(i) = static_cast<std::int64_t>(1000 + i);
    report.lcm_open_failures = 5;
    report.pair_skew_ms = 0.25;
    report.brightness_gain = 1.03;
    report.brightness_offset = -1.5;
    report.host = {-2.0, 0.375, 61.5, 1, 0, 1};
    report.camera = {verdict::CameraState::kStalled, 4.5, 100.0, 90.0, 0.25, 0.125, {"left is gone"}};
    return report;
}

TEST(Messages, HealthBytes) {
    MessageEncoder encoder;
    Golden golden;
    golden.fingerprint(0x50beec97c7e42e58).i64(99).i64(98).i8(4).i64(97).i8(1).i32(0x4000).i8(1);
    golden.reals({0.5, 30.0, 29.0, 28.0}).i32(9);
    double first = 1.0;
    for (const char* stage : {"read", "rectify", "match", "ground", "classify", "write", "publish"})
        golden.text(stage).reals({first++, 2.0, 3.0});
    golden.text("all_stages").reals({25.0, 26.0, 27.0});
    golden.text("exposure_to_publish").reals({50.0, 60.0, 70.0}).i32(21);
    std::int64_t count = 1000;
    for (const char* name :
         {"frames_read",       "frames_bad",         "frames_overwritten",  "frames_processed",
          "frames_halved",     "resolution_changes", "results_overwritten", "results_delivered",
          "sink_failures",     "disparity_clamped",  "publish_failures",    "health_overwritten",
          "camera_gaps",       "camera_damaged",     "camera_left_out",     "camera_singles",
          "camera_superseded", "camera_restarts",    "attitudes_taken",     "attitudes_refused"})
        golden.text(name).i64(count++);
    golden.text("lcm_open_failures").i64(5);
    golden.reals({0.25, -2.0, 1.03, -1.5}).i8(2).reals({4.5, 100.0, 90.0, 0.25, 0.125}).text("left is gone");
    golden.reals({0.375, 61.5}).i8(1).i8(0).i8(1);
    EXPECT_EQ(copy(encoder.health(full_report())), golden.bytes);
}

TEST(Messages, HealthSaysNotMeasured) {
    MessageEncoder encoder;
    const auto message = read<health_t>(encoder.health(HealthReport()));
    for (const double value :
         {message.result_age_s, message.source_rate_hz, message.process_rate_hz, message.publish_rate_hz,
          message.latencies.at(0).p50_ms, message.latencies.at(7).max_ms, message.pair_skew_ms,
          message.exposure_difference_ms, message.brightness_gain, message.brightness_offset,
          message.camera_drift_ppm, message.left_mean, message.right_mean, message.left_saturated,
          message.right_saturated, message.epipolar_offset_px, message.temperature_c})
        EXPECT_EQ(std::bit_cast<std::uint64_t>(value), kWireNaN);
    EXPECT_EQ(message.exposure_mono_ns, -1);
    EXPECT_EQ(message.sequence, -1);
    EXPECT_EQ(message.throttled, -1);
    EXPECT_EQ(message.realtime_scheduling, -1);
    EXPECT_EQ(message.memory_locked, -1);
    EXPECT_EQ(message.camera_state, -1);
    EXPECT_EQ(message.camera_fault, "");
    for (const counter_t& counter : message.counters)
        EXPECT_EQ(counter.value, -1) << counter.name;
}

TEST(Messages, EveryNaNHasTheSameBytes) {
    Frame frame(8, 4);
    MessageEncoder encoder;
    const double negative = std::bit_cast<double>(std::uint64_t{0xfff8000000000123});
    const double positive = std::bit_cast<double>(std::uint64_t{0x7ff8000000000456});
    Bytes encoded[2];
    for (int i = 0; i < 2; ++i) {
        const double nan = i == 0 ? negative : positive;
        frame.result.range_limit_m = frame.result.ground.plane.dv = frame.result.tolerance_m = nan;
        frame.result.rig.focal_px = frame.result.evidence.ground_fit.density = nan;
        frame.result.ground.pose.height_m = frame.result.sectors[0].nearest_m = nan;
        frame.result.sectors[1].free_range_m = frame.result.share[2] = nan;
        const auto append = [&](MessageEncoder::Bytes part) {
            encoded[i].insert(encoded[i].end(), part.begin(), part.end());
        };
        append(encoder.mask(frame.result));
        append(encoder.sectors(frame.result));
        append(encoder.ground(frame.result));
        append(encoder.v_disparity(frame.result));
    }
    EXPECT_EQ(encoded[0], encoded[1]);
}

TEST(Messages, BlindShowsNothingWhateverTheResultHolds) {
    Frame frame(640, 480);
    fill_pixels(frame.result.mask, TerrainClass::kTraversable);
    frame.result.verdict = Verdict::kBlind;
    frame.result.reasons = Reasons(0x2000);
    MessageEncoder encoder;

    const auto mask = read<mask_t>(encoder.mask(frame.result));
    std::vector<std::uint8_t> classes;
    ASSERT_TRUE(decode_mask(mask, classes));
    EXPECT_EQ(classes, std::vector<std::uint8_t>(640 * 480, 0));
    EXPECT_EQ(mask.verdict, mask_t::VERDICT_BLIND);
    EXPECT_EQ(mask.reasons, mask_t::REASON_NO_GROUND);
    EXPECT_TRUE(std::isnan(mask.range_limit_m));
    EXPECT_TRUE(std::isnan(mask.ground_plane[0]) && std::isnan(mask.ground_plane[2]));

    const auto sectors = read<sectors_t>(encoder.sectors(frame.result));
    ASSERT_EQ(sectors.count, 2);
    for (const sector_t& sector : sectors.sectors) {
        EXPECT_EQ(sector.blocked, 0);
        EXPECT_EQ(sector.held, 0);
        EXPECT_EQ(sector.kind, mask_t::CLASS_UNKNOWN);
        EXPECT_TRUE(std::isnan(sector.nearest_m));
        EXPECT_EQ(sector.free_range_m, 0.0);
        EXPECT_EQ(sector.coverage, 0.0);
    }

    const auto ground = read<ground_t>(encoder.ground(frame.result));
    EXPECT_EQ(ground.found, 0);
    EXPECT_TRUE(std::isnan(ground.plane[1]) && std::isnan(ground.height_m) &&
                std::isnan(ground.covariance[4]));
    EXPECT_EQ(ground.class_share[mask_t::CLASS_UNKNOWN], 1.0);
    EXPECT_EQ(ground.class_share[mask_t::CLASS_TRAVERSABLE], 0.0);
    EXPECT_EQ(ground.density, 0.75) << "the fit is shown all the same: it says why";

    const auto v_disparity = read<vdisparity_t>(encoder.v_disparity(frame.result));
    EXPECT_TRUE(std::isnan(v_disparity.line_slope));
    EXPECT_EQ(read<obstacles_t>(encoder.obstacles(frame.result)).count, 0);
    const auto grid = read<grid_t>(encoder.grid(frame.result));
    ASSERT_EQ(grid.cells, 6);
    for (std::size_t k = 0; k < 6; ++k) {
        EXPECT_EQ(grid.kind[k], mask_t::CLASS_UNKNOWN);
        EXPECT_EQ(grid.elevation[k], grid_t::NO_ELEVATION);
        EXPECT_EQ(grid.highest[k], grid_t::NO_ELEVATION);
        EXPECT_EQ(grid.points[k], 0);
        for (const auto* bytes : {&grid.index, &grid.slope, &grid.roughness, &grid.step})
            EXPECT_EQ((*bytes)[k], grid_t::NOT_MEASURED);
    }
    const auto preview = read<image_t>(encoder.preview(frame.result));
    for (std::size_t i = 0; i < preview.data.size(); i += 3)
        ASSERT_TRUE(preview.data[i] == preview.data[i + 1] && preview.data[i] == preview.data[i + 2]);
}

TEST(Messages, HeldGroundIsSaid) {
    Frame frame(8, 4);
    frame.result.verdict = Verdict::kDegraded;
    frame.result.reasons.add(Reason::kHeldGround);
    MessageEncoder encoder;
    EXPECT_EQ(read<ground_t>(encoder.ground(frame.result)).held, 1);
}

TEST(Messages, EveryMessageFitsADatagramWithTheLongestChannelName) {
    std::mt19937 random(7);
    MessageEncoder encoder;
    const int sizes[][2] = {{640, 480}, {1280, 720}, {1280, 960}, {4096, 3000}, {1, 1}, {3, 2000}};
    std::size_t largest = 0;
    for (const auto& size : sizes) {
        Frame frame(size[0], size[1]);
        for (int y = 0; y < size[1]; ++y)
            for (int x = 0; x < size[0]; ++x)
                frame.result.mask.at(x, y) = static_cast<TerrainClass>(random() & 3U);
        Arena arena;
        frame.result.v_disparity.histogram = arena.image<std::uint16_t>(4 * 256, size[1]);
        fill_pixels(frame.result.v_disparity.histogram, 65535);
        frame.result.sectors.resize(kMaxSectors);
        for (int part = 0; part < 5; ++part) {
            const MessageEncoder::Bytes bytes = part == 0   ? encoder.mask(frame.result)
                                                : part == 1 ? encoder.sectors(frame.result)
                                                : part == 2 ? encoder.ground(frame.result)
                                                : part == 3 ? encoder.v_disparity(frame.result)
                                                            : encoder.preview(frame.result);
            ASSERT_FALSE(bytes.empty()) << size[0] << " x " << size[1] << " part " << part;
            ASSERT_LE(bytes.size() + 63 + 1, 65499U);
            largest = std::max(largest, bytes.size());
        }
        const auto v_disparity = read<vdisparity_t>(encoder.v_disparity(frame.result));
        EXPECT_EQ(v_disparity.bins, 257);
        EXPECT_EQ(v_disparity.rows, (size[1] + v_disparity.row_scale - 1) / v_disparity.row_scale);
        EXPECT_EQ(static_cast<int>(v_disparity.data.size()), v_disparity.rows * v_disparity.bins);
    }
    EXPECT_GT(largest, 60000U) << "the sizes do not try the limit";
    EXPECT_LE(encoder.health(full_report()).size() + 63 + 1, 65499U);

    // A mask whose runs take the last byte that they may.
    Frame frame(1000, 66);
    for (int i = 0; i < 66000; ++i)
        frame.result.mask.at(i % 1000, i / 1000) = static_cast<TerrainClass>(std::min(i, 64998) & 1);
    const auto mask = read<mask_t>(encoder.mask(frame.result));
    EXPECT_EQ(mask.size, static_cast<int>(kMaxMaskBytes));
    EXPECT_LE(encoder.mask(frame.result).size() + 63 + 1, 65499U);
}

TEST(Messages, PreviewShowsTheGravestClassOfACell) {
    Frame frame(640, 480);
    MessageEncoder encoder;
    const auto preview = read<image_t>(encoder.preview(frame.result));
    EXPECT_EQ(preview.width, 160);
    EXPECT_EQ(preview.height, 120);
    const std::size_t obstacle = (60 * 160 + 80) * 3;
    EXPECT_GT(preview.data.at(obstacle), preview.data.at(obstacle + 1))
        << "one obstacle pixel of 16 must be red";
    EXPECT_GT(preview.data.at(obstacle + 4), preview.data.at(obstacle + 3)) << "its neighbour is green";
}

TEST(Messages, EncodingAllocatesNothing) {
    std::mt19937 random(8);
    Frame frame(640, 480);
    frame.result.sectors.resize(kMaxSectors);
    Frame noise(1280, 960);
    for (int y = 0; y < 960; ++y)
        for (int x = 0; x < 1280; ++x)
            noise.result.mask.at(x, y) = static_cast<TerrainClass>(random() & 3U);
    MessageEncoder encoder;
    const HealthReport report = full_report();
    const std::uint64_t before = groundline::test::allocations();
    std::size_t bytes = 0;
    for (const Frame* each : {&frame, &noise, &frame}) {
        bytes += encoder.mask(each->result).size();
        bytes += encoder.sectors(each->result).size();
        bytes += encoder.ground(each->result).size();
        bytes += encoder.v_disparity(each->result).size();
        bytes += encoder.preview(each->result).size();
        bytes += encoder.grid(each->result).size();
        bytes += encoder.health(report).size();
        bytes += encoder.sectors_without_frames(1, 2).size();
    }
    EXPECT_EQ(groundline::test::allocations() - before, 0U);
    EXPECT_GT(bytes, 100000U);
    EXPECT_GT(before, 0U) << "the counter does not count";
}

TEST(Messages, MissingPicturesGiveNoMessage) {
    Frame frame(8, 4);
    frame.result.v_disparity.histogram = {};
    frame.result.left = {};
    MessageEncoder encoder;
    EXPECT_TRUE(encoder.v_disparity(frame.result).empty());
    EXPECT_TRUE(encoder.preview(frame.result).empty());
}

}  // namespace
}  // namespace groundline::publish
