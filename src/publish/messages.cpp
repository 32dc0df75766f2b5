#include "publish/messages.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <string_view>
#include <vector>

#include "groundline/grid_t.hpp"
#include "groundline/ground_t.hpp"
#include "groundline/health_t.hpp"
#include "groundline/image_t.hpp"
#include "groundline/mask_t.hpp"
#include "groundline/obstacles_t.hpp"
#include "groundline/sectors_t.hpp"
#include "groundline/vdisparity_t.hpp"
#include "publish/mask_codec.hpp"

namespace groundline::publish {
namespace {

// The numbers in the .lcm files are those of core.
static_assert(mask_t::CLASS_UNKNOWN == static_cast<int>(TerrainClass::kUnknown));
static_assert(mask_t::CLASS_TRAVERSABLE == static_cast<int>(TerrainClass::kTraversable));
static_assert(mask_t::CLASS_OBSTACLE == static_cast<int>(TerrainClass::kObstacle));
static_assert(mask_t::CLASS_DROP == static_cast<int>(TerrainClass::kDrop));
static_assert(mask_t::VERDICT_BLIND == static_cast<int>(Verdict::kBlind));
static_assert(mask_t::VERDICT_DEGRADED == static_cast<int>(Verdict::kDegraded));
static_assert(mask_t::VERDICT_TRUSTED == static_cast<int>(Verdict::kTrusted));
static_assert(mask_t::ENCODING_RUNS == static_cast<int>(MaskEncoding::kRuns));
static_assert(mask_t::ENCODING_GRID == static_cast<int>(MaskEncoding::kGrid));
static_assert(mask_t::STAMP_START_OF_EXPOSURE == static_cast<int>(StampSource::kStartOfExposure));
static_assert(mask_t::STAMP_END_OF_FRAME == static_cast<int>(StampSource::kEndOfFrame));
static_assert(mask_t::STAMP_FIRST_ROW == static_cast<int>(StampSource::kFirstRow));
static_assert(mask_t::STAMP_ARRIVAL == static_cast<int>(StampSource::kArrival));
static_assert(mask_t::STAMP_FILE == static_cast<int>(StampSource::kFile));
static_assert(health_t::STATE_STARTING == static_cast<int>(LifeState::kStarting));
static_assert(health_t::STATE_RUNNING == static_cast<int>(LifeState::kRunning));
static_assert(health_t::STATE_STALLED == static_cast<int>(LifeState::kStalled));
static_assert(health_t::STATE_STOPPING == static_cast<int>(LifeState::kStopping));
static_assert(health_t::CAMERA_ABSENT == static_cast<int>(verdict::CameraState::kAbsent));
static_assert(health_t::CAMERA_BACKING_OFF == static_cast<int>(verdict::CameraState::kBackingOff));
static_assert(health_t::CAMERA_STALLED == static_cast<int>(verdict::CameraState::kStalled));
static_assert(health_t::CAMERA_STARTING == static_cast<int>(verdict::CameraState::kStarting));
static_assert(health_t::CAMERA_RUNNING == static_cast<int>(verdict::CameraState::kRunning));

constexpr bool is_bit_of(std::int64_t bits, Reason reason) {
    Reasons reasons;
    reasons.add(reason);
    return bits == static_cast<std::int64_t>(reasons.bits());
}
static_assert(is_bit_of(mask_t::REASON_NO_FRAMES, Reason::kNoFrames));
static_assert(is_bit_of(mask_t::REASON_UNCALIBRATED, Reason::kUncalibrated));
static_assert(is_bit_of(mask_t::REASON_NO_MOUNT_PRIOR, Reason::kNoMountPrior));
static_assert(is_bit_of(mask_t::REASON_LOW_DENSITY, Reason::kLowDensity));
static_assert(is_bit_of(mask_t::REASON_FEW_INLIERS, Reason::kFewInliers));
static_assert(is_bit_of(mask_t::REASON_SHORT_LINE, Reason::kShortLine));
static_assert(is_bit_of(mask_t::REASON_OUTSIDE_GATE, Reason::kOutsideGate));
static_assert(is_bit_of(mask_t::REASON_POSE_JUMP, Reason::kPoseJump));
static_assert(is_bit_of(mask_t::REASON_AMBIGUOUS, Reason::kAmbiguous));
static_assert(is_bit_of(mask_t::REASON_UNEVEN, Reason::kUneven));
static_assert(is_bit_of(mask_t::REASON_UNCERTAIN_POSE, Reason::kUncertainPose));
static_assert(is_bit_of(mask_t::REASON_BLOCKED_VIEW, Reason::kBlockedView));
static_assert(is_bit_of(mask_t::REASON_WALL, Reason::kWall));
static_assert(is_bit_of(mask_t::REASON_NO_GROUND, Reason::kNoGround));
static_assert(is_bit_of(mask_t::REASON_HELD_GROUND, Reason::kHeldGround));
static_assert(is_bit_of(mask_t::REASON_PHOTOMETRIC, Reason::kPhotometric));
static_assert(is_bit_of(mask_t::REASON_OVEREXPOSED, Reason::kOverexposed));
static_assert(is_bit_of(mask_t::REASON_DARK, Reason::kDark));
static_assert(is_bit_of(mask_t::REASON_FROZEN, Reason::kFrozen));
static_assert(is_bit_of(mask_t::REASON_SWAPPED, Reason::kSwapped));
static_assert(is_bit_of(mask_t::REASON_UNSYNCHRONISED, Reason::kUnsynchronised));
static_assert(is_bit_of(mask_t::REASON_EPIPOLAR, Reason::kEpipolar));
static_assert(is_bit_of(mask_t::REASON_BLURRED, Reason::kBlurred));
static_assert(is_bit_of(mask_t::REASON_OVERLOAD, Reason::kOverload));
static_assert(is_bit_of(mask_t::REASON_UNCHECKED, Reason::kUnchecked));
static_assert(is_bit_of(mask_t::REASON_IDENTICAL, Reason::kIdentical));
static_assert(is_bit_of(mask_t::REASON_HALF_RESOLUTION, Reason::kHalfResolution));
static_assert(kReasons == 27);

// Bytes of data that leave room for the other fields of vdisparity_t and image_t.
constexpr std::size_t kMaxDataBytes = kMaxMaskBytes;
// Counts of grid_t: heights to 32.7 m, slopes to a right angle, roughness to 0.5 m, steps to 1.27 m.
constexpr double kElevationScaleM = 0.001;
constexpr double kSlopeScaleRad = 1.0 / 160.0;
constexpr double kRoughnessScaleM = 0.002;
constexpr double kStepScaleM = 0.005;
constexpr double kIndexScale = 1.0 / 250.0;
static_assert(10 * kMaxGridCells + 200 <= kMaxMessageBytes);
static_assert(obstacles_t::MOST == kMaxObstacles);
static_assert(100 * kMaxObstacles + 100 <= kMaxMessageBytes);
constexpr std::size_t kHealthCounters = static_cast<std::size_t>(Count::kCount) + 1;
constexpr std::size_t kHealthLatencies = static_cast<std::size_t>(Stage::kCount) + 2;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Processors make NaN with different signs: on the wire there is one.
double wire(double value) {
    return value == value ? value : kNaN;
}
double wire_if(bool holds, double value) {
    return holds ? wire(value) : kNaN;
}

template <typename Message>
void set_head(Message& message, const FrameResult& result) {
    message.utime = result.stamp.utime_us;
    message.exposure_mono_ns = result.stamp.exposure_mono_ns;
    message.stamp_source = static_cast<std::int8_t>(result.stamp.source);
    message.sequence = result.stamp.sequence;
    message.verdict = static_cast<std::int8_t>(result.verdict);
    message.reasons = static_cast<std::int32_t>(result.reasons.bits());
}

bool shows_ground(const FrameResult& result) {
    return result.verdict != Verdict::kBlind && result.ground.found;
}

void set_plane(double (&plane)[3], const FrameResult& result) {
    const bool shown = shows_ground(result);
    plane[0] = wire_if(shown, result.ground.plane.du);
    plane[1] = wire_if(shown, result.ground.plane.dv);
    plane[2] = wire_if(shown, result.ground.plane.d0);
}

constexpr int parts_of(int length, int step) {
    return (length + step - 1) / step;
}

std::uint8_t counts8(double value, double scale) {
    if (!(value == value)) return grid_t::NOT_MEASURED;
    return static_cast<std::uint8_t>(std::clamp(value / scale + 0.5, 0.0, grid_t::NOT_MEASURED - 1.0));
}
std::int16_t counts16(double value, double scale) {
    if (!(value == value)) return grid_t::NO_ELEVATION;
    const double count = std::clamp(value / scale, -32767.0, 32767.0);
    return static_cast<std::int16_t>(count < 0.0 ? count - 0.5 : count + 0.5);
}

// Red, green and blue of a cell: grey half mixed with the colour of its class.
std::array<std::uint8_t, 3> tinted(unsigned grey, TerrainClass kind) {
    const auto dim = static_cast<std::uint8_t>(grey / 2);
    const auto full = static_cast<std::uint8_t>((grey + 255) / 2);
    switch (kind) {
        case TerrainClass::kTraversable:
            return {dim, full, dim};
        case TerrainClass::kObstacle:
            return {full, dim, dim};
        case TerrainClass::kDrop:
            return {full, dim, full};
        default:
            return {static_cast<std::uint8_t>(grey), static_cast<std::uint8_t>(grey),
                    static_cast<std::uint8_t>(grey)};
    }
}

}  // namespace

struct MessageEncoder::Parts {
    std::vector<std::uint8_t> encoded = std::vector<std::uint8_t>(kMaxMessageBytes);
    std::vector<std::uint32_t> cells = std::vector<std::uint32_t>(kMaxDataBytes);
    mask_t mask;
    sectors_t sectors;
    ground_t ground;
    vdisparity_t v_disparity;
    grid_t grid;
    obstacles_t obstacles;
    image_t preview;
    health_t health;

    // The arrays keep their full length; how much of them is sent is in the message's own size field.
    Parts() {
        mask.data.resize(kMaxMaskBytes);
        v_disparity.data.resize(kMaxDataBytes);
        preview.data.resize(kMaxDataBytes);
        preview.nmetadata = 0;
        sectors.sectors.resize(kMaxSectors);
        obstacles.obstacles.resize(kMaxObstacles);
        for (std::vector<std::uint8_t>* bytes :
             {&grid.kind, &grid.index, &grid.slope, &grid.roughness, &grid.step, &grid.points})
            bytes->resize(kMaxGridCells);
        grid.elevation.resize(kMaxGridCells);
        grid.highest.resize(kMaxGridCells);
        health.camera_fault.reserve(CameraHealth().fault.size());
        health.latencies.resize(kHealthLatencies);
        health.counters.resize(kHealthCounters);
        for (std::size_t stage = 0; stage < kStageNames.size(); ++stage)
            health.latencies[stage].name = kStageNames[stage];
        health.latencies[kStageNames.size()].name = "all_stages";
        health.latencies.back().name = "exposure_to_publish";
        for (std::size_t which = 0; which < kCountNames.size(); ++which)
            health.counters[which].name = kCountNames[which];
        health.counters.back().name = "lcm_open_failures";
    }

    template <typename Message>
    Bytes encode(const Message& message) {
        const int size = message.encode(encoded.data(), 0, static_cast<int>(encoded.size()));
        return {encoded.data(), size > 0 ? static_cast<std::size_t>(size) : 0};
    }
};

MessageEncoder::MessageEncoder() : parts_(std::make_unique<Parts>()) {}
MessageEncoder::~MessageEncoder() = default;

MessageEncoder::Bytes MessageEncoder::mask(const FrameResult& result) {
    mask_t& out = parts_->mask;
    set_head(out, result);
    out.width = result.mask.width;
    out.height = result.mask.height;
    const PackedMask packed =
        result.verdict == Verdict::kBlind
            ? pack_uniform(TerrainClass::kUnknown, result.mask.width, result.mask.height, out.data)
            : pack_mask(result.mask, out.data);
    out.scale = packed.scale;
    out.encoding = static_cast<std::int8_t>(packed.encoding);
    out.size = static_cast<std::int32_t>(packed.size);
    const RectifiedRig& rig = result.rig;
    out.fx_px = wire_if(rig.calibrated, rig.focal_px);
    out.cx_px = wire_if(rig.calibrated, rig.cx_px);
    out.cy_px = wire_if(rig.calibrated, rig.cy_px);
    out.baseline_m = wire_if(rig.calibrated, rig.baseline_m);
    out.disparity_offset_px = wire_if(rig.calibrated, rig.offset_px());
    out.tolerance_m = wire_if(rig.calibrated, result.tolerance_m);
    out.tolerance_ratio = wire_if(!rig.calibrated, result.tolerance_ratio);
    out.range_limit_m = wire_if(rig.calibrated && shows_ground(result), result.range_limit_m);
    set_plane(out.ground_plane, result);
    return parts_->encode(out);
}

MessageEncoder::Bytes MessageEncoder::sectors(const FrameResult& result) {
    sectors_t& out = parts_->sectors;
    set_head(out, result);
    const bool blind = result.verdict == Verdict::kBlind;
    out.count = static_cast<std::int32_t>(result.sectors.size());
    for (std::size_t i = 0; i < result.sectors.size(); ++i) {
        const Sector& from = result.sectors[i];
        sector_t& to = out.sectors[i];
        const bool blocked = from.blocked && !blind;
        to.bearing_rad = wire(from.bearing_rad);
        to.width_rad = wire(from.width_rad);
        to.blocked = static_cast<std::int8_t>(blocked);
        to.held = static_cast<std::int8_t>(blocked && from.held);
        to.kind = static_cast<std::int8_t>(blocked ? from.kind : TerrainClass::kUnknown);
        to.nearest_m = wire_if(blocked, from.nearest_m);
        to.nearest_sigma_m = wire_if(blocked, from.nearest_sigma_m);
        to.free_range_m = blind ? 0.0 : wire(from.free_range_m);
        to.coverage = blind ? 0.0 : wire(from.coverage);
    }
    return parts_->encode(out);
}

MessageEncoder::Bytes MessageEncoder::sectors_without_frames(std::int64_t now_utime_us,
                                                             std::int64_t now_mono_ns) {
    sectors_t& out = parts_->sectors;
    Reasons reasons;
    reasons.add(Reason::kNoFrames);
    out.utime = now_utime_us;
    out.exposure_mono_ns = now_mono_ns;
    out.stamp_source = mask_t::STAMP_UNKNOWN;
    out.sequence = -1;
    out.verdict = mask_t::VERDICT_BLIND;
    out.reasons = static_cast<std::int32_t>(reasons.bits());
    out.count = 0;
    return parts_->encode(out);
}

MessageEncoder::Bytes MessageEncoder::ground(const FrameResult& result) {
    ground_t& out = parts_->ground;
    set_head(out, result);
    const Ground& ground = result.ground;
    const bool shown = shows_ground(result);
    const bool metric = shown && ground.metric;
    out.found = static_cast<std::int8_t>(shown);
    out.held = static_cast<std::int8_t>(shown && result.reasons.has(Reason::kHeldGround));
    out.metric = static_cast<std::int8_t>(metric);
    set_plane(out.plane, result);
    for (std::size_t i = 0; i < ground.covariance.size(); ++i)
        out.covariance[i] = wire_if(shown, ground.covariance[i]);
    out.pitch_rad = wire_if(metric, ground.pose.pitch_rad);
    out.roll_rad = wire_if(metric, ground.pose.roll_rad);
    out.height_m = wire_if(metric, ground.pose.height_m);
    out.pitch_sigma_rad = wire_if(metric, ground.sigma.pitch_rad);
    out.roll_sigma_rad = wire_if(metric, ground.sigma.roll_rad);
    out.height_sigma_m = wire_if(metric, ground.sigma.height_m);
    const GroundEvidence& fit = result.evidence.ground_fit;
    out.density = wire(fit.density);
    out.inlier_share = wire(fit.inlier_share);
    out.line_run_share = wire(fit.line_run_share);
    out.second_peak_ratio = wire(fit.second_peak_ratio);
    out.residual_rms_px = wire(fit.residual_rms_px);
    out.row_residual_px = wire(fit.row_residual_px);
    out.blocked_share = wire(fit.blocked_share);
    for (std::size_t kind = 0; kind < result.share.size(); ++kind)
        out.class_share[kind] = wire(result.share[kind]);
    if (result.verdict == Verdict::kBlind)  // of the mask as it is sent
        for (int kind = 0; kind < kTerrainClasses; ++kind)
            out.class_share[kind] = kind == mask_t::CLASS_UNKNOWN ? 1.0 : 0.0;
    return parts_->encode(out);
}

MessageEncoder::Bytes MessageEncoder::v_disparity(const FrameResult& result) {
    const ImageView<std::uint16_t>& from = result.v_disparity.histogram;
    if (from.empty()) return {};
    const int per_px = result.v_disparity.bins_per_px;
    // Quarter bins -2, -1, 0 and 1 about a whole pixel belong to it.
    const int bins = (from.width - 1 + per_px / 2) / per_px + 1;
    if (static_cast<std::size_t>(bins) > kMaxDataBytes) return {};
    const int row_scale = parts_of(from.height, static_cast<int>(kMaxDataBytes) / bins);
    const int rows = parts_of(from.height, row_scale);
    const std::size_t count = static_cast<std::size_t>(rows) * static_cast<std::size_t>(bins);

    const std::span<std::uint32_t> cells(parts_->cells.data(), count);
    std::fill(cells.begin(), cells.end(), 0U);
    for (int y = 0; y < from.height; ++y) {
        std::uint32_t* row =
            cells.data() + static_cast<std::size_t>(y / row_scale) * static_cast<std::size_t>(bins);
        for (int x = 0; x < from.width; ++x)
            row[(x + per_px / 2) / per_px] += from.at(x, y);
    }
    const std::uint32_t largest = *std::max_element(cells.begin(), cells.end());

    vdisparity_t& out = parts_->v_disparity;
    set_head(out, result);
    out.image_height = from.height;
    out.row_scale = row_scale;
    out.rows = rows;
    out.bins = bins;
    out.first_px = wire(result.v_disparity.first_px);
    out.full_scale_px = static_cast<double>(largest) / 16.0;
    const bool shown = shows_ground(result);
    const DisparityPlane& plane = result.ground.plane;
    out.line_slope = wire_if(shown, plane.dv);
    out.line_offset_px = wire_if(shown, plane.at(0.5 * (result.mask.width - 1), 0.0));
    out.size = static_cast<std::int32_t>(count);
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint64_t scaled =
            largest == 0 ? 0 : (std::uint64_t{255} * cells[i] + largest / 2) / largest;
        out.data[i] = static_cast<std::uint8_t>(cells[i] > 0 && scaled == 0 ? 1 : scaled);
    }
    return parts_->encode(out);
}

MessageEncoder::Bytes MessageEncoder::preview(const FrameResult& result) {
    const ConstLuma left = result.left;
    if (left.empty()) return {};
    const bool tint = result.verdict != Verdict::kBlind && result.mask.same_size(left.width, left.height);
    int scale = 1;
    const auto bytes = [&] {
        return std::size_t{3} * static_cast<std::size_t>(parts_of(left.width, scale)) *
               static_cast<std::size_t>(parts_of(left.height, scale));
    };
    while (bytes() > kMaxDataBytes)
        ++scale;

    image_t& out = parts_->preview;
    out.utime = result.stamp.utime_us;
    out.width = parts_of(left.width, scale);
    out.height = parts_of(left.height, scale);
    out.row_stride = 3 * out.width;
    out.pixelformat = image_t::PIXEL_FORMAT_RGB;
    out.size = static_cast<std::int32_t>(bytes());
    std::uint8_t* to = out.data.data();
    for (int top = 0; top < left.height; top += scale) {
        for (int first = 0; first < left.width; first += scale) {
            const int bottom = std::min(top + scale, left.height);
            const int last = std::min(first + scale, left.width);
            unsigned sum = 0;
            TerrainClass gravest = tint ? result.mask.at(first, top) : TerrainClass::kUnknown;
            for (int y = top; y < bottom; ++y) {
                for (int x = first; x < last; ++x) {
                    sum += left.at(x, y);
                    if (tint && gravity(result.mask.at(x, y)) > gravity(gravest))
                        gravest = result.mask.at(x, y);
                }
            }
            const auto pixels = static_cast<unsigned>((bottom - top) * (last - first));
            to = std::ranges::copy(tinted((sum + pixels / 2) / pixels, gravest), to).out;
        }
    }
    return parts_->encode(out);
}

MessageEncoder::Bytes MessageEncoder::obstacles(const FrameResult& result) {
    obstacles_t& out = parts_->obstacles;
    set_head(out, result);
    const std::size_t count = result.verdict == Verdict::kBlind ? 0 : result.obstacles.size();
    const bool metric = result.rig.calibrated && result.ground.metric;
    out.count = static_cast<std::int32_t>(count);
    for (std::size_t i = 0; i < count; ++i) {
        const Obstacle& from = result.obstacles[i];
        obstacle_t& to = out.obstacles[i];
        to.kind = static_cast<std::int8_t>(from.kind);
        to.overhang = static_cast<std::int8_t>(from.overhang);
        to.left = from.left;
        to.top = from.top;
        to.right = from.right;
        to.bottom = from.bottom;
        to.pixels = from.pixels;
        to.disparity_px = wire(from.disparity_px);
        to.range_m = wire_if(metric, from.range_m);
        to.range_sigma_m = wire_if(metric, from.range_sigma_m);
        to.bearing_rad = wire_if(metric, from.bearing_rad);
        to.left_rad = wire_if(metric, from.left_rad);
        to.right_rad = wire_if(metric, from.right_rad);
        to.width_m = wire_if(metric, from.width_m);
        to.height_m = wire_if(metric, from.height_m);
        to.lowest_m = wire_if(metric, from.lowest_m);
    }
    return parts_->encode(out);
}

MessageEncoder::Bytes MessageEncoder::grid(const FrameResult& result) {
    const TerrainGrid& from = result.grid;
    if (from.cells.empty() || from.cells.size() > kMaxGridCells) return {};
    grid_t& out = parts_->grid;
    set_head(out, result);
    out.rows = from.rows;
    out.columns = from.columns;
    out.cell_m = wire(from.cell_m);
    out.x_m = wire(from.x_m);
    out.y_m = wire(from.y_m);
    out.elevation_scale_m = kElevationScaleM;
    out.slope_scale_rad = kSlopeScaleRad;
    out.roughness_scale_m = kRoughnessScaleM;
    out.step_scale_m = kStepScaleM;
    out.index_scale = kIndexScale;
    out.cells = static_cast<std::int32_t>(from.cells.size());
    const bool blind = result.verdict == Verdict::kBlind;
    for (std::size_t k = 0; k < from.cells.size(); ++k) {
        const GridCell cell = blind ? GridCell{} : from.cells[k];
        out.kind[k] = static_cast<std::uint8_t>(cell.kind);
        out.index[k] = counts8(cell.index, kIndexScale);
        out.elevation[k] = counts16(cell.elevation_m, kElevationScaleM);
        out.highest[k] = counts16(cell.highest_m, kElevationScaleM);
        out.slope[k] = counts8(cell.slope_rad, kSlopeScaleRad);
        out.roughness[k] = counts8(cell.roughness_m, kRoughnessScaleM);
        out.step[k] = counts8(cell.step_m, kStepScaleM);
        out.points[k] = static_cast<std::uint8_t>(std::clamp(cell.points, 0, 255));
    }
    return parts_->encode(out);
}

MessageEncoder::Bytes MessageEncoder::health(const HealthReport& report) {
    health_t& out = parts_->health;
    out.utime = report.utime_us;
    out.exposure_mono_ns = report.exposure_mono_ns;
    out.stamp_source = static_cast<std::int8_t>(report.stamp_source);
    out.sequence = report.sequence;
    out.verdict = static_cast<std::int8_t>(report.verdict);
    out.reasons = static_cast<std::int32_t>(report.reasons.bits());
    out.state = static_cast<std::int8_t>(report.state);
    out.result_age_s = wire(report.result_age_s);
    out.source_rate_hz = wire(report.source_rate_hz);
    out.process_rate_hz = wire(report.process_rate_hz);
    out.publish_rate_hz = wire(report.publish_rate_hz);
    out.latency_count = static_cast<std::int32_t>(kHealthLatencies);
    for (std::size_t i = 0; i < kHealthLatencies; ++i) {
        const LatencySummary& from = i < report.stages.size()    ? report.stages[i]
                                     : i == report.stages.size() ? report.all_stages
                                                                 : report.exposure_to_publish;
        out.latencies[i].p50_ms = wire(from.p50_ms);
        out.latencies[i].p99_ms = wire(from.p99_ms);
        out.latencies[i].max_ms = wire(from.max_ms);
    }
    out.counter_count = static_cast<std::int32_t>(kHealthCounters);
    for (std::size_t i = 0; i < kHealthCounters; ++i)
        out.counters[i].value = i < report.counts.size() ? report.counts[i] : report.lcm_open_failures;
    out.pair_skew_ms = wire(report.pair_skew_ms);
    out.exposure_difference_ms = wire(report.host.exposure_difference_ms);
    out.brightness_gain = wire(report.brightness_gain);
    out.brightness_offset = wire(report.brightness_offset);
    out.camera_state =
        static_cast<std::int8_t>(report.camera.state ? static_cast<int>(*report.camera.state) : -1);
    out.camera_drift_ppm = wire(report.camera.drift_ppm);
    out.left_mean = wire(report.camera.left_mean);
    out.right_mean = wire(report.camera.right_mean);
    out.left_saturated = wire(report.camera.left_saturated);
    out.right_saturated = wire(report.camera.right_saturated);
    out.camera_fault.assign(report.camera.fault.data());
    out.epipolar_offset_px = wire(report.host.epipolar_offset_px);
    out.temperature_c = wire(report.host.temperature_c);
    out.throttled = static_cast<std::int8_t>(report.host.throttled);
    out.realtime_scheduling = static_cast<std::int8_t>(report.host.realtime_scheduling);
    out.memory_locked = static_cast<std::int8_t>(report.host.memory_locked);
    return parts_->encode(out);
}

}  // namespace groundline::publish
