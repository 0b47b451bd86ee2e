// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/sliding_friction.h"

#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/locus/linear_motion.h"

namespace assembly_cell {

using linear_motion::Complex;

namespace {

void requirePress(double press) {
  if (!(std::isfinite(press) && press > 0.0)) {
    throw InputError("press force is " + std::to_string(press) +
                     ": friction needs a positive one in N");
  }
}

}  // namespace

SlidingFriction slidingFriction(const Locus& locus, double force, double press) {
  requirePress(press);
  const double radius = std::abs(locus.P);
  SlidingFriction friction;
  if (!(radius > 0.0)) return friction;
  const double phase = std::arg(locus.P);
  friction.coefficient = -force * std::sin(phase) / press;
  friction.sd = force * std::abs(std::cos(phase)) / press * std::sqrt(locus.variance()) / radius;
  return friction;
}

SlidingFriction slidingFriction(const Mechanism& mechanism, const OperatingPoint& point,
                                const HarmonicFit& fit) {
  linear_motion::check(point);
  requirePress(point.press);
  const double rate = point.direction * point.frequency;
  const linear_motion::HeldMotion held(mechanism, point);
  const linear_motion::UnheldMotion& free = held.free();
  const Eigen::Matrix<Complex, 9, 6> motion =
      linear_motion::motionFromSensor(mechanism, free, held.couplingForce()) *
      linear_motion::sensorStiffness(mechanism).cast<Complex>();
  const linear_motion::Complex9 q = motion * fit.phasor;

  // slip of the bottom's centre and force there, as they turn with the exciter
  const Eigen::Vector3d bottom = -mechanism.peg.half_height * free.R_HP.col(2);
  const Complex i(0.0, 1.0);
  const auto turning = [&](const auto& v) -> Complex { return 0.5 * (v[0] + i * v[1]); };
  const Eigen::Vector3cd moved = q.head<3>() - skew(bottom).cast<Complex>() * q.segment<3>(3);
  const Complex slip = i * rate * turning(moved);
  const Complex force = turning(held.contactForce(q));
  SlidingFriction friction;
  if (!(std::abs(slip) > 0.0)) return friction;
  const Complex along = force * std::conj(slip) / std::abs(slip);
  friction.coefficient = -along.real() / point.press;
  friction.across = std::abs(along.imag()) / std::abs(along);

  // noise of that force; the slip's direction moves it only to second order
  Eigen::Matrix<Complex, 1, 6> row = 0.5 * (free.dynamic.row(0) + i * free.dynamic.row(1)) * motion;
  const double variance = (row * fit.noise.cast<Complex>() * row.adjoint()).value().real() * 2.0 *
                          fit.inflation / static_cast<double>(fit.samples);
  friction.sd = std::sqrt(variance) / point.press;
  return friction;
}

}  // namespace assembly_cell
