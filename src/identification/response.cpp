// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/identification/response.h"

#include <Eigen/LU>
#include <cmath>

#include "assembly_cell/locus/linear_motion.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using namespace linear_motion;

// what is shaken, and how
OperatingPoint pointOf(const DriveErrors& drive, const ExciterParameters& exciter) {
  OperatingPoint point;
  point.frequency = exciter.frequency;
  point.amplitude = drive.gain * exciter.amplitude;
  point.direction = exciter.direction;
  point.ellipse = drive.ellipse;
  point.compliance = drive.compliance;
  return point;
}

Eigen::Vector2cd lateExcitation(const DriveErrors& drive, const OperatingPoint& point) {
  return std::polar(1.0, -point.direction * point.frequency * drive.delay) * excitation(point);
}

// turn about the axis from the axes that the linear motion gives a body with this axis
double turnOf(const Matrix3d& R, const Matrix3d& upright) {
  const Vector3d x = upright.transpose() * R.col(0);
  return std::atan2(x.y(), x.x());
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
  OperatingPoint point = pointOf(model.drive, exciter);
  point.tilt = point.sensor_tilt = lean;
  const UnheldMotion free = unheldMotion(m, point);
  const Vector3d weight(0.0, 0.0, -m.peg.mass * m.gravity);
  return sensorWrench(m, free, weight) * hangingMotion(m, free, lateExcitation(model.drive, point));
}

WrenchPhasor pressedResponse(const MechanismModel& model, const ExciterParameters& exciter,
                             const PressedState& state) {
  const Mechanism& m = model.mechanism;
  const Vector3d force = state.R_HS * state.contact.head<3>();
  const Vector6 deflection = couplingStiffness(m.coupling).partialPivLu().solve(state.contact);
  const Eigen::Matrix3d R_HP = state.R_HS * rotationFromVector({Vector3d(deflection.tail<3>())});
  OperatingPoint point = pointOf(model.drive, exciter);
  point.press = std::max(0.0, force.z());
  point.friction = force.head<2>();
  point.tilt = tiltOfAxis(R_HP.col(2));
  point.sensor_tilt = tiltOfAxis(state.R_HS.col(2));
  point.rolling = true;
  const UnheldMotion free = unheldMotion(m, point);
  // exciter and sensor have turned about their axes, the coupling's springs have not
  const Eigen::Rotation2Dd turn(turnOf(R_HP, free.R_HP));
  const Eigen::Vector2cd shaken =
      turn.toRotationMatrix().cast<Complex>() * lateExcitation(model.drive, point);
  const HeldMotion held(m, point, free, shaken);
  const Matrix3d to_sensor = state.R_HS.transpose() * free.R_HS;
  // the edge is lowest where the axis leans to
  const double lowest = std::atan2(R_HP(1, 2), R_HP(0, 2));
  const double alpha = lowest + state.aside;
  const Complex9 motion = held.solve(alpha);
  WrenchPhasor wrench = sensorWrench(m, free, held.couplingForce()) * motion;
  wrench.tail<3>() +=
      free.R_HS.transpose() * turningMoment(free, held.couplingMoment(alpha)) * motion;
  wrench.head<3>() = (to_sensor.cast<Complex>() * wrench.head<3>()).eval();
  wrench.tail<3>() = (to_sensor.cast<Complex>() * wrench.tail<3>()).eval();
  return wrench;
}

}  // namespace assembly_cell
