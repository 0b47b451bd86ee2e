// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/estimation/locus_messages.h"

#include <algorithm>
#include <cmath>
#include <complex>

namespace assembly_cell::ros_bridge {
namespace {

using Pair = boost::array<double, 2>;

Pair toPair(const std::complex<double>& z) { return {{z.real(), z.imag()}}; }
std::complex<double> fromPair(const Pair& z) { return {z[0], z[1]}; }

std::optional<MeasuredPhasor> phasorOf(const Pair& value, double sd) {
  if (!(sd > 0.0)) return {};
  return MeasuredPhasor{fromPair(value), sd * sd};
}

}  // namespace

ExciterParameters exciterOf(const Exciter& message) {
  return {message.amplitude, message.frequency, message.phase, message.direction};
}

LocusEstimate toLocusEstimate(const LocusReading& reading, double frequency) {
  const Locus& locus = reading.locus;
  const LocusMode mode = reading.mode.mode;
  LocusEstimate out;
  out.mode = static_cast<std::uint8_t>(mode);
  std::copy(reading.mode.probabilities.begin(), reading.mode.probabilities.end(),
            out.probabilities.begin());
  out.p = toPair(locus.P);
  out.n = toPair(locus.N);
  out.semi_major = locus.semiMajor();
  out.semi_minor = locus.semiMinor();
  const double sd = locus.orientationSd();
  const bool oriented =
      mode != LocusMode::kNone && mode != LocusMode::kCircle && sd < kUnknownOrientationSd;
  out.orientation = oriented ? locus.orientation() : 0.0;
  out.orientation_sd = oriented ? sd : kUnknownOrientationSd;
  out.frequency = frequency;
  out.noise_sd = locus.sigma;
  out.samples = static_cast<std::uint32_t>(locus.samples);
  out.inflation = locus.inflation;
  std::copy_n(reading.force.data(), 3, out.force.begin());
  out.misfit = reading.misfit;
  out.direction_sd = kUnknownOrientationSd;
  if (const auto& direction = reading.direction) {
    out.hypothesis_direction = {direction->alpha, direction->alpha_opposite};
    out.hypothesis_weight = {direction->weight, 1.0 - direction->weight};
    out.direction_sd = direction->sd;
  }
  if (const auto& friction = reading.friction) {
    out.friction = friction->coefficient;
    out.friction_sd = friction->sd;
    out.friction_across = friction->across;
  }
  if (const auto& vertical = reading.evidence.vertical) {
    out.vertical = toPair(vertical->value);
    out.vertical_sd = std::sqrt(vertical->variance);
  }
  if (const auto& yaw = reading.evidence.yaw) {
    out.yaw = toPair(yaw->value);
    out.yaw_sd = std::sqrt(yaw->variance);
  }
  out.advice = static_cast<std::uint8_t>(reading.advice);
  out.better_frequency = reading.better_frequency;
  return out;
}

LocusReading fromLocusEstimate(const LocusEstimate& message) {
  LocusReading reading;
  reading.locus.P = fromPair(message.p);
  reading.locus.N = fromPair(message.n);
  reading.locus.sigma = message.noise_sd;
  reading.locus.samples = message.samples;
  reading.locus.inflation = message.inflation;
  reading.mode.mode = static_cast<LocusMode>(message.mode);
  std::copy(message.probabilities.begin(), message.probabilities.end(),
            reading.mode.probabilities.begin());
  reading.evidence.vertical = phasorOf(message.vertical, message.vertical_sd);
  reading.evidence.yaw = phasorOf(message.yaw, message.yaw_sd);
  std::copy_n(message.force.begin(), 3, reading.force.data());
  reading.misfit = message.misfit;
  if (message.hypothesis_direction.size() == 2 && message.hypothesis_weight.size() == 2) {
    reading.direction =
        DirectionEstimate{message.hypothesis_direction[0], message.hypothesis_direction[1],
                          message.hypothesis_weight[0], message.direction_sd, message.misfit};
  }
  if (message.friction > 0.0) {
    reading.friction =
        SlidingFriction{message.friction, message.friction_sd, message.friction_across};
  }
  reading.advice = static_cast<ReadingAdvice>(message.advice);
  reading.better_frequency = message.better_frequency;
  return reading;
}

}  // namespace assembly_cell::ros_bridge
