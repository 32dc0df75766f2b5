#include "synth/renderer.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <span>

#include "core/deterministic_math.hpp"
#include "synth/texture.hpp"
#include "synth/world.hpp"

namespace groundline::synth {
namespace {

constexpr double kAmbient = 0.42;            // light in full shadow
constexpr double kSun = 0.68;                // and what the sun adds at right angles
constexpr Vec3 kToSun{-0.48, -0.80, -0.36};  // unit: from the left behind the camera
constexpr double kHaze_m = 160.0;            // half of the light of things this far away is haze
constexpr Colour kSoil = {78, 112, 146};
constexpr Colour kGrass = {62, 124, 108};
constexpr Colour kEarth = {58, 84, 112};  // inside a ditch
constexpr Colour kConcrete = {150, 158, 164};
constexpr Colour kPoleRed = {50, 45, 190};
constexpr Colour kHorizon = {224, 214, 200};
constexpr Colour kZenith = {206, 150, 96};

Colour blend(const Colour& a, const Colour& b, double share) {
    return {a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share, a[2] + (b[2] - a[2]) * share};
}
double limited(double x, double low, double high) {
    return x < low ? low : (x > high ? high : x);
}
std::uint8_t to_level(double x) {
    return static_cast<std::uint8_t>(limited(std::floor(x + 0.5), 0.0, 255.0));
}

// Both cameras of the rig in the world.
struct Cameras {
    const RectifiedRig& rig;
    Vec3 right_axis, down_axis, forward_axis;
    Vec3 left_eye, right_eye;

    Cameras(const RectifiedRig& the_rig, const CameraPose& camera) : rig(the_rig) {
        const double sin_pitch = det::sin(camera.pose.pitch_rad);
        const double cos_pitch = det::cos(camera.pose.pitch_rad);
        const double sin_roll = det::sin(camera.pose.roll_rad);
        const double cos_roll = det::cos(camera.pose.roll_rad);
        // The camera's axes in the world. Their y parts are the ground normal of GroundPose; z of the world
        // is the optical axis laid onto the ground.
        right_axis = {cos_roll, sin_roll * cos_pitch, -sin_pitch * sin_roll};
        down_axis = {-sin_roll, cos_roll * cos_pitch, -sin_pitch * cos_roll};
        forward_axis = {0.0, sin_pitch, cos_pitch};
        left_eye = {0.0, -camera.pose.height_m, camera.forward_m};
        right_eye = left_eye + rig.baseline_m * right_axis;
    }
    Ray ray(bool right_view, double u, double v) const {
        const double x = (u - (right_view ? rig.cx_right_px : rig.cx_px)) / rig.focal_px;
        const double y = (v - rig.cy_px) / rig.focal_px;
        return {right_view ? right_eye : left_eye, x * right_axis + y * down_axis + forward_axis};
    }
    double disparity_px(double depth) const {
        return rig.focal_px * rig.baseline_m / depth + rig.offset_px();
    }
};

// Pixels in which something may show, bounds included; empty if left > right.
struct Bounds {
    int left = 1, right = 0, top = 1, bottom = 0;
    bool has_row(int v) const { return v >= top && v <= bottom && left <= right; }
    bool has_column(int u) const { return u >= left && u <= right; }
};

// Bounds of the convex hull of points, in one view. All of the image when some lie behind the camera.
Bounds bounds_of(std::span<const Vec3> points, const Cameras& cameras, bool right_view) {
    constexpr double kNear_m = 0.02;
    const RectifiedRig& rig = cameras.rig;
    const Vec3 eye = right_view ? cameras.right_eye : cameras.left_eye;
    const double cx = right_view ? rig.cx_right_px : rig.cx_px;
    double u_low = 1e6, u_high = -1e6, v_low = 1e6, v_high = -1e6;
    std::size_t behind = 0;
    for (const Vec3& point : points) {
        const Vec3 seen = point - eye;
        const double depth = dot(seen, cameras.forward_axis);
        if (depth < kNear_m) {
            ++behind;
            continue;
        }
        const double u = cx + rig.focal_px * dot(seen, cameras.right_axis) / depth;
        const double v = rig.cy_px + rig.focal_px * dot(seen, cameras.down_axis) / depth;
        u_low = std::min(u_low, u);
        u_high = std::max(u_high, u);
        v_low = std::min(v_low, v);
        v_high = std::max(v_high, v);
    }
    if (behind == points.size()) return {};
    if (behind > 0) return {0, rig.width - 1, 0, rig.height - 1};
    const auto first = [](double x) { return static_cast<int>(limited(x - 1.0, -1.0, 1e6)); };
    const auto last = [](double x) { return static_cast<int>(limited(x + 2.0, -1.0, 1e6)); };
    return {first(u_low), last(u_high), first(v_low), last(v_high)};
}

// Where each thing and its shadow may show, in both views.
struct Layout {
    std::array<std::array<Bounds, 2>, kMaxThings> bodies;
    std::array<std::array<Bounds, 2>, kMaxThings> shadows;

    Layout(const World& world, const Cameras& cameras) {
        for (std::size_t i = 0; i < world.things().size(); ++i) {
            const PlacedThing& placed = world.things()[i];
            const Thing& thing = placed.thing;
            // Eight corners, and where the sun throws them on the lowest ground.
            std::array<Vec3, 16> points;
            std::size_t n = 0;
            for (const double side_x : {-thing.half_x_m, thing.half_x_m})
                for (const double side_z : {-thing.half_z_m, thing.half_z_m})
                    for (const double y : {placed.top_y, placed.foot_y}) {
                        const Vec3 corner{thing.x_m + placed.cos_yaw * side_x + placed.sin_yaw * side_z, y,
                                          thing.z_m - placed.sin_yaw * side_x + placed.cos_yaw * side_z};
                        const double fall = std::max(0.0, world.lowest_y() - y) / kToSun.y;
                        points[n] = corner;
                        points[8 + n++] = corner + fall * kToSun;
                    }
            for (const bool right_view : {false, true}) {
                bodies[i][right_view] = bounds_of({points.data(), 8}, cameras, right_view);
                shadows[i][right_view] = bounds_of(points, cameras, right_view);
            }
        }
    }
};

// Things that may show in one row of one view, narrowed pixel by pixel.
class RowThings {
  public:
    RowThings(const std::array<std::array<Bounds, 2>, kMaxThings>& bounds, std::size_t things,
              bool right_view, int v)
        : bounds_(bounds), right_view_(right_view) {
        for (std::size_t i = 0; i < things; ++i)
            if (bounds[i][right_view].has_row(v)) in_row_.push_back(static_cast<std::uint8_t>(i));
    }
    std::span<const std::uint8_t> at(int u) {
        at_pixel_.clear();
        for (const std::uint8_t index : in_row_)
            if (bounds_[index][right_view_].has_column(u)) at_pixel_.push_back(index);
        return {at_pixel_.data(), at_pixel_.size()};
    }

  private:
    const std::array<std::array<Bounds, 2>, kMaxThings>& bounds_;
    bool right_view_;
    ThingIndices in_row_;
    ThingIndices at_pixel_;
};

// One frame, ready to be rendered row by row.
class Stage {
  public:
    Stage(const Scene& scene, std::int64_t frame)
        : scene_(scene),
          frame_(frame),
          camera_(camera_at(scene, frame)),
          cameras_(scene.rig, camera_),
          world_(scene, camera_.forward_m),
          layout_(world_, cameras_),
          middle_(cameras_.left_eye + (0.5 * scene.rig.baseline_m) * cameras_.right_axis) {}

    void left_row(int v, std::uint8_t* luma, std::uint8_t* bgr) const {
        each_pixel(v, false, [&](int u, const Colour& colour) {
            const double noise = noise_at(false, u, v);
            const std::uint8_t blue = to_level(colour[0] + noise);
            const std::uint8_t green = to_level(colour[1] + noise);
            const std::uint8_t red = to_level(colour[2] + noise);
            luma[u] = luma_of(red, green, blue);
            if (bgr == nullptr) return;
            bgr[3 * u] = blue;
            bgr[3 * u + 1] = green;
            bgr[3 * u + 2] = red;
        });
    }

    void right_row(int v, std::uint8_t* luma) const {
        const Photometric& light = scene_.photometric;
        each_pixel(v, true, [&](int u, const Colour& colour) {
            const double level = luma_of(to_level(colour[2]), to_level(colour[1]), to_level(colour[0]));
            luma[u] = to_level(light.right_gain * level + light.right_offset + noise_at(true, u, v));
        });
    }

    void truth_row(int v, double tolerance_m, const Truth& truth) const {
        RowThings left_things(layout_.bodies, world_.things().size(), false, v);
        RowThings right_things(layout_.bodies, world_.things().size(), true, v);
        for (int u = 0; u < scene_.rig.width; ++u) {
            const Ray ray = cameras_.ray(false, u, v);
            Hit hit;
            const bool seen = world_.trace(ray, left_things.at(u), hit);
            truth.seen.at(u, v) = seen ? 1 : 0;
            truth.disparity_px.at(u, v) = 0.0;
            truth.height_m.at(u, v) = 0.0;
            truth.terrain.at(u, v) = TerrainClass::kUnknown;
            truth.occluded.at(u, v) = 0;
            if (!seen) continue;
            const Vec3 point = ray.at(hit.depth);
            const double disparity = cameras_.disparity_px(hit.depth);
            const double above_local = world_.ground_y(point.x, point.z) - point.y;
            truth.disparity_px.at(u, v) = disparity;
            truth.height_m.at(u, v) = -point.y;
            truth.terrain.at(u, v) = above_local > tolerance_m    ? TerrainClass::kObstacle
                                     : above_local < -tolerance_m ? TerrainClass::kDrop
                                                                  : TerrainClass::kTraversable;
            const double u_right = u - disparity;
            const bool outside = u_right < 0.0 || u_right > scene_.rig.width - 1;
            truth.occluded.at(u, v) = outside || hidden(u_right, v, hit.depth, right_things) ? 1 : 0;
        }
    }

  private:
    // Calls pixel(u, colour) with the mean of 2x2 rays around each pixel centre of the row.
    template <typename Pixel>
    void each_pixel(int v, bool right_view, Pixel pixel) const {
        RowThings bodies(layout_.bodies, world_.things().size(), right_view, v);
        RowThings shadows(layout_.shadows, world_.things().size(), right_view, v);
        for (int u = 0; u < scene_.rig.width; ++u) {
            const std::span<const std::uint8_t> bodies_here = bodies.at(u);
            const std::span<const std::uint8_t> shadows_here = shadows.at(u);
            Colour sum{};
            for (const double dv : {-0.25, 0.25})
                for (const double du : {-0.25, 0.25}) {
                    const Ray ray = cameras_.ray(right_view, u + du, v + dv);
                    Hit hit;
                    const Colour part = world_.trace(ray, bodies_here, hit)
                                            ? surface_colour(ray, hit, shadows_here)
                                            : sky_colour(ray);
                    for (std::size_t i = 0; i < 3; ++i)
                        sum[i] += part[i];
                }
            for (double& level : sum)
                level *= 0.25;
            pixel(u, sum);
        }
    }

    bool hidden(double u_right, int v, double depth, RowThings& right_things) const {
        Hit hit;
        const int column = static_cast<int>(u_right);
        return world_.trace(cameras_.ray(true, u_right, v), right_things.at(column), hit) &&
               hit.depth < depth * (1.0 - 1e-6);
    }

    Colour sky_colour(const Ray& ray) const {
        const double across = std::sqrt(dot(ray.direction, ray.direction));
        const double up = limited(-ray.direction.y / across, 0.0, 1.0);
        Colour colour = blend(kHorizon, kZenith, up * (2.0 - up));
        for (double& level : colour)
            level *= scene_.photometric.sky_exposure * scene_.photometric.exposure;
        return colour;
    }

    Colour surface_colour(const Ray& ray, const Hit& hit, std::span<const std::uint8_t> shadows) const {
        const Vec3 point = ray.at(hit.depth);
        // Size of a pixel on the surface, slant included. Seen from the middle of the rig, so that the colour
        // is a property of the point: both views find the same.
        const Vec3 sight = point - middle_;
        const double range2 = dot(sight, sight);
        const double towards = -dot(sight, hit.normal);
        const double slant2 = limited(towards * towards / range2, 1e-6, 1.0);
        const double footprint = hit.depth / scene_.rig.focal_px / std::sqrt(std::sqrt(slant2));

        Colour colour = material(hit, point, footprint);
        const double facing = dot(hit.normal, kToSun);
        double light = kAmbient;
        if (facing > 0.0 && !world_.blocked({point + 1e-3 * hit.normal, kToSun}, shadows))
            light += kSun * facing;
        const double relief = 1.0 + scene_.contrast * texture(point, footprint, scene_.seed);
        const double haze = hit.depth * hit.depth / (hit.depth * hit.depth + kHaze_m * kHaze_m);
        for (std::size_t i = 0; i < 3; ++i) {
            const double lit = colour[i] * light * (relief > 0.0 ? relief : 0.0);
            colour[i] = (lit + (kHorizon[i] - lit) * haze) * scene_.photometric.exposure;
        }
        return colour;
    }

    Colour material(const Hit& hit, const Vec3& point, double footprint) const {
        switch (hit.surface) {
            case Surface::kGround: {
                constexpr double kPatch_m = 2.3;
                if (footprint > 0.5 * kPatch_m) return blend(kSoil, kGrass, 0.5);
                const double patch = value_noise(point, kPatch_m, scene_.seed + 77U);
                return blend(kSoil, kGrass, limited(0.5 + 0.9 * patch, 0.0, 1.0));
            }
            case Surface::kTrenchSide:
            case Surface::kTrenchFloor:
                return kEarth;
            case Surface::kWall:
                return kConcrete;
            case Surface::kThing: {
                const PlacedThing& placed = world_.things()[hit.thing];
                const double height = placed.base_y - point.y;
                const bool banded = placed.thing.shape == Shape::kPole;
                return banded && static_cast<int>((height + 1.0) / 0.25) % 2 == 0 ? kPoleRed
                                                                                  : placed.thing.colour;
            }
        }
        return {};
    }

    double noise_at(bool right_view, int u, int v) const {
        const double sigma = scene_.photometric.noise_sigma;
        if (sigma == 0.0) return 0.0;
        const auto image = (static_cast<std::uint64_t>(frame_) << 1U) | (right_view ? 1U : 0U);
        const auto pixel = (static_cast<std::uint64_t>(v) << 32U) | static_cast<std::uint64_t>(u);
        return sigma * normal_noise(mix(mix(scene_.seed, image), pixel));
    }

    const Scene& scene_;
    std::int64_t frame_;
    CameraPose camera_;
    Cameras cameras_;
    World world_;
    Layout layout_;
    Vec3 middle_;
};

}  // namespace

Truth Truth::make(Arena& arena, int width, int height) {
    return {arena.image<double>(width, height), arena.image<double>(width, height),
            arena.image<TerrainClass>(width, height), arena.image<std::uint8_t>(width, height),
            arena.image<std::uint8_t>(width, height)};
}

DisparityPlane Renderer::plane(std::int64_t frame) const {
    return plane_of(camera_at(scene_, frame).pose, scene_.rig);
}

void Renderer::render(std::int64_t frame, Parallel& parallel, Luma left, BgrView left_bgr, Luma right) const {
    const Stage stage(scene_, frame);
    parallel.for_each(scene_.rig.height, [&](int v, int) {
        stage.left_row(v, left.row(v), left_bgr.empty() ? nullptr : left_bgr.row(v));
        stage.right_row(v, right.row(v));
    });
}

void Renderer::render_truth(std::int64_t frame, Parallel& parallel, double tolerance_m,
                            const Truth& truth) const {
    const Stage stage(scene_, frame);
    parallel.for_each(scene_.rig.height, [&](int v, int) { stage.truth_row(v, tolerance_m, truth); });
}

}  // namespace groundline::synth
