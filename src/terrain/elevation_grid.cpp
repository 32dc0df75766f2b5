#include "terrain/elevation_grid.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <string>

#include "core/deterministic_math.hpp"
#include "core/error.hpp"
#include "terrain/body_frame.hpp"

namespace groundline::terrain {
namespace {

constexpr int kReach = 2;  // cells either side of the one whose slope is fitted
constexpr int kWindow = 2 * kReach + 1;
constexpr std::int32_t kEnoughPoints = 3;
constexpr std::int32_t kEnoughToFit = 12;     // points in the window: four cells' worth
constexpr std::int32_t kMostPoints = 32'767;  // of a cell: keeps all sums below 2^53
constexpr int kParts = 256;                   // of a cell, in its points' places
constexpr double kUnitM = 1e-4;               // of their heights
constexpr double kHighestM = 3.2;             // beyond this, heights are cut off: 15 bits
// Variance of the points' places in the window, in cells: three of five cells in a row have 0.67.
constexpr double kLeastSpread = 0.5;
constexpr double kLeastIndependence = 0.1;  // 1 - correlation^2 of x and y: 0 where all lie in a line
constexpr double kSamplesAcross = 4.0;
constexpr double kSamplesAlong = 3.0;
constexpr double kMaxStep = 16.0;  // px between samples
constexpr int kStepAboveHorizon = 4;
constexpr std::int32_t kLowest = std::numeric_limits<std::int32_t>::min();
constexpr double kUnseen = std::numeric_limits<double>::quiet_NaN();

constexpr bool known(double value) {
    return value == value;
}

int cells_of(double length_m, double cell_m) {
    return std::max(1, static_cast<int>(std::min(length_m / cell_m, 1e6) + 0.5));
}

std::string short_number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.6g", value);
    return text;
}

struct Extent {
    int rows;
    int columns;
};

// The cells of the configured extent, or a refusal that says what would fit.
Extent checked_extent(const GridConfig& config) {
    const auto most = static_cast<long long>(kMaxGridCells);
    const int rows = cells_of(config.forward_m, config.cell_m);
    const int columns = 2 * cells_of(config.side_m, config.cell_m);
    if (static_cast<long long>(rows) * columns <= most) return {rows, columns};
    double fitting_cm = std::floor(100.0 * config.cell_m);
    while (static_cast<long long>(cells_of(100.0 * config.forward_m, fitting_cm)) * 2 *
               cells_of(100.0 * config.side_m, fitting_cm) >
           most)
        fitting_cm += 1.0;
    std::string advice = "expected grid.cell_m of " + short_number(0.01 * fitting_cm) + " or more";
    const auto fitting_rows = static_cast<int>(most / columns);
    if (fitting_rows > 0)
        advice += ", or grid.forward_m of " + short_number(fitting_rows * config.cell_m) + " or less";
    throw Refusal(ExitStatus::kConfig,
                  "the grid of " + std::to_string(rows) + " x " + std::to_string(columns) +
                      " cells (grid.forward_m " + short_number(config.forward_m) + ", grid.side_m " +
                      short_number(config.side_m) + ", grid.cell_m " + short_number(config.cell_m) +
                      ") does not fit one message of " + std::to_string(most) + " cells: " + advice);
}

// 0 easy, 1 medium, 2 hard.
double grade(double value, const IndexRules::Limits& limits) {
    return 2.0 * std::clamp((value - limits.easy) / (limits.hard - limits.easy), 0.0, 1.0);
}

// What both slopes agree on: 0 where they point apart, else the gentler one; one alone is believed.
double common_slope(double one, double other) {
    if (!known(one)) return known(other) ? other : 0.0;
    if (!known(other)) return one;
    if (one * other <= 0.0) return 0.0;
    return std::fabs(one) < std::fabs(other) ? one : other;
}

double beyond_noise(double square, double noise) {
    return std::sqrt(std::max(square - noise * noise, 0.0));
}

void raise(std::int32_t& highest, std::int32_t& second, std::int32_t height) {
    second = std::max(second, std::min(highest, height));
    highest = std::max(highest, height);
}

std::int32_t height_units(double height_m) {
    return static_cast<std::int32_t>(std::clamp(height_m, -kHighestM, kHighestM) * (1.0 / kUnitM));
}

}  // namespace

IndexRules IndexRules::of(const GridConfig& grid, const TerrainConfig& config) {
    const double steep = det::radians(grid.steep_deg);
    const double tolerance = std::min(config.tolerance_up_m, config.tolerance_down_m);
    return {{0.2 * steep, steep}, {0.1 * tolerance, 0.5 * tolerance}, {0.25 * tolerance, tolerance}};
}

double IndexRules::index(double slope, double roughness, double step) const {
    const double grades[3] = {grade(slope, slope_rad), grade(roughness, roughness_m), grade(step, step_m)};
    if (grades[0] + grades[1] + grades[2] == 0.0) return 1.0;
    // Degrees of membership in easy, medium and hard.
    double degrees[3][3];
    for (int input = 0; input < 3; ++input) {
        degrees[input][0] = std::max(1.0 - grades[input], 0.0);
        degrees[input][1] = 1.0 - std::fabs(grades[input] - 1.0);
        degrees[input][2] = std::max(grades[input] - 1.0, 0.0);
    }
    double sum = 0.0;
    for (int a = 0; a < 2; ++a)
        for (int b = 0; b < 2; ++b)
            for (int c = 0; c < 2; ++c)  // every rule with a hard one concludes 0
                sum += degrees[0][a] * degrees[1][b] * degrees[2][c] * (3 - a - b - c) * (1.0 / 3.0);
    return sum;
}

TerrainGrid make_terrain_grid(const GridConfig& config, Arena& arena) {
    TerrainGrid grid;
    if (!config.on) return grid;
    const Extent extent = checked_extent(config);
    grid.rows = extent.rows;
    grid.columns = extent.columns;
    grid.cell_m = config.cell_m;
    grid.y_m = -0.5 * extent.columns * config.cell_m;
    grid.cells = arena.take<GridCell>(static_cast<std::size_t>(extent.rows * extent.columns));
    std::fill(grid.cells.begin(), grid.cells.end(), GridCell{});
    return grid;
}

void ElevationGrid::Moments::add(const Moments& other) {
    n += other.n;
    x += other.x;
    y += other.y;
    xx += other.xx;
    xy += other.xy;
    yy += other.yy;
    z += other.z;
    xz += other.xz;
    yz += other.yz;
    zz += other.zz;
}

void ElevationGrid::Moments::subtract(const Moments& other) {
    n -= other.n;
    x -= other.x;
    y -= other.y;
    xx -= other.xx;
    xy -= other.xy;
    yy -= other.yy;
    z -= other.z;
    xz -= other.xz;
    yz -= other.yz;
    zz -= other.zz;
}

// One frame's geometry. A pixel's place in cells is first + (row_u u + row_v v + row_0) / d.
struct ElevationGrid::View {
    BodyFrame body;
    DisparityPlane ground;  // of true disparity
    double offset_px = 0.0;
    double scale = 0.0;  // f b
    double height_m = 0.0;
    double row_first = 0.0, row_u = 0.0, row_v = 0.0, row_0 = 0.0;
    double column_first = 0.0, column_u = 0.0, column_v = 0.0, column_0 = 0.0;
};

ElevationGrid::ElevationGrid(const GridConfig& grid, const TerrainConfig& config, const RectifiedRig& rig,
                             int min_disparity, int disparities, Arena& arena)
    : config_(grid),
      terrain_(config),
      rig_(rig),
      rules_(IndexRules::of(grid, config)),
      last_disparity_(min_disparity + disparities - 1) {
    const Extent extent = checked_extent(grid);
    rows_ = extent.rows;
    columns_ = extent.columns;
    const auto cells = static_cast<std::size_t>(rows_ * columns_);
    points_ = arena.take<Points>(cells);
    levels_ = arena.take<double>(cells);
    strip_ = arena.take<Moments>(static_cast<std::size_t>(columns_ + kWindow));
    recent_ = arena.take<Moments>(static_cast<std::size_t>(kWindow * columns_));
}

ElevationGrid::View ElevationGrid::view_of(const Ground& ground) const {
    View view;
    view.body = body_frame(ground.pose, rig_, terrain_);
    view.ground = ground.plane;
    view.offset_px = rig_.offset_px();
    view.ground.d0 -= view.offset_px;
    view.scale = rig_.focal_px * rig_.baseline_m;
    view.height_m = ground.pose.height_m;
    const double per_cell = 1.0 / config_.cell_m;
    view.row_first = view.body.x_m * per_cell;
    view.row_u = view.body.x_u * view.scale * per_cell;
    view.row_v = view.body.x_v * view.scale * per_cell;
    view.row_0 = view.body.x_0 * view.scale * per_cell;
    view.column_first = view.body.y_m * per_cell + 0.5 * columns_;
    view.column_u = view.body.y_u * view.scale * per_cell;
    view.column_v = view.body.y_v * view.scale * per_cell;
    view.column_0 = view.body.y_0 * view.scale * per_cell;
    return view;
}

void ElevationGrid::add_ground(ConstDisparityMap map, const View& view, ConstMask mask) {
    // What is within the tolerance has at most 1 / (1 - tolerance / h) times the ground's disparity: rows
    // where even that is beyond the farthest corner hold nothing for us.
    const double nearest_share = 1.0 - std::min(terrain_.tolerance_up_m / view.height_m, 1.0);
    double farthest_m = 0.0;
    for (const double x : {0.0, rows_ * config_.cell_m})
        for (const double y : {-0.5 * columns_ * config_.cell_m, 0.5 * columns_ * config_.cell_m})
            farthest_m = std::max(farthest_m, view.body.depth_m(x, y));
    farthest_m += terrain_.tolerance_down_m;
    const double cell_px = rig_.focal_px * config_.cell_m;

    for (int v = 0, row_step = 1; v < mask.height; v += row_step) {
        const double nearest_px = std::max(view.ground.at(0.0, v), view.ground.at(rig_.width - 1.0, v));
        row_step = 1;
        if (nearest_px * farthest_m < view.scale * nearest_share || nearest_px <= 0.0) continue;
        // The farther end decides, so that no cell of the row goes short.
        const double least_px = std::min(view.ground.at(0.0, v), view.ground.at(rig_.width - 1.0, v));
        const double depth_m = std::min(view.scale / std::max(least_px, 1.0 / kDisparityOne), farthest_m);
        row_step = static_cast<int>(
            std::clamp(cell_px * view.height_m / (depth_m * depth_m) / kSamplesAlong, 1.0, kMaxStep));
        const int column_step =
            static_cast<int>(std::clamp(cell_px / depth_m / kSamplesAcross, 1.0, kMaxStep));
        const TerrainClass* kinds = mask.row(v);
        const std::int16_t* disparity = map.disparity_q4.row(v);
        const double row_v = view.row_v * v + view.row_0;
        const double column_v = view.column_v * v + view.column_0;
        const double ground_v = view.ground.dv * v + view.ground.d0;
        for (int u = 0; u < mask.width; u += column_step) {
            if (kinds[u] != TerrainClass::kTraversable) continue;
            const double inverse_px = 1.0 / (disparity[u] * (1.0 / kDisparityOne) - view.offset_px);
            const double row = view.row_first + (view.row_u * u + row_v) * inverse_px;
            const double column = view.column_first + (view.column_u * u + column_v) * inverse_px;
            if (!(row >= 0.0 && row < rows_ && column >= 0.0 && column < columns_)) continue;
            const int i = static_cast<int>(row);
            const int j = static_cast<int>(column);
            Points& cell = points_[static_cast<std::size_t>(i * columns_ + j)];
            if (cell.n == kMostPoints) continue;
            const std::int32_t z =
                height_units(view.height_m * (1.0 - (view.ground.du * u + ground_v) * inverse_px));
            ++cell.n;
            cell.x += static_cast<std::int32_t>((row - i) * kParts);
            cell.y += static_cast<std::int32_t>((column - j) * kParts);
            cell.z += z;
            cell.zz += std::int64_t{z} * z;
            raise(cell.highest, cell.second, z);
        }
    }
}

void ElevationGrid::add_things(ConstDisparityMap map, const View& view, ConstMask mask) {
    // Classes 2 and 3 are those with this bit: most of a picture has none of them, eight pixels at a look.
    constexpr std::uint64_t kThingBits = 0x0202020202020202U;
    static_assert(static_cast<int>(TerrainClass::kObstacle) == 2 &&
                  static_cast<int>(TerrainClass::kDrop) == 3);
    for (int v = 0, row_step = 1; v < mask.height; v += row_step) {
        const bool below = view.ground.at(0.0, v) > 0.0 || view.ground.at(rig_.width - 1.0, v) > 0.0;
        row_step = below ? 1 : kStepAboveHorizon;
        const TerrainClass* kinds = mask.row(v);
        const std::int16_t* disparity = map.disparity_q4.row(v);
        const Invalid* invalid = map.invalid.row(v);
        for (int first = 0; first < mask.width; first += 8) {
            const int end = std::min(first + 8, mask.width);
            std::uint64_t word = 0;
            std::memcpy(&word, kinds + first, 8);  // the last may reach into the padding: no harm but a look
            if ((word & kThingBits) == 0) continue;
            for (int u = first; u < end; ++u) {
                if (kinds[u] != TerrainClass::kObstacle && kinds[u] != TerrainClass::kDrop) continue;
                const double measured_px = invalid[u] == Invalid::kRangeEdge
                                               ? last_disparity_
                                               : disparity[u] * (1.0 / kDisparityOne);
                const double inverse_px = 1.0 / std::max(measured_px - view.offset_px, 1.0 / kDisparityOne);
                const double row =
                    view.row_first + (view.row_u * u + view.row_v * v + view.row_0) * inverse_px;
                const double column =
                    view.column_first + (view.column_u * u + view.column_v * v + view.column_0) * inverse_px;
                if (!(row >= 0.0 && row < rows_ && column >= 0.0 && column < columns_)) continue;
                Points& cell = points_[static_cast<std::size_t>(static_cast<int>(row) * columns_ +
                                                                static_cast<int>(column))];
                const std::int32_t z =
                    height_units(view.height_m * (1.0 - view.ground.at(u, v) * inverse_px));
                ++(kinds[u] == TerrainClass::kObstacle ? cell.obstacles : cell.drops);
                cell.thing_z += z;
                raise(cell.highest, cell.second, z);
            }
        }
    }
}

void ElevationGrid::classify_cells(TerrainGrid& grid) {
    for (std::size_t i = 0; i < points_.size(); ++i) {
        const Points& points = points_[i];
        GridCell& cell = grid.cells[i];
        cell = {};
        levels_[i] = kUnseen;
        const std::int32_t things = points.obstacles + points.drops;
        if (things > 0) {
            cell.kind = points.obstacles > 0 ? TerrainClass::kObstacle : TerrainClass::kDrop;
            cell.points = things;
        } else if (points.n >= kEnoughPoints) {
            cell.kind = TerrainClass::kTraversable;
            cell.points = points.n;
        } else {
            continue;
        }
        const auto sum = static_cast<double>(things > 0 ? points.thing_z : points.z);
        const double mean_m = kUnitM * sum / cell.points;
        const double highest_m = kUnitM * (points.second > kLowest ? points.second : points.highest);
        cell.elevation_m = static_cast<float>(mean_m);
        cell.highest_m = static_cast<float>(highest_m);
        levels_[i] = cell.kind == TerrainClass::kObstacle ? highest_m : mean_m;
        if (cell.kind != TerrainClass::kTraversable) cell.index = 0.0F;
    }
}

ElevationGrid::Moments ElevationGrid::moments_of(int row, int column) const {
    const Points& points = points_[static_cast<std::size_t>(row * columns_ + column)];
    if (points.n == 0) return {};
    const std::int64_t n = points.n;
    const std::int64_t x = n * row * kParts + points.x;
    const std::int64_t y = n * column * kParts + points.y;
    const std::int64_t z = points.z;
    const double share = 1.0 / points.n;
    const double x_mean = static_cast<double>(x) * share;
    const double y_mean = static_cast<double>(y) * share;
    const auto product = [](double one, std::int64_t other) {
        return static_cast<std::int64_t>(one * static_cast<double>(other));
    };
    return {n,
            x,
            y,
            product(x_mean, x),
            product(x_mean, y),
            product(y_mean, y),
            z,
            product(x_mean, z),
            product(y_mean, z),
            points.zz};
}

// From the rows about row - 1 to those about `row`; starts anew at row 0.
void ElevationGrid::advance_strip(int row) {
    const auto enter = [&](int i) {
        for (int j = 0; j < columns_; ++j) {
            Moments& moments = recent_[static_cast<std::size_t>(i % kWindow * columns_ + j)];
            moments = moments_of(i, j);
            strip_[static_cast<std::size_t>(j + kReach)].add(moments);
        }
    };
    if (row == 0) {
        std::fill(strip_.begin(), strip_.end(), Moments{});
        for (int i = 0; i < std::min(kReach, rows_); ++i)
            enter(i);
    }
    if (row > kReach)
        for (int j = 0; j < columns_; ++j)
            strip_[static_cast<std::size_t>(j + kReach)].subtract(
                recent_[static_cast<std::size_t>((row - kReach - 1) % kWindow * columns_ + j)]);
    if (row + kReach < rows_) enter(row + kReach);
}

// With `stride` between neighbours in a line of `length` cells; NaN where no neighbour is known.
double ElevationGrid::step_along(std::size_t at, int position, int length, std::ptrdiff_t stride) const {
    const auto level = [&](int away) {
        if (position + away < 0 || position + away >= length) return kUnseen;
        return levels_[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(at) + away * stride)];
    };
    const double here = level(0);
    const double before = level(-1);
    const double after = level(1);
    const double slope = common_slope(before - level(-2), level(2) - after);
    double step = kUnseen;
    if (known(before) && known(after)) {
        const double over_both = std::fabs(after - before - 2.0 * slope);
        const double over_middle = std::fabs(here - 0.5 * (before + after));
        step = std::max(over_both, over_middle);
    } else if (known(before)) {
        step = std::fabs(here - before - slope);
    } else if (known(after)) {
        step = std::fabs(after - here - slope);
    }
    return step;
}

void ElevationGrid::measure_cell(const View& view, const Moments& window, int row, int column,
                                 GridCell& cell) const {
    const double x_m = (row + 0.5) * config_.cell_m;
    const double y_m = (column + 0.5 - 0.5 * columns_) * config_.cell_m;
    const double noise_m =
        view.height_m * terrain_.sigma_disparity_px * std::max(view.body.depth_m(x_m, y_m), 0.0) / view.scale;
    if (noise_m > 0.25 * std::min(terrain_.tolerance_up_m, terrain_.tolerance_down_m)) return;

    const auto at = static_cast<std::size_t>(row * columns_ + column);
    double step = step_along(at, row, rows_, columns_);
    const double across = step_along(at, column, columns_, 1);
    if (known(across) && !(step > across)) step = across;
    if (known(step)) {
        step = beyond_noise(step * step, noise_m);
        cell.step_m = static_cast<float>(step);
    }
    if (cell.kind != TerrainClass::kTraversable || window.n < kEnoughToFit) return;

    const auto n = static_cast<double>(window.n);
    const double per_place = 1.0 / (n * kParts);
    const double per_square = per_place / kParts;
    const double per_height = kUnitM / n;
    const double x = static_cast<double>(window.x) * per_place;
    const double y = static_cast<double>(window.y) * per_place;
    const double z = static_cast<double>(window.z) * per_height;
    const double xx = static_cast<double>(window.xx) * per_square - x * x;
    const double xy = static_cast<double>(window.xy) * per_square - x * y;
    const double yy = static_cast<double>(window.yy) * per_square - y * y;
    const double xz = static_cast<double>(window.xz) * per_place * kUnitM - x * z;
    const double yz = static_cast<double>(window.yz) * per_place * kUnitM - y * z;
    const double zz = static_cast<double>(window.zz) * per_height * kUnitM - z * z;
    const double determinant = xx * yy - xy * xy;
    if (xx < kLeastSpread || yy < kLeastSpread || determinant < kLeastIndependence * xx * yy) return;
    const double rise_x = (xz * yy - yz * xy) / determinant;
    const double rise_y = (yz * xx - xz * xy) / determinant;
    const double steepness = rise_x * rise_x + rise_y * rise_y;
    const double slope = det::atan(std::sqrt(steepness) / config_.cell_m);
    const double left = zz - rise_x * xz - rise_y * yz - steepness * (1.0 / 12.0);
    const double residual = std::max(left, 0.0) * n / (n - 3.0);
    const double roughness = beyond_noise(residual, noise_m);
    cell.slope_rad = static_cast<float>(slope);
    cell.roughness_m = static_cast<float>(roughness);
    if (known(step)) cell.index = static_cast<float>(rules_.index(slope, roughness, step));
}

void ElevationGrid::find(ConstDisparityMap map, const Ground& ground, ConstMask mask, TerrainGrid& grid) {
    assert(grid.rows == rows_ && grid.columns == columns_);
    Points empty{};
    empty.highest = empty.second = kLowest;
    std::fill(points_.begin(), points_.end(), empty);
    const bool usable = rig_.calibrated && ground.found && ground.metric && ground.pose.height_m > 0.0;
    if (!usable) {
        classify_cells(grid);
        return;
    }
    assert(mask.same_size(rig_.width, rig_.height));
    const View view = view_of(ground);
    add_ground(map, view, mask);
    add_things(map, view, mask);
    classify_cells(grid);
    for (int i = 0; i < rows_; ++i) {
        advance_strip(i);
        Moments window{};
        for (int j = 0; j < kWindow - 1; ++j)
            window.add(strip_[static_cast<std::size_t>(j)]);
        for (int j = 0; j < columns_; ++j) {
            window.add(strip_[static_cast<std::size_t>(j + kWindow - 1)]);
            GridCell& cell = grid.at(i, j);
            if (cell.kind != TerrainClass::kUnknown) measure_cell(view, window, i, j, cell);
            window.subtract(strip_[static_cast<std::size_t>(j)]);
        }
    }
}

}  // namespace groundline::terrain
