// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/operating_point.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <optional>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/locus/linear_motion.h"

namespace assembly_cell {

using Eigen::Vector2d;
using Eigen::Vector3d;
using linear_motion::Complex;
using linear_motion::Complex9;
using linear_motion::counterRotating;
using linear_motion::HeldMotion;

namespace {

constexpr int kDirections = 12;          // half, twice: the same forecast
constexpr double kDetuning = 0.01;       // proportional to the bias
constexpr double kSamplesPerTurn = 3.0;  // half, twice: no limit at 5 kHz

// Largest tangential over normal force of a plane contact in a turn of the exciter.
double frictionDemand(const Eigen::Vector3cd& contact, const OperatingPoint& point) {
  constexpr int kPhases = 36;  // half, twice: the same to six digits
  double worst = 0.0;
  for (int k = 0; k < kPhases; ++k) {
    const Complex turn = std::polar(1.0, 2.0 * M_PI * k / kPhases);
    const Vector3d moving = (contact * turn).real();
    const double normal = point.press + moving.z();
    const double across = (point.friction + moving.head<2>()).norm();
    worst = std::max(worst, normal > 0.0 ? across / normal : 1e3);
  }
  return worst;
}

}  // namespace

DirectionForecast forecastDirection(const Mechanism& mechanism, const OperatingPoint& point,
                                    const Matrix6& noise, double samples) {
  linear_motion::check(point);
  if (!(samples >= 8.0 && std::isfinite(samples)) || !noise.allFinite()) {
    throw InputError("forecast of " + std::to_string(samples) +
                     " samples: give at least 8 and a finite noise");
  }
  HarmonicFit fit;
  fit.phasor.setZero();
  fit.noise = noise;
  fit.samples = static_cast<std::size_t>(samples);
  const double variance = centreOfMassLocus(mechanism, point.direction * point.frequency, fit,
                                            point.tilt, point.sensor_tilt)
                              .variance();
  OperatingPoint detuned = point;
  detuned.frequency *= 1.0 + kDetuning;
  const HeldMotion held(mechanism, point), off(mechanism, detuned);
  const auto amplitudes = [](const HeldMotion& motion, double alpha) {
    const Complex9 q = motion.solve(alpha);
    return counterRotating(q[0], q[1]);
  };

  DirectionForecast forecast;
  forecast.frequency = point.frequency;
  forecast.axes_ratio = 1.0;
  for (int k = 0; k < kDirections; ++k) {
    constexpr double kStep = 1e-4;
    const double alpha = 2.0 * M_PI * k / kDirections;
    const Complex9 q = held.solve(alpha);
    const Eigen::Vector2cd pn = counterRotating(q[0], q[1]);
    const Eigen::Vector2cd slope =
        (amplitudes(held, alpha + kStep) - amplitudes(held, alpha - kStep)) / (2.0 * kStep);
    const double information = slope.squaredNorm();
    const double sd = information > 0.0 ? std::sqrt(variance / information) : M_PI;
    const double bias = information > 0.0
                            ? std::abs(slope.dot(amplitudes(off, alpha) - pn).real()) / information
                            : M_PI;
    forecast.direction_sd = std::max(forecast.direction_sd, std::min(sd, M_PI));
    forecast.direction_bias = std::max(forecast.direction_bias, std::min(bias, M_PI));
    const double p = std::abs(pn[0]), n = std::abs(pn[1]);
    forecast.axes_ratio =
        std::min(forecast.axes_ratio, p + n > 0.0 ? std::abs(p - n) / (p + n) : 0.0);
    forecast.friction_demand =
        std::max(forecast.friction_demand, frictionDemand(held.contactForce(q), point));
  }
  return forecast;
}

std::string refusalOf(const DirectionForecast& forecast, const ForecastLimits& limits) {
  constexpr double kDegrees = 180.0 / M_PI;
  if (!(forecast.direction_sd <= limits.direction_sd)) {
    return text(
        "too_uncertain: the direction would have a sd of %.3g deg, more than %.3g deg: excite "
        "harder, longer or at a better frequency",
        forecast.direction_sd * kDegrees, limits.direction_sd * kDegrees);
  }
  if (!(forecast.friction_demand <= limits.friction_demand)) {
    return text(
        "would_slip: the contact would need a friction of %.3g, more than %.3g: press harder or "
        "excite less",
        forecast.friction_demand, limits.friction_demand);
  }
  if (!(forecast.axes_ratio >= limits.axes_ratio)) {
    return text(
        "looks_double: a single contact's ellipse would have a ratio of axes of %.3g, less than "
        "%.3g: change the frequency",
        forecast.axes_ratio, limits.axes_ratio);
  }
  return {};
}

DirectionForecast chooseFrequency(const Mechanism& mechanism, OperatingPoint point,
                                  const Matrix6& noise, double rate, double duration,
                                  const ForecastLimits& limits) {
  const double middle = operatingFrequency(mechanism, point.press);
  const double highest = 2.0 * M_PI * rate / kSamplesPerTurn;
  const double first = std::max(0.5 * middle, 2.0 * M_PI / duration),
               last = std::min(2.0 * middle, highest);
  if (!(first < last)) {
    throw InputError(
        text("no frequency around %.4g rad/s is sampled three times a turn at %.4g Hz "
             "for at least one turn: take samples faster or longer",
             middle, rate));
  }
  constexpr int kScan = 121;  // half, twice: 1 % in frequency, 0.1 % in sd
  std::optional<DirectionForecast> best;
  bool best_refused = true;
  for (int k = 0; k < kScan; ++k) {
    point.frequency = first * std::pow(last / first, static_cast<double>(k) / (kScan - 1));
    const DirectionForecast f = forecastDirection(mechanism, point, noise, rate * duration);
    const bool refused = !refusalOf(f, limits).empty();
    if (!best || (best_refused && !refused) ||
        (refused == best_refused && f.direction_sd < best->direction_sd)) {
      best = f;
      best_refused = refused;
    }
  }
  return *best;
}

}  // namespace assembly_cell
