// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <complex>

#include "assembly_cell/locus/contact_model.h"
#include "assembly_cell/locus/half_turn.h"

// The linear motion behind contact_model.h, operating_point.h and identification: the mechanism
// hanging, with a point of the peg's edge held, and as measured by its sensor. SI units, axes of
// `hole`.
namespace assembly_cell::linear_motion {

using Complex = std::complex<double>;
using Complex6 = Eigen::Matrix<Complex, 6, 1>;
using Complex9 = Eigen::Matrix<Complex, 9, 1>;
using ComplexMatrix6 = Eigen::Matrix<Complex, 6, 6>;
using ComplexMatrix9 = Eigen::Matrix<Complex, 9, 9>;
using Matrix69 = Eigen::Matrix<double, 6, 9>;

// coordinates: u, translation of the centre of mass; theta, rotation vector; carrier x, y, yaw
constexpr int kU = 0, kTheta = 3, kCarrier = 6;

// Where peg and sensor are, tilted.
struct MotionFrames {
  CouplingAxes axes;
  Eigen::Matrix3d R_HP, R_HS;
  Eigen::Vector3d to_coupling, to_exciter;  // from the centre of mass [m]
  Eigen::Matrix<double, 3, 9> displaced;    // coupling point against the carrier, hole axes
  Eigen::Matrix3d euler;                    // columns: rotation by theta, phi, psi, hole axes
};

// The mechanism without contact at one tilt, at all frequencies.
struct MotionParts : MotionFrames {
  MotionParts(const Mechanism& mechanism, const Eigen::Vector2d& tilt,
              const Eigen::Vector2d& sensor_tilt);

  Matrix69 spring_wrench, damper_wrench;  // of the peg on the sensor, by coordinates and rates
  Eigen::Matrix<double, 9, 9> stiffness, damping, mass;
};

// The same at one frequency.
struct UnheldMotion : MotionFrames {
  UnheldMotion(const MotionParts& parts, double rate_of_angle);
  UnheldMotion(const Mechanism& mechanism, double rate_of_angle, const Eigen::Vector2d& tilt,
               const Eigen::Vector2d& sensor_tilt);

  double rate;  // of the exciter's angle, negative for a clockwise one [rad/s]
  Eigen::Matrix<Complex, 6, 9> wrench;  // of the peg on the sensor at the coupling, hole axes
  ComplexMatrix9 dynamic;               // generalised forces per coordinates

  // Adds a compliance of the carrier's rest point to the coupling's force, by axis [m/N].
  void addCompliance(const Mechanism& mechanism, const Eigen::Vector3cd& compliance);
};

// The same of an operating point, its compliance included.
UnheldMotion unheldMotion(const Mechanism& mechanism, const OperatingPoint& point);

// Phasors of the exciter's force along the peg's x and y [N].
Eigen::Vector2cd excitation(const OperatingPoint& point);

// Force of the exciter on the peg by its phasors along the peg's x and y: (1, -i) times the
// amplitude where it turns in a circle.
Eigen::Vector3cd exciterForce(const UnheldMotion& free, const Eigen::Vector2cd& excitation);

// All nine coordinates of the peg that hangs free under its weight, shaken by `excitation` [N].
Complex9 hangingMotion(const Mechanism& mechanism, const UnheldMotion& free,
                       const Eigen::Vector2cd& excitation);

// The six coordinates that are left with a point of the peg's edge held: theta and the carrier.
class HeldMotion {
 public:
  HeldMotion(const Mechanism& mechanism, const OperatingPoint& point);
  // with another motion and excitation than those of the point
  HeldMotion(const Mechanism& mechanism, const OperatingPoint& point, const UnheldMotion& free,
             const Eigen::Vector2cd& excitation);

  const UnheldMotion& free() const { return free_; }

  // static force of the peg on the sensor, hole axes [N]
  Eigen::Vector3d couplingForce() const { return contact_ - weight_; }

  // and its moment about the coupling point, hole axes [N m]
  Eigen::Vector3d couplingMoment(double alpha) const;

  // all nine coordinates [m], [rad]
  Complex9 solve(double alpha) const;

  // on the peg at the held point, besides the press force, hole axes [N]
  Eigen::Vector3cd contactForce(const Complex9& q) const {
    return free_.dynamic.topRows<3>() * q - force_;
  }

 private:
  // the held point from the centre of mass; its horizontal direction from the bottom centre is
  // alpha
  Eigen::Vector3d heldPoint(double alpha) const;
  Eigen::Vector3d couplingOnPeg() const { return -couplingForce(); }

  UnheldMotion free_;
  PegParameters peg_;
  Eigen::Vector3d contact_;  // static force on the peg [N]
  Eigen::Vector3d weight_;   // up [N]
  double rolling_;  // travel of the contact along the edge per rotation about the radial axis [m]
  Eigen::Vector3cd force_;
  Eigen::Matrix3cd carrier_inverse_;  // carrier's coordinates by forces and moment on it
};

// The held motion by LocusAxes: through the sensor's map without tilts (kSensor), or exact (kHole).
// Throws InputError for an invalid operating point.
class SeenMotion {
 public:
  SeenMotion(const Mechanism& mechanism, const OperatingPoint& point, LocusAxes axes);
  // all nine coordinates of a contact in direction alpha [m], [rad]
  Complex9 operator()(double alpha) const;
  // of the plane motion, counter-rotating [m]
  Eigen::Vector2cd inPlane(double alpha) const;

 private:
  HeldMotion held_;
  bool mapped_;
  ComplexMatrix9 map_;
};

// The same as contactDirection() and resolveHalfTurn(), of a motion that is set up once for both.
DirectionEstimate contactDirection(const SeenMotion& seen, const Locus& locus);
DirectionEstimate resolveHalfTurn(const SeenMotion& seen, const HalfTurnEvidence& evidence,
                                  const DirectionEstimate& estimate);

// The same as contactResponse() of contact_model.h, of a motion that is set up once for several
// directions; its operating point is not checked. Throws InputError for a coupling without a static
// map.
ContactResponse contactResponse(const Mechanism& mechanism, const HeldMotion& held, double alpha);

// Throws InputError for an invalid operating point.
void check(const OperatingPoint& point);

// counter-rotating amplitudes of the plane motion
Eigen::Vector2cd counterRotating(Complex x, Complex y);

// stiffness of the coupling in the order x, y, z, about x, about y, about z
Matrix6 sensorStiffness(const Mechanism& mechanism);

// Wrench on the sensor about its origin, in its axes, by all coordinates. The coupling point leaves
// the origin, so the static force and the moving one each have the other's displacement as arm; the
// axes turn with the carrier's yaw. Static force and moment of the peg on the sensor about the
// coupling point, hole axes [N], [N m].
Eigen::Matrix<Complex, 6, 9> sensorWrench(
    const Mechanism& mechanism, const UnheldMotion& free, const Eigen::Vector3d& static_force,
    const Eigen::Vector3d& static_moment = Eigen::Vector3d::Zero());

// How a static moment of the coupling's springs on the sensor turns as the peg turns, hole axes:
// they make it about the axes of the Euler angles, of which two turn, too.
Eigen::Matrix<double, 3, 9> turningMoment(const UnheldMotion& free, const Eigen::Vector3d& moment);

// All coordinates by the wrench on the sensor, in its axes: six wrench equations and the carrier's
// three.
Eigen::Matrix<Complex, 9, 6> motionFromSensor(const Mechanism& mechanism, const UnheldMotion& free,
                                              const Eigen::Vector3d& static_force);

}  // namespace assembly_cell::linear_motion
