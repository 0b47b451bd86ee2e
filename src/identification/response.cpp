// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/identification/response.h"

#include <Eigen/LU>
#include <cmath>

#include "assembly_cell/align/estimation/contact_window.h"
#include "assembly_cell/locus/linear_motion.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using namespace linear_motion;

// Operating point of a drive and a commanded exciter.
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

// Rotation about the axis, from the axes that linear_motion assigns to a body with this axis.
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

// Axes of the peg with the coupling deflected by a static wrench on the sensor (sensor axes, about
// its origin).
Matrix3d restingPeg(const Mechanism& m, const Matrix3d& R_HS, const Vector6& wrench) {
  const Eigen::PartialPivLU<Matrix6> stiffness(couplingStiffness(m.coupling));
  const Vector6 deflection = stiffness.solve(wrench);
  if (m.coupling.axes == CouplingAxes::kCarrier) {
    return R_HS * rotationFromVector({Vector3d(deflection.tail<3>())});
  }
  // springs along the axes of `hole`, and about those of the Euler angles
  const Vector3d force = R_HS * wrench.head<3>();
  const Vector3d moment = R_HS * wrench.tail<3>() - (R_HS * deflection.head<3>()).cross(force);
  const EulerAngles sensor = eulerFromRotation(R_HS);
  EulerAngles peg = sensor;
  // the axes turn by a hundredth: three times are exact to 1e-6
  for (int k = 0; k < 3; ++k) {
    Matrix3d axes;  // that theta, phi and psi turn the peg about
    axes << Vector3d(std::cos(peg.phi), 0.0, -std::sin(peg.phi)), Vector3d::UnitY(),
        rotationFromEuler(peg).col(2);
    Vector6 load;
    load << force, axes.transpose() * moment;
    const Vector3d turn = stiffness.solve(load).tail<3>();
    peg = {sensor.phi + turn.y(), sensor.theta + turn.x(), sensor.psi + turn.z()};
  }
  return rotationFromEuler(peg);
}

// Wrench of the hanging peg on the sensor, see pegWeight().
Vector6 weightOn(const Mechanism& m, const Matrix3d& R_HS) {
  return pegWeight(m.peg, m.gravity, R_HS.transpose() * m.up, Vector6::Zero());
}

// Wrench of a motion, with the static force and moment of the peg on the sensor.
WrenchPhasor seenBySensor(const Mechanism& m, const UnheldMotion& free, const Vector3d& force,
                          const Vector3d& moment, const Complex9& motion) {
  WrenchPhasor wrench = sensorWrench(m, free, force, moment) * motion;
  wrench.tail<3>() += free.R_HS.transpose() * turningMoment(free, moment) * motion;
  return wrench;
}

}  // namespace

WrenchPhasor hangingResponse(const MechanismModel& model, const ExciterParameters& exciter,
                             const Vector2d& lean) {
  const Mechanism& m = model.mechanism;
  const Matrix3d R_HS = rotationFromVector({Vector3d(lean.x(), lean.y(), 0.0)});
  OperatingPoint point = pointOf(model.drive, exciter);
  point.tilt = tiltOfAxis(restingPeg(m, R_HS, weightOn(m, R_HS)).col(2));
  point.sensor_tilt = lean;
  const UnheldMotion free = unheldMotion(m, point);
  const Vector3d weight = -m.peg.mass * m.gravity * m.up;
  return seenBySensor(m, free, weight, -free.to_coupling.cross(weight),
                      hangingMotion(m, free, lateExcitation(model.drive, point)));
}

WrenchPhasor pressedResponse(const MechanismModel& model, const ExciterParameters& exciter,
                             const PressedState& state) {
  const Mechanism& m = model.mechanism;
  const Vector3d force = state.R_HS * state.contact.head<3>();
  const Matrix3d R_HP = restingPeg(m, state.R_HS, weightOn(m, state.R_HS) + state.contact);
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
  WrenchPhasor wrench =
      seenBySensor(m, free, held.couplingForce(), held.couplingMoment(alpha), held.solve(alpha));
  wrench.head<3>() = (to_sensor.cast<Complex>() * wrench.head<3>()).eval();
  wrench.tail<3>() = (to_sensor.cast<Complex>() * wrench.tail<3>()).eval();
  return wrench;
}

}  // namespace assembly_cell
