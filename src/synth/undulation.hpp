// The sinusoidal waves of the ground: height, slope, and where a ray first meets them.
#pragma once

#include <span>

#include "core/fixed_vector.hpp"
#include "synth/ray.hpp"
#include "synth/scene.hpp"

namespace groundline::synth {

class Undulation {
  public:
    explicit Undulation(std::span<const Wave> waves);

    double limit_m() const { return limit_m_; }  // the most it departs from the mean
    double y(double x, double z) const;
    Vec3 normal(double x, double z) const;  // unit, upwards

    // First depth in from .. to at which the ray, which goes down and comes from above, reaches the waves
    // around level_y. Exact to 1e-13 m. Farther away than 200 m the ground is its mean plane: a wave of 10 cm
    // is a quarter of a pixel there.
    bool meet(const Ray& ray, double level_y, double from, double to, double& depth) const;

  private:
    struct Term {
        double amplitude_m, per_x, per_z, phase;  // turns per metre, turns
    };
    struct AlongRay;

    FixedVector<Term, 3> terms_;
    double limit_m_ = 0.0;
};

}  // namespace groundline::synth
