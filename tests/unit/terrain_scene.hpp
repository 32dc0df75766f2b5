// Truth disparities of simple worlds, computed ray by ray from their formulas, and the noise put on them.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <random>
#include <thread>
#include <vector>

#include "core/arena.hpp"
#include "core/deterministic_math.hpp"
#include "core/disparity.hpp"
#include "core/ground.hpp"
#include "core/parallel.hpp"

namespace groundline::test {

inline RectifiedRig rig_of(int width = 640, int height = 480, double focal_px = 500.0,
                           double baseline_m = 0.12) {
    RectifiedRig rig;
    rig.width = width;
    rig.height = height;
    rig.calibrated = true;
    rig.focal_px = focal_px;
    rig.cx_px = rig.cx_right_px = 0.5 * width - 0.5;
    rig.cy_px = 0.5 * height - 0.5;
    rig.baseline_m = baseline_m;
    return rig;
}

inline GroundPose pose_deg(double pitch_deg, double roll_deg, double height_m) {
    return {det::radians(pitch_deg), det::radians(roll_deg), height_m};
}

// On the ground: forward and left of the camera's foot point, metres; from `bottom_m` to `top_m` above it.
struct Box {
    double forward_m, left_m;  // middle of the near face
    double width_m, depth_m, top_m;
    double bottom_m = 0.0;
};

struct World {
    RectifiedRig rig;
    GroundPose pose;
    std::vector<Box> boxes;
    bool ground = true;
    double wall_m = 0.0;  // an upright wall across the view, forward; 0: none
    // A ditch across the view: from, to, depth; depth 0: none.
    double ditch_from_m = 0.0, ditch_to_m = 0.0, ditch_depth_m = 0.0;
};

// What a ray meets: depth along the optical axis (0: nothing), height above the ground, which box.
struct Hit {
    double depth_m = 0.0;
    double height_m = 0.0;
    int box = -1;
};

class Rays {
  public:
    explicit Rays(const World& world) : world_(world) {
        const double cos_pitch = std::cos(world.pose.pitch_rad);
        normal_[0] = std::sin(world.pose.roll_rad) * cos_pitch;
        normal_[1] = std::cos(world.pose.roll_rad) * cos_pitch;
        normal_[2] = std::sin(world.pose.pitch_rad);
        const double nz = normal_[2];
        const double norm = std::sqrt(1.0 - nz * nz);
        for (int i = 0; i < 3; ++i)
            forward_[i] = ((i == 2 ? 1.0 : 0.0) - nz * normal_[i]) / norm;
        for (int i = 0; i < 3; ++i)
            left_[i] =
                forward_[(i + 1) % 3] * normal_[(i + 2) % 3] - forward_[(i + 2) % 3] * normal_[(i + 1) % 3];
    }

    // Per metre of depth: forward, left, down along the ground.
    void direction(double u, double v, double (&out)[3]) const {
        const double ray[3] = {(u - world_.rig.cx_px) / world_.rig.focal_px,
                               (v - world_.rig.cy_px) / world_.rig.focal_px, 1.0};
        for (double& value : out)
            value = 0.0;
        for (int i = 0; i < 3; ++i) {
            out[0] += ray[i] * forward_[i];
            out[1] += ray[i] * left_[i];
            out[2] += ray[i] * normal_[i];
        }
    }

    Hit cast(double u, double v) const {
        double along[3];
        direction(u, v, along);
        const double height = world_.pose.height_m;
        Hit hit;
        const auto nearer = [&](double depth, double level, int box) {
            if (depth > 0.0 && (hit.depth_m <= 0.0 || depth < hit.depth_m)) hit = {depth, level, box};
        };
        if (world_.ground && along[2] > 1e-9) {
            const double depth = height / along[2];
            const double forward = depth * along[0];
            const bool over_ditch =
                world_.ditch_depth_m > 0.0 && forward > world_.ditch_from_m && forward < world_.ditch_to_m;
            if (!over_ditch) {
                nearer(depth, 0.0, -1);
            } else {
                const double far_wall = world_.ditch_to_m / along[0];
                const double level = height - far_wall * along[2];
                if (level > -world_.ditch_depth_m) {
                    nearer(far_wall, level, -1);
                } else {
                    nearer((height + world_.ditch_depth_m) / along[2], -world_.ditch_depth_m, -1);
                }
            }
        }
        if (world_.wall_m > 0.0 && along[0] > 0.0) {
            const double depth = world_.wall_m / along[0];
            const double level = height - depth * along[2];
            if (level >= 0.0 || !world_.ground) nearer(depth, level, -1);
        }
        for (std::size_t b = 0; b < world_.boxes.size(); ++b) {
            const Box& box = world_.boxes[b];
            const double low[3] = {box.forward_m, box.left_m - 0.5 * box.width_m, height - box.top_m};
            const double high[3] = {box.forward_m + box.depth_m, box.left_m + 0.5 * box.width_m,
                                    height - box.bottom_m};
            double enter = 0.0;
            double leave = 1e30;
            for (int i = 0; i < 3; ++i) {
                const double slope = std::fabs(along[i]) < 1e-12 ? 1e-12 : along[i];
                const double one = low[i] / slope;
                const double other = high[i] / slope;
                enter = std::max(enter, std::min(one, other));
                leave = std::min(leave, std::max(one, other));
            }
            if (enter > 0.0 && enter < leave) nearer(enter, height - enter * along[2], static_cast<int>(b));
        }
        return hit;
    }

  private:
    World world_;
    double normal_[3];
    double forward_[3];
    double left_[3];
};

struct Noise {
    double sigma_px = 0.0;
    double outlier_share = 0.0;  // uniform over the search range
    double missing_share = 0.0;
    std::uint32_t seed = 1;
};

// Deterministic normal and uniform numbers.
class Dice {
  public:
    explicit Dice(std::uint32_t seed) : random_(seed) {}
    double uniform() { return (random_() + 0.5) / 4294967296.0; }
    double between(double low, double high) { return low + (high - low) * uniform(); }
    double normal() {
        double sum = -6.0;
        for (int i = 0; i < 12; ++i)
            sum += uniform();
        return sum;
    }
    std::uint32_t bits() { return random_(); }

  private:
    std::mt19937 random_;
};

// The world's disparities in sixteenths, as a perfect matcher with this search range would give them: beyond
// its far end nothing is invalid but infinity, nearer than its last disparity it says range edge.
inline void render(const World& world, int min_disparity, int disparities, const Noise& noise,
                   DisparityMap& map) {
    const Rays rays(world);
    Dice dice(noise.seed);
    const double scale = world.rig.focal_px * world.rig.baseline_m;
    const double last = min_disparity + disparities - 1;
    for (int v = 0; v < map.height(); ++v) {
        for (int u = 0; u < map.width(); ++u) {
            const Hit hit = rays.cast(u, v);
            double d_px = hit.depth_m > 0.0 ? scale / hit.depth_m + world.rig.offset_px() : -1e9;
            if (noise.sigma_px > 0.0) d_px += noise.sigma_px * dice.normal();
            if (noise.outlier_share > 0.0 && dice.uniform() < noise.outlier_share)
                d_px = dice.between(min_disparity, last);
            const bool missing = noise.missing_share > 0.0 && dice.uniform() < noise.missing_share;
            Invalid reason = Invalid::kNone;
            if (d_px > last + 0.5) reason = Invalid::kRangeEdge;
            if (d_px < min_disparity || missing) reason = Invalid::kTexture;
            map.invalid.at(u, v) = reason;
            map.disparity_q4.at(u, v) =
                reason == Invalid::kNone ? static_cast<std::int16_t>(std::floor(16.0 * d_px + 0.5)) : 0;
        }
    }
}

// Hands tasks to real threads in whatever order they take them.
class Threads final : public Parallel {
  public:
    explicit Threads(int lanes) : lanes_(lanes) {}
    int lanes() const override { return lanes_; }
    void for_each(int count, FunctionRef<void(int, int)> task) override {
        std::atomic<int> next{0};
        std::vector<std::thread> threads;
        for (int lane = 0; lane < lanes_; ++lane)
            threads.emplace_back([&, lane] {
                for (int index = next++; index < count; index = next++)
                    task(index, lane);
            });
        for (std::thread& thread : threads)
            thread.join();
    }

  private:
    int lanes_;
};

template <typename T>
bool same_pixels(ImageView<const T> one, ImageView<const T> other) {
    for (int v = 0; v < one.height; ++v)
        for (int u = 0; u < one.width; ++u)
            if (one.at(u, v) != other.at(u, v)) return false;
    return one.width == other.width && one.height == other.height;
}

}  // namespace groundline::test
