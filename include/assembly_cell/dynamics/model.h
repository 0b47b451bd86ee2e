// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>

#include "assembly_cell/geometry/contact_geometry.h"
#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {

using Vector9 = Eigen::Matrix<double, 9, 1>;

/// Generalised coordinates q = (x1p, x2p, x3p, phi, theta, psi, x2c, x3c, gamma) = (z, x, y of the
/// centre of mass, Euler angles, carrier x, y, yaw) and their rates v. [m], [rad]
struct State {
  Vector9 q = Vector9::Zero();
  Vector9 v = Vector9::Zero();
  /// How far the rest pose gives way behind the encoders: x, y, z [m]. By the compliance times the
  /// coupling's force, through a lag of kGiveLag. Zero where nothing gives way.
  Eigen::Vector3d give = Eigen::Vector3d::Zero();
};
constexpr double kGiveLag = 0.01;  ///< [s]
/// Some part of the carrier gives way behind its encoders.
inline bool isCompliant(const Scenario& scenario) {
  return !scenario.imperfections.compliance.isZero(0.0);
}

/// Position, velocity and acceleration of the six rest coordinates, in the order of RestPose:
/// x2e, x3e, x1e, theta1e (yaw), theta2e (theta), theta3e (phi).
struct RestMotion {
  Vector6 position = Vector6::Zero();
  Vector6 rate = Vector6::Zero();
  Vector6 acceleration = Vector6::Zero();
};
Vector6 restVector(const RestPose& pose);
RestPose restPose(const Vector6& position);

/// C² motion of the rest pose: one quintic for all six coordinates, then rest.
struct RestProfile {
  double start = 0.0;     ///< [s]
  double duration = 0.0;  ///< [s]; 0: at rest
  Eigen::Matrix<double, 6, 6> coefficients =
      Eigen::Matrix<double, 6,
                    6>::Zero();  ///< row: coordinate, column: power of (t − start)/duration
};
RestProfile restProfile(const RestPose& at_rest);

/// From the present motion to `target` within the carrier's speed and acceleration; angles count
/// with the distance from the coupling to the peg's edge as their arm. A plan that starts in
/// mid-motion keeps the acceleration but may pass the speed by up to 40 %.
RestProfile planRest(const RestMotion& now, double t, const RestPose& target,
                     const CarrierParameters& limits, double arm);
RestMotion restMotion(const RestProfile& profile, double t);

/// From the present motion to that of `goal` at t_goal, later than t: one quintic, which is told
/// for as long again.
RestProfile followProfile(const RestMotion& now, double t, const RestMotion& goal, double t_goal);

/// From the present motion to rest, the quickest that keeps `max_acceleration`, in closed form; the
/// rate of each coordinate is a cubic. At full speed and no acceleration 0.75 v²/a farther.
RestProfile planStop(const RestMotion& now, double t, double max_acceleration, double arm);

/// Angle with its cosine and sine, and those of an angle near it without a library call (within
/// 0.2 rad; exact to rounding).
struct Direction {
  double angle = 0.0, cosine = 1.0, sine = 0.0;
};
Direction directionOf(double angle);
Direction directionNear(const Direction& base, double angle);

/// Exciting force at time t, in thesis peg axes 1, 2. t_ref: see Simulation::setExciter. [N]
struct Drive {
  ExciterParameters exciter;
  double t_ref = 0.0;
  ExciterErrors errors{};
};
Eigen::Vector2d exciterForce(const Drive& drive, double t);
/// The same, with a direction near that of the force, which is taken anew where it is too far.
Eigen::Vector2d exciterForce(const Drive& drive, double t, Direction& near);

/// What one evaluation of the mechanism needs at a time and a state, without the contacts.
struct Kinematics {
  Eigen::Vector3d x, v;       ///< centre of mass, thesis axes
  Eigen::Vector3d R0, R1, a;  ///< peg axes in thesis axes
  Eigen::Matrix3d Re;         ///< omega = Re (phi', theta', psi')
  Eigen::Matrix3d Re_rate;    ///< its time derivative
  Eigen::Vector3d omega;      ///< [rad/s]
  double sin_theta, cos_theta;
};
Kinematics kinematics(const State& state);

using EulerDirections = std::array<Direction, 3>;  ///< of phi, theta, psi
/// Takes those of `near` anew that are too far from the state's angles.
void keepNear(const State& state, EulerDirections& near);

/// The same, from the directions of a state near it.
void kinematics(const State& state, const EulerDirections& near, Kinematics& k);

/// Free motion: forces of coupling, carrier, weight and exciter.
struct FreeMotion {
  Vector9 force;            ///< generalised forces f of M(q) v' = f, contacts left out
  Eigen::Vector3d FK, FKm;  ///< spring force (T part) and generalised moments (FK4, FK5, FK6)
  Eigen::Vector3d FC, FCm;  ///< damper force and moments (FC4, FC5, FC6)
  Vector6 deflection;       ///< d of the coupling, thesis order 1..6
  /// How fast the carrier gives way, where it does: x, y, z [m/s].
  Eigen::Vector3d give_rate = Eigen::Vector3d::Zero();
};
/// `rest`: without what gives way.
void freeMotion(const Scenario& s, const Kinematics& k, const State& state, const RestMotion& rest,
                const Eigen::Vector2d& exciter_force, FreeMotion& m);

/// 1 over masses and moments of inertia of peg and carrier.
struct InverseMass {
  explicit InverseMass(const Mechanism& mechanism);
  double peg, transverse, axial, carrier, yaw;
};
/// v' = M(q)^-1 f.
void solveMass(const InverseMass& inverse, const Kinematics& k, const Vector9& force,
               Vector9& rate);

/// Of peg and carrier [J]. k: of the state with these rates v.
double kineticEnergy(const Scenario& s, const Kinematics& k, const Vector9& v);
/// Kinetic + coupling + carrier springs + weight [J]. k: of the state; `rest`: without what gives
/// way.
double mechanicalEnergy(const Scenario& s, const Kinematics& k, const State& state,
                        const RestMotion& rest);

}  // namespace assembly_cell
