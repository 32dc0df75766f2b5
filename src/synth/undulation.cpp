#include "synth/undulation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/deterministic_math.hpp"

namespace groundline::synth {
namespace {

constexpr double kUndulatingTo_m = 200.0;
constexpr double kTurn = 2.0 * det::kPi;

struct SinCos {
    double sin, cos;
};

// Both of an angle in turns (|turns| < 2^31), within 1e-11; several times as fast as the general functions,
// which matters here alone: it is evaluated some ten million times a frame.
SinCos sin_cos_turns(double turns) {
    const double shifted = turns + (turns < 0.0 ? -0.5 : 0.5);
    double rest = turns - static_cast<double>(static_cast<std::int32_t>(shifted));  // -1/2 .. 1/2
    const bool back = rest > 0.25 || rest < -0.25;
    if (back) rest = (rest > 0.0 ? 0.5 : -0.5) - rest;
    const double x = kTurn * rest;
    const double z = x * x;
    // Taylor series on |x| <= pi/2.
    double sine = -1.0 / 1307674368000.0;
    sine = 1.0 / 6227020800.0 + z * sine;
    sine = -1.0 / 39916800.0 + z * sine;
    sine = 1.0 / 362880.0 + z * sine;
    sine = -1.0 / 5040.0 + z * sine;
    sine = 1.0 / 120.0 + z * sine;
    sine = -1.0 / 6.0 + z * sine;
    sine = x + x * z * sine;
    double cosine = 1.0 / 20922789888000.0;
    cosine = -1.0 / 87178291200.0 + z * cosine;
    cosine = 1.0 / 479001600.0 + z * cosine;
    cosine = -1.0 / 3628800.0 + z * cosine;
    cosine = 1.0 / 40320.0 + z * cosine;
    cosine = -1.0 / 720.0 + z * cosine;
    cosine = 1.0 / 24.0 + z * cosine;
    cosine = -1.0 / 2.0 + z * cosine;
    cosine = 1.0 + z * cosine;
    return {sine, back ? -cosine : cosine};
}

}  // namespace

Undulation::Undulation(std::span<const Wave> waves) {
    for (const Wave& wave : waves) {
        terms_.push_back({wave.amplitude_m, det::sin(wave.heading_rad) / wave.length_m,
                          det::cos(wave.heading_rad) / wave.length_m, wave.phase_rad / kTurn});
        limit_m_ += wave.amplitude_m;
    }
}

double Undulation::y(double x, double z) const {
    double sum = 0.0;
    for (const Term& wave : terms_)
        sum -= wave.amplitude_m * sin_cos_turns(wave.per_x * x + wave.per_z * z + wave.phase).sin;
    return sum;
}

Vec3 Undulation::normal(double x, double z) const {
    // Of y = g(x, z), y down: (dg/dx, -1, dg/dz) up to its length.
    double slope_x = 0.0;
    double slope_z = 0.0;
    for (const Term& wave : terms_) {
        const SinCos turned = sin_cos_turns(wave.per_x * x + wave.per_z * z + wave.phase);
        slope_x -= kTurn * wave.amplitude_m * turned.cos * wave.per_x;
        slope_z -= kTurn * wave.amplitude_m * turned.cos * wave.per_z;
    }
    const double scale = 1.0 / std::sqrt(1.0 + slope_x * slope_x + slope_z * slope_z);
    return {slope_x * scale, -scale, slope_z * scale};
}

// The undulation along one ray.
struct Undulation::AlongRay {
    struct Phase {
        double amplitude_m, at, rate;  // rate in turns per depth
    };
    struct State {
        double gap;    // metres below the ground, negative above it
        double slope;  // and its change with depth
    };
    FixedVector<Phase, 3> terms;
    double gap0 = 0.0;
    double descent = 0.0;
    double curvature = 0.0;  // bound of the second derivative of the gap

    AlongRay(const Undulation& waves, const Ray& ray, double level_y)
        : gap0(ray.origin.y - level_y), descent(ray.direction.y) {
        for (const Undulation::Term& wave : waves.terms_) {
            const double at = wave.per_x * ray.origin.x + wave.per_z * ray.origin.z + wave.phase;
            const double rate = wave.per_x * ray.direction.x + wave.per_z * ray.direction.z;
            terms.push_back({wave.amplitude_m, at, rate});
            curvature += wave.amplitude_m * (kTurn * rate) * (kTurn * rate);
        }
    }
    State at(double depth) const {
        State state{gap0 + depth * descent, descent};
        for (const Phase& term : terms) {
            const SinCos turned = sin_cos_turns(term.at + term.rate * depth);
            state.gap += term.amplitude_m * turned.sin;
            state.slope += term.amplitude_m * turned.cos * (kTurn * term.rate);
        }
        return state;
    }
    // The longest step within which, by the bound on the curvature, the ray cannot reach the ground:
    // the root of gap + slope s + curvature s^2 / 2 = 0. Close to the ground this is a Newton step.
    double safe_step(const State& state) const {
        const double root = std::sqrt(state.slope * state.slope - 2.0 * curvature * state.gap);
        if (state.slope > 0.0) return -2.0 * state.gap / (state.slope + root);
        return (root - state.slope) / curvature;
    }
};

bool Undulation::meet(const Ray& ray, double level_y, double from, double to, double& depth) const {
    const double descent = ray.direction.y;
    const double mean = (level_y - ray.origin.y) / descent;
    if (terms_.empty() || mean > kUndulatingTo_m) {
        depth = mean;
        return mean >= from && mean <= to;
    }
    const double band = limit_m_ / descent;
    const double last = std::min(to, mean + band);
    const AlongRay along(*this, ray, level_y);
    for (depth = std::max(from, mean - band); depth <= last;) {
        const AlongRay::State state = along.at(depth);
        if (state.gap > -1e-13) return true;
        const double next = depth + along.safe_step(state);
        if (next <= depth) return true;  // as near as doubles can tell
        depth = next;
    }
    return false;
}

}  // namespace groundline::synth
