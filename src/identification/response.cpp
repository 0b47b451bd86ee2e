// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/identification/response.h"

#include <Eigen/LU>
#include <cmath>

#include "assembly_cell/locus/linear_motion.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;
using Eigen::Vector2d;
using Eigen::Vector3d;
using namespace linear_motion;

constexpr double kLag = 0.01;  // of the carrier's compliance [s]

Eigen::Vector2cd excitation(const DriveErrors& drive, const ExciterParameters& exciter) {
  const Complex i(0.0, 1.0);
  const double p = drive.ellipse.x(), q = drive.ellipse.y();
  const Complex late = std::exp(-i * (exciter.direction * exciter.frequency * drive.delay));
  return drive.gain * exciter.amplitude * late *
         Eigen::Vector2cd(1.0 + 0.5 * (p - i * q), -i + 0.5 * (q + i * p));
}

UnheldMotion motionOf(const MechanismModel& model, const ExciterParameters& exciter,
                      const Vector2d& tilt, const Vector2d& sensor_tilt) {
  const double rate = exciter.direction * exciter.frequency;
  UnheldMotion free(model.mechanism, rate, tilt, sensor_tilt);
  const Complex give = model.drive.compliance / Complex(1.0, rate * kLag);
  free.giveWay(model.mechanism, Eigen::Vector3cd::Constant(give));
  return free;
}

// rotation vector x, y of the smallest rotation that brings z to the axis
Vector2d tiltOfAxis(const Vector3d& axis) {
  const Vector3d turn = Vector3d::UnitZ().cross(axis);
  const double sine = turn.norm();
  if (sine < 1e-12) return Vector2d::Zero();
  return turn.head<2>() * (std::atan2(sine, axis.z()) / sine);
}

}  // namespace

WrenchPhasor hangingResponse(const MechanismModel& model, const ExciterParameters& exciter,
                             const Vector2d& lean) {
  const Mechanism& m = model.mechanism;
  const UnheldMotion free = motionOf(model, exciter, lean, lean);
  const Vector3d weight(0.0, 0.0, -m.peg.mass * m.gravity);
  return sensorWrench(m, free, weight) * hangingMotion(m, free, excitation(model.drive, exciter));
}

WrenchPhasor pressedResponse(const MechanismModel& model, const ExciterParameters& exciter,
                             const PressedState& state) {
  const Mechanism& m = model.mechanism;
  const Vector3d force = state.R_HS * state.contact.head<3>();
  const Vector6 deflection = couplingStiffness(m.coupling).partialPivLu().solve(state.contact);
  const Eigen::Matrix3d R_HP = state.R_HS * rotationFromVector({Vector3d(deflection.tail<3>())});
  OperatingPoint point;
  point.frequency = exciter.frequency;
  point.amplitude = exciter.amplitude;
  point.direction = exciter.direction;
  point.press = std::max(0.0, force.z());
  point.friction = force.head<2>();
  point.tilt = tiltOfAxis(R_HP.col(2));
  point.sensor_tilt = tiltOfAxis(state.R_HS.col(2));
  point.rolling = true;
  const HeldMotion held(m, point, motionOf(model, exciter, point.tilt, point.sensor_tilt),
                        excitation(model.drive, exciter));
  // the edge is lowest where the axis leans to
  const double lowest = std::atan2(R_HP(1, 2), R_HP(0, 2));
  return sensorWrench(m, held.free(), held.couplingForce()) * held.solve(lowest + state.aside);
}

}  // namespace assembly_cell
