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
  /// Deflection of the rest pose by the compliance of the carrier, which its encoders don't
  /// measure: x, y, z [m]. First-order lag (time constant kComplianceLag) of compliance · coupling
  /// force; zero for a rigid carrier.
  Eigen::Vector3d carrier_deflection = Eigen::Vector3d::Zero();
};
constexpr double kComplianceLag = 0.01;  ///< [s]
/// The scenario has a compliant carrier, see State::carrier_deflection.
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

/// C² motion of the rest pose: a quintic for each of the six coordinates, then rest.
struct RestProfile {
  double start = 0.0;     ///< [s]
  double duration = 0.0;  ///< [s]; 0: at rest
  Eigen::Matrix<double, 6, 6> coefficients =
      Eigen::Matrix<double, 6,
                    6>::Zero();  ///< row: coordinate, column: power of (t − start)/duration
};
RestProfile restProfile(const RestPose& at_rest);

/// Profile from the motion `now` at time t [s] to rest at `target` within the carrier's limits of
/// speed and acceleration. Angles are weighted by `arm` [m], the distance from the coupling to the
/// peg's edge. A plan that starts in motion keeps the acceleration limit; its speed may exceed the
/// limit by up to 40 %.
RestProfile planRest(const RestMotion& now, double t, const RestPose& target,
                     const CarrierParameters& limits, double arm);
RestMotion restMotion(const RestProfile& profile, double t);

/// Quintic from the motion `now` at time t to `goal` at t_goal > t [s]. The profile ends at
/// t + 2 (t_goal − t): the same quintic is extrapolated after t_goal.
RestProfile followProfile(const RestMotion& now, double t, const RestMotion& goal, double t_goal);

/// Fastest profile from the motion `now` to rest whose rates are cubics and whose acceleration
/// stays within `max_acceleration` [m/s²], in closed form. From speed v without acceleration it
/// ends after a distance of 0.75 v²/max_acceleration.
RestProfile planStop(const RestMotion& now, double t, double max_acceleration, double arm);

/// An angle with its cosine and sine. directionNear() computes those of an angle within 0.2 rad of
/// `base` from a series, exact to rounding.
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
/// As the overload without it, from a direction near that of the force; `near` is recomputed where
/// it is more than 0.2 rad off.
Eigen::Vector2d exciterForce(const Drive& drive, double t, Direction& near);

/// Kinematics of the peg at a state, thesis axes.
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
/// Recomputes the directions of `near` that are too far from the state's angles.
void keepNear(const State& state, EulerDirections& near);

/// kinematics() from the directions of a state near it.
void kinematics(const State& state, const EulerDirections& near, Kinematics& k);

/// Free motion: forces of coupling, carrier, weight and exciter.
struct FreeMotion {
  Vector9 force;            ///< generalised forces f of M(q) v' = f, contacts left out
  Eigen::Vector3d FK, FKm;  ///< spring force (T part) and generalised moments (FK4, FK5, FK6)
  Eigen::Vector3d FC, FCm;  ///< damper force and moments (FC4, FC5, FC6)
  Vector6 deflection;       ///< d of the coupling, thesis order 1..6
  /// Rate of State::carrier_deflection: x, y, z [m/s].
  Eigen::Vector3d carrier_deflection_rate = Eigen::Vector3d::Zero();
};
/// `rest`: commanded, without State::carrier_deflection.
void freeMotion(const Scenario& s, const Kinematics& k, const State& state, const RestMotion& rest,
                const Eigen::Vector2d& exciter_force, FreeMotion& m);

/// Reciprocals of masses [1/kg] and moments of inertia [1/(kg m²)] of peg and carrier.
struct InverseMass {
  explicit InverseMass(const Mechanism& mechanism);
  double peg, transverse, axial, carrier, yaw;
};
/// v' = M(q)^-1 f.
void solveMass(const InverseMass& inverse, const Kinematics& k, const Vector9& force,
               Vector9& rate);

/// Kinetic energy of peg and carrier [J]. k: kinematics of the state with these rates v.
double kineticEnergy(const Scenario& s, const Kinematics& k, const Vector9& v);
/// Kinetic energy + energy of coupling, carrier springs and weight [J]. k: kinematics of `state`;
/// `rest`: commanded, without State::carrier_deflection.
double mechanicalEnergy(const Scenario& s, const Kinematics& k, const State& state,
                        const RestMotion& rest);

}  // namespace assembly_cell
