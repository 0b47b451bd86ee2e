// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/linear_motion.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <string>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell::linear_motion {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr double kLag = 0.01;  // of the carrier's compliance [s]

// rows of the thesis order z, x, y by x, y, z
Matrix3d thesisOrder() { return (Matrix3d() << 0, 0, 1, 1, 0, 0, 0, 1, 0).finished(); }

// the same matrix for both halves of a twist or wrench
Matrix6 twice(const Matrix3d& m) {
  Matrix6 both = Matrix6::Zero();
  both.topLeftCorner<3, 3>() = both.bottomRightCorner<3, 3>() = m;
  return both;
}

// axes of a body whose axis is tilted by the rotation vector (x, y), Euler angle psi zero
Matrix3d tilted(const Vector2d& tilt) {
  Vector3d axis = Vector3d::UnitZ();
  const double angle = tilt.norm();
  if (angle > 0.0) {
    axis = Eigen::AngleAxisd(angle, Vector3d(tilt.x(), tilt.y(), 0.0) / angle) * axis;
  }
  const double phi = std::atan2(axis.x(), axis.z());
  const double about_x = std::asin(std::clamp(-axis.y(), -1.0, 1.0));
  return (Eigen::AngleAxisd(phi, Vector3d::UnitY()) * Eigen::AngleAxisd(about_x, Vector3d::UnitX()))
      .toRotationMatrix();
}

// second-order term of a constant force f at the lever l of a body that rotates: the energy
// -f·(θ×(θ×l))/2 as a stiffness
Matrix3d forceStiffness(const Vector3d& f, const Vector3d& l) {
  return f.dot(l) * Matrix3d::Identity() - 0.5 * (f * l.transpose() + l * f.transpose());
}

// the coupling's static moment acts on Euler angles, which differ from θ by θ×θ terms; on the
// rotation vector from the carrier by its square
Matrix3d angleStiffness(const UnheldMotion& free, const Vector3d& moment) {
  if (free.axes == CouplingAxes::kCarrier) return Matrix3d::Zero();
  const Matrix3d angles = free.euler.inverse();  // theta, phi, psi by a rotation
  const Vector3d theta = free.euler.col(0), phi = free.euler.col(1), psi = free.euler.col(2);
  // phi turns the axes of theta and psi, theta that of psi
  Matrix3d work = Matrix3d::Zero();
  work(0, 1) = work(1, 0) = theta.cross(phi).dot(moment);
  work(1, 2) = work(2, 1) = psi.cross(phi).dot(moment);
  work(0, 2) = work(2, 0) = psi.cross(theta).dot(moment);
  return 0.5 * angles.transpose() * work * angles;
}

}  // namespace

MotionParts::MotionParts(const Mechanism& mechanism, const Vector2d& tilt,
                         const Vector2d& sensor_tilt)
    : MotionFrames{mechanism.coupling.axes, tilted(tilt), tilted(sensor_tilt), {}, {}, {}, {}} {
  const Vector3d axis = R_HP.col(2);
  to_coupling = mechanism.peg.coupling_height * axis;
  to_exciter = mechanism.peg.exciter_height * axis;

  // deflection = twist of the coupling point + carrier's part
  const double phi = std::atan2(axis.x(), axis.z());
  euler << std::cos(phi), 0.0, axis.x(), 0.0, 1.0, axis.y(), -std::sin(phi), 0.0, axis.z();
  Matrix69 twist = Matrix69::Zero();  // of the coupling point by all coordinates
  twist.block<3, 3>(0, kU).setIdentity();
  twist.block<3, 3>(0, kTheta) = -skew(to_coupling);
  twist.block<3, 3>(3, kTheta).setIdentity();
  Matrix6 damper = twice(thesisOrder()), spring = damper;
  Matrix69 carrier = Matrix69::Zero();
  if (axes == CouplingAxes::kCarrier) {
    spring = damper = twice(thesisOrder() * R_HS.transpose());
    carrier(0, kCarrier) = carrier(1, kCarrier + 1) = -1.0;
    carrier.block<3, 1>(3, kCarrier + 2) = -R_HS.col(2);
    carrier = (damper * carrier).eval();
  } else {
    // by the peg's rotation springs see Euler angles, dampers rates
    const Matrix3d inverse = euler.inverse();
    spring.bottomRightCorner<3, 3>() << inverse.row(2), inverse.row(0), inverse.row(1);
    carrier(1, kCarrier) = carrier(2, kCarrier + 1) = carrier(3, kCarrier + 2) = -1.0;
  }
  const Matrix69 spring_of = spring * twist + carrier, damper_of = damper * twist + carrier;
  const Matrix69 spring_force = fullMatrix(mechanism.coupling.stiffness) * spring_of;
  const Matrix69 damper_force = fullMatrix(mechanism.coupling.damping) * damper_of;
  spring_wrench = spring.transpose() * spring_force;
  damper_wrench = damper.transpose() * damper_force;
  displaced = twist.topRows<3>();
  displaced.block<2, 2>(0, kCarrier) -= Eigen::Matrix2d::Identity();
  stiffness = spring_of.transpose() * spring_force;
  damping = damper_of.transpose() * damper_force;

  // masses and the carrier's own springs and dampers
  const PegParameters& peg = mechanism.peg;
  const Vector3d inertia(peg.inertia_transverse, peg.inertia_transverse, peg.inertia_axial);
  mass.setZero();
  mass.block<3, 3>(kU, kU) = peg.mass * Matrix3d::Identity();
  mass.block<3, 3>(kTheta, kTheta) = R_HP * inertia.asDiagonal() * R_HP.transpose();
  const CarrierParameters& held = mechanism.carrier;
  mass.diagonal().tail<3>() << held.mass, held.mass, held.inertia;
  for (int k = 0; k < 3; ++k) {
    stiffness(kCarrier + k, kCarrier + k) += held.stiffness[k];
    damping(kCarrier + k, kCarrier + k) += held.damping[k];
  }
}

UnheldMotion::UnheldMotion(const MotionParts& parts, double rate_of_angle)
    : MotionFrames(parts), rate(rate_of_angle) {
  wrench.real() = parts.spring_wrench;
  wrench.imag() = rate * parts.damper_wrench;
  dynamic.real() = parts.stiffness - rate * rate * parts.mass;
  dynamic.imag() = rate * parts.damping;
}

UnheldMotion::UnheldMotion(const Mechanism& mechanism, double rate_of_angle, const Vector2d& tilt,
                           const Vector2d& sensor_tilt)
    : UnheldMotion(MotionParts(mechanism, tilt, sensor_tilt), rate_of_angle) {}

void UnheldMotion::addCompliance(const Mechanism& mechanism, const Eigen::Vector3cd& compliance) {
  // z: the coupling itself moves; its deflection is that by the peg's height minus this motion
  const Complex9 by_height =
      dynamic.col(kU + 2) + rate * rate * mechanism.peg.mass * Complex9::Unit(kU + 2);
  const Complex6 wrench_by_height = wrench.col(kU + 2);
  const Eigen::Matrix<Complex, 1, 9> motion =
      compliance[2] / (1.0 + compliance[2] * wrench_by_height[2]) * wrench.row(2);
  dynamic -= by_height * motion;
  wrench -= wrench_by_height * motion;
  // x and y: the carrier's own springs and dampers pull to the rest point
  const CarrierParameters& carrier = mechanism.carrier;
  for (int axis = 0; axis < 2; ++axis) {
    const Complex pull = carrier.stiffness[axis] + Complex(0.0, rate) * carrier.damping[axis];
    dynamic.row(kCarrier + axis) -= pull * compliance[axis] * wrench.row(axis);
  }
}

UnheldMotion unheldMotion(const Mechanism& mechanism, const OperatingPoint& point) {
  const double rate = point.direction * point.frequency;
  UnheldMotion free(mechanism, rate, point.tilt, point.sensor_tilt);
  if (point.compliance != 0.0) {
    const Complex compliance = point.compliance / Complex(1.0, rate * kLag);
    free.addCompliance(mechanism, Eigen::Vector3cd::Constant(compliance));
  }
  return free;
}

Eigen::Vector2cd excitation(const OperatingPoint& point) {
  const Complex i(0.0, 1.0);
  const double p = point.ellipse.x(), q = point.ellipse.y();
  return point.amplitude * Eigen::Vector2cd(1.0 + 0.5 * (p - i * q), -i + 0.5 * (q + i * p));
}

Eigen::Vector3cd exciterForce(const UnheldMotion& free, const Eigen::Vector2cd& excitation) {
  return free.R_HP.leftCols<2>().cast<Complex>() * excitation;
}

Complex9 hangingMotion(const Mechanism& mechanism, const UnheldMotion& free,
                       const Eigen::Vector2cd& excitation) {
  const Vector3d coupling = mechanism.peg.mass * mechanism.gravity * mechanism.up;
  ComplexMatrix9 dynamic = free.dynamic;
  dynamic.block<3, 3>(kTheta, kTheta) += (forceStiffness(coupling, free.to_coupling) +
                                          angleStiffness(free, free.to_coupling.cross(coupling)))
                                             .cast<Complex>();
  Complex9 load = Complex9::Zero();
  load.head<3>() = exciterForce(free, excitation);
  load.segment<3>(kTheta) = skew(free.to_exciter).cast<Complex>() * load.head<3>();
  return dynamic.partialPivLu().solve(load);
}

HeldMotion::HeldMotion(const Mechanism& mechanism, const OperatingPoint& point)
    : HeldMotion(mechanism, point, unheldMotion(mechanism, point), excitation(point)) {}

HeldMotion::HeldMotion(const Mechanism& mechanism, const OperatingPoint& point,
                       const UnheldMotion& free, const Eigen::Vector2cd& excitation)
    : free_(free),
      peg_(mechanism.peg),
      contact_(point.friction.x(), point.friction.y(), point.press),
      weight_(mechanism.peg.mass * mechanism.gravity * mechanism.up),
      rolling_(point.rolling && point.tilt.norm() > 1e-3
                   ? tipRadius(mechanism.peg) / point.tilt.norm()
                   : 0.0),
      force_(exciterForce(free_, excitation)),
      carrier_inverse_(free_.dynamic.bottomRightCorner<3, 3>().inverse()) {}

Vector3d HeldMotion::heldPoint(double alpha) const {
  const Vector2d radial(std::cos(alpha), std::sin(alpha));
  const Vector2d body = (free_.R_HP.topLeftCorner<2, 2>().inverse() * radial).normalized();
  const Vector2d edge = tipRadius(peg_) * body;
  return free_.R_HP * Vector3d(edge.x(), edge.y(), -peg_.half_height);
}

Vector3d HeldMotion::couplingMoment(double alpha) const {
  return heldPoint(alpha).cross(contact_) + free_.to_coupling.cross(couplingOnPeg());
}

Complex9 HeldMotion::solve(double alpha) const {
  const Vector2d radial(std::cos(alpha), std::sin(alpha));
  const Vector3d rho = heldPoint(alpha);

  // static forces: contact, and the coupling that balances it and the weight
  Matrix3d fixed =
      forceStiffness(contact_, rho) + forceStiffness(couplingOnPeg(), free_.to_coupling);
  fixed += angleStiffness(free_, couplingMoment(alpha));
  // rolling: a turn s about the radial axis moves the contact by -(r / tilt) s along the edge
  const Vector3d along(-radial.y(), radial.x(), 0.0);
  fixed.leftCols<2>() += rolling_ * along.cross(contact_) * radial.transpose();

  // u = -θ × rho; only the peg acts on the carrier, so its coordinates follow from θ
  const Eigen::Matrix3cd held = skew(rho).cast<Complex>();
  const ComplexMatrix9& d = free_.dynamic;
  const Eigen::Matrix3cd carrier_by_theta =
      d.block<3, 3>(kCarrier, kTheta) + d.block<3, 3>(kCarrier, kU) * held;
  const Eigen::Matrix3cd follows = -carrier_inverse_ * carrier_by_theta;
  const Eigen::Matrix3cd by_carrier =
      d.block<3, 3>(kTheta, kCarrier) + held.transpose() * d.block<3, 3>(kU, kCarrier);
  const Eigen::Matrix3cd reduced =
      d.block<3, 3>(kTheta, kTheta) + fixed.cast<Complex>() +
      held.transpose() * (d.block<3, 3>(kU, kU) * held + d.block<3, 3>(kU, kTheta)) +
      d.block<3, 3>(kTheta, kU) * held + by_carrier * follows;

  Complex9 q;
  q.segment<3>(kTheta) = reduced.inverse() * (skew(free_.to_exciter - rho) * force_);
  q.head<3>() = held * q.segment<3>(kTheta);
  q.tail<3>() = follows * q.segment<3>(kTheta);
  return q;
}

SeenMotion::SeenMotion(const Mechanism& mechanism, const OperatingPoint& point, LocusAxes axes)
    : held_(mechanism, point), mapped_(axes == LocusAxes::kSensor) {
  check(point);
  if (!mapped_) return;
  const UnheldMotion upright(mechanism, point.direction * point.frequency, Vector2d::Zero(),
                             Vector2d::Zero());
  map_ = motionFromSensor(mechanism, upright, Vector3d::Zero()) *
         sensorWrench(mechanism, held_.free(), held_.couplingForce());
}

Complex9 SeenMotion::operator()(double alpha) const {
  const Complex9 q = held_.solve(alpha);
  return mapped_ ? Complex9(map_ * q) : q;
}

Eigen::Vector2cd SeenMotion::inPlane(double alpha) const {
  const Complex9 q = held_.solve(alpha);
  if (!mapped_) return counterRotating(q[0], q[1]);
  const Eigen::Vector2cd xy = map_.topRows<2>() * q;
  return counterRotating(xy[0], xy[1]);
}

void check(const OperatingPoint& point) {
  if (!(std::isfinite(point.frequency) && point.frequency > 0.0)) {
    throw InputError("exciter frequency is " + std::to_string(point.frequency) +
                     ": give a positive one in rad/s");
  }
  if (!(std::isfinite(point.amplitude) && point.amplitude > 0.0)) {
    throw InputError("exciter amplitude is " + std::to_string(point.amplitude) +
                     ": give a positive one in N");
  }
  if (point.direction != 1 && point.direction != -1) {
    throw InputError("exciter direction is " + std::to_string(point.direction) + ": give 1 or -1");
  }
  if (!(std::isfinite(point.press) && point.press >= 0.0)) {
    throw InputError("press force is " + std::to_string(point.press) +
                     ": give one of at least 0 in N");
  }
  if (!point.friction.allFinite()) {
    throw InputError("friction force is not finite: give the horizontal contact force in N");
  }
  if (!(point.tilt.norm() < 0.5 && point.sensor_tilt.norm() < 0.5)) {
    throw InputError("tilt is " + std::to_string(point.tilt.norm()) +
                     ": the small-motion model holds below 0.5 rad");
  }
}

Eigen::Vector2cd counterRotating(Complex x, Complex y) {
  const Complex i(0.0, 1.0);
  return {0.5 * (x + i * y), 0.5 * std::conj(x - i * y)};
}

Matrix6 sensorStiffness(const Mechanism& mechanism) {
  const Matrix6 order = twice(thesisOrder());
  return order.transpose() * fullMatrix(mechanism.coupling.stiffness) * order;
}

Eigen::Matrix<Complex, 6, 9> sensorWrench(const Mechanism& mechanism, const UnheldMotion& free,
                                          const Vector3d& static_force,
                                          const Vector3d& static_moment) {
  const bool turned = free.axes == CouplingAxes::kCarrier;
  const Matrix3d R_H = turned ? free.R_HS : Matrix3d::Identity();  // axes of the springs
  Vector6 on_springs;
  on_springs << R_H.transpose() * static_force,
      (turned ? free.R_HS : free.euler).transpose() * static_moment;
  // a singular stiffness (missing springs) has no deflection there
  const Vector6 deflection =
      sensorStiffness(mechanism).completeOrthogonalDecomposition().solve(on_springs);
  const Vector3d static_displacement = R_H * deflection.head<3>();
  Eigen::Matrix<Complex, 6, 9> wrench = free.wrench;
  const Eigen::Matrix<Complex, 3, 9> forces = free.wrench.topRows<3>();
  wrench.bottomRows<3>() += skew(static_displacement).cast<Complex>() * forces -
                            (skew(static_force) * free.displaced).cast<Complex>();
  // the sensor's axes turn with the carrier's yaw
  const Vector3d axis = free.R_HS.col(2);
  const Vector3d about_origin = static_moment + static_displacement.cross(static_force);
  wrench.col(kCarrier + 2).head<3>() -= axis.cross(static_force).cast<Complex>();
  wrench.col(kCarrier + 2).tail<3>() -= axis.cross(about_origin).cast<Complex>();
  return twice(free.R_HS.transpose()).cast<Complex>() * wrench;
}

Eigen::Matrix<double, 3, 9> turningMoment(const UnheldMotion& free, const Vector3d& moment) {
  if (free.axes == CouplingAxes::kCarrier) return Eigen::Matrix<double, 3, 9>::Zero();
  const Matrix3d angles = free.euler.inverse();  // theta, phi, psi by a rotation
  const Vector3d theta = free.euler.col(0), phi = free.euler.col(1), psi = free.euler.col(2);
  // work of the moment about the axes that have turned
  Matrix3d work = Matrix3d::Zero();
  work.row(0) = phi.cross(theta).dot(moment) * angles.row(1);
  work.row(2) = psi.cross(moment).transpose();
  Eigen::Matrix<double, 3, 9> turning = Eigen::Matrix<double, 3, 9>::Zero();
  turning.middleCols<3>(kTheta) = -angles.transpose() * work;
  return turning;
}

Eigen::Matrix<Complex, 9, 6> motionFromSensor(const Mechanism& mechanism, const UnheldMotion& free,
                                              const Vector3d& static_force) {
  ComplexMatrix9 system;
  system << sensorWrench(mechanism, free, static_force), free.dynamic.bottomRows<3>();
  const Eigen::Matrix<Complex, 9, 6> ones = Eigen::Matrix<Complex, 9, 6>::Identity();
  return system.partialPivLu().solve(ones);
}

}  // namespace assembly_cell::linear_motion
