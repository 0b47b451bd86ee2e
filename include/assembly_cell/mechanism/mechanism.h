// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

class FieldList;

// What is known of the cell's parts: all that strategies, estimators, locus fit and displacement
// map see. Where the hole is and how a simulation runs is in a Scenario. SI units.

/// Smallest and largest radius by the drawing, infinite where it has none. [m]
using RadiusTolerance = std::array<double, 2>;
constexpr RadiusTolerance kNoTolerance{-std::numeric_limits<double>::infinity(),
                                       std::numeric_limits<double>::infinity()};

struct PegParameters {
  double radius = 0.0;              ///< [m]
  double half_height = 0.0;         ///< h: centre of mass to bottom edge circle [m]
  double mass = 0.0;                ///< [kg]
  double inertia_transverse = 0.0;  ///< about the centre of mass [kg m²]
  double inertia_axial = 0.0;       ///< [kg m²]
  double coupling_height = 0.0;     ///< d2: centre of mass to coupling, along the axis [m]
  double exciter_height = 0.0;      ///< d1: centre of mass to the exciter's force [m]
  double chamfer_width = 0.0;       ///< of the bottom edge, across; 0: sharp [m]
  double chamfer_angle = 0.7853981633974483;  ///< of its face to the peg's axis [rad]
  RadiusTolerance radius_tolerance = kNoTolerance;
};

struct HoleParameters {
  double radius = 0.0;                                     ///< [m]
  double depth = std::numeric_limits<double>::infinity();  ///< [m]
  double chamfer_width = 0.0;                              ///< of the rim, across; 0: sharp [m]
  double chamfer_angle = 0.7853981633974483;               ///< of its face to the hole's axis [rad]
  RadiusTolerance radius_tolerance = kNoTolerance;
};

/// Limits of a chamfer's angle [rad].
constexpr double kMinChamferAngle = 0.1, kMaxChamferAngle = 1.4;

/// Radius at the face: of the chamfer's outer edge [m].
inline double mouthRadius(const HoleParameters& hole) { return hole.radius + hole.chamfer_width; }

/// Radius of the block with the hole, which a chamfer must not reach [m].
inline double blockRadius(const HoleParameters& hole) {
  return std::max(0.045, hole.radius + 0.0199);
}

/// Depth of the chamfer [m].
inline double chamferDepth(const HoleParameters& hole) {
  return hole.chamfer_width / std::tan(hole.chamfer_angle);
}
/// Height of the chamfer up to the shoulder, where the peg's side begins [m].
inline double chamferHeight(const PegParameters& peg) {
  return peg.chamfer_width / std::tan(peg.chamfer_angle);
}
/// Radius of the bottom edge [m].
inline double tipRadius(const PegParameters& peg) { return peg.radius - peg.chamfer_width; }

/// Rest pose of the mechanism: position of the coupling point and the commanded tilt. Thesis x2e,
/// x3e, x1e, theta1e, theta2e, theta3e.
struct RestPose {
  double x = 0.0;                     ///< x2e [m]
  double y = 0.0;                     ///< x3e [m]
  double z = 0.0;                     ///< x1e, height of the coupling point [m]
  double yaw = 0.0;                   ///< theta1e [rad]
  double theta = 1.5707963267948966;  ///< theta2e, upright π/2 [rad]
  double phi = 0.0;                   ///< theta3e [rad]
};

/// Pose of the coupling point at rest in the frame of `rest`, and back.
Pose poseFromRest(const RestPose& rest);
RestPose restFromPose(const Pose& pose);

struct CarrierParameters {
  double mass = 0.0;                                    ///< [kg]
  double inertia = 0.0;                                 ///< yaw [kg m²]
  Eigen::Vector3d stiffness = Eigen::Vector3d::Zero();  ///< x, y [N/m], yaw [N m/rad]
  Eigen::Vector3d damping = Eigen::Vector3d::Zero();    ///< x, y [N s/m], yaw [N m s/rad]
  double max_speed = 0.05;                              ///< of the commanded rest pose [m/s]
  double max_acceleration = 1.0;                        ///< [m/s²]
};

/// Symmetric 6×6 in thesis order z, x, y, about z, about x, about y. Couplings have a diagonal plus
/// (2,6), (3,5); what a tool mount has besides is in `cross`.
struct CouplingMatrix {
  Vector6 diagonal = Vector6::Zero();
  double k26 = 0.0;  ///< x with rotation about y
  double k35 = 0.0;  ///< y with rotation about x
  /// The other entries above the diagonal, row by row.
  Eigen::Matrix<double, 13, 1> cross = Eigen::Matrix<double, 13, 1>::Zero();
};
/// All entries, thesis order.
Matrix6 fullMatrix(const CouplingMatrix& matrix);
/// From the diagonal and the entries above it.
CouplingMatrix couplingMatrix(const Matrix6& full);
/// Multiplies each row and column by the root of its factor, so that the diagonal has the factors.
void scaleRows(CouplingMatrix& matrix, const Vector6& factors);

/// What the coupling's springs and dampers turn with. kHole: nothing, their axes are those of
/// `hole` and its springs see differences of Euler angles (thesis 6.6, 6.10). kCarrier: the
/// carrier, and springs see the rotation vector from it to the peg: a coupling that is bolted to a
/// flange. They differ by the tilt.
enum class CouplingAxes { kHole, kCarrier };

struct CouplingParameters {
  CouplingMatrix stiffness;  ///< [N/m], [N m/rad], cross [N/rad]
  CouplingMatrix damping;    ///< [N s/m], [N m s/rad], cross [N s/rad]
  CouplingAxes axes = CouplingAxes::kHole;
};

/// Rotating exciting force in peg axes x, y at angle direction·(frequency·t + phase).
struct ExciterParameters {
  double amplitude = 0.0;  ///< [N]; 0 is off
  double frequency = 0.0;  ///< [rad/s]
  double phase = 0.0;      ///< [rad]
  int direction = 1;       ///< +1 anticlockwise from above, −1 clockwise
};

struct FrictionParameters {
  double static_coefficient = 0.0;
  double sliding_coefficient = 0.0;
};

/// Response of the arm that carries the peg, as identifyArm() measures it; 0: not known.
struct ArmResponse {
  double delay = 0.0;      ///< from a command to its effect in the force that a strategy sees [s]
  double delay_sd = 0.0;   ///< [s]
  double stiffness = 0.0;  ///< of arm, mount and contact in series, at the peg's edge [N/m]
  double stiffness_sd = 0.0;  ///< [N/m]
};

/// The parts and what acts on them.
struct Mechanism {
  double gravity = 0.0;  ///< [m/s²]
  /// Against gravity, unit vector; in the carrier's base, which is nominally parallel to the hole,
  /// and in a simulation in the hole.
  Eigen::Vector3d up{0.0, 0.0, 1.0};
  PegParameters peg;
  HoleParameters hole;
  CarrierParameters carrier;
  CouplingParameters coupling;
  ExciterParameters exciter;
  FrictionParameters friction;
  ArmResponse arm;
};

/// Static stiffness of the coupling in the order of a wrench: x y z [N/m], about x y z [N·m/rad].
Matrix6 couplingStiffness(const CouplingParameters& coupling);

/// Keys of a scenario or mechanism file: gravity, peg, hole, carrier, coupling, exciter, friction,
/// arm.
/// The rest pose in carrier.rest and coupling.rest must be in a scenario; a mechanism file may have
/// it.
void fields(FieldList& f, Mechanism& m, RestPose& rest, bool in_scenario);

/// A number of a mechanism that doesn't go with the others.
struct MechanismProblem {
  std::string key;
  double value;
  std::string why;
};
/// Checks of several numbers together, whose ranges have been checked; empty: none is wrong.
std::optional<MechanismProblem> problemOf(const Mechanism& mechanism);
/// Also of the angle theta of a pose, named `key`: near 0 and pi the Euler angles are singular.
std::optional<MechanismProblem> problemOfTheta(const std::string& key, double theta);

/// The mechanism of a scenario or mechanism file; keys of a simulation are passed over. Each
/// override is "key.path=value". Throws InputError naming file, key path, value and remedy.
Mechanism loadMechanism(const std::string& path, const std::vector<std::string>& overrides = {});

/// The mechanism of a file's text; `source` names it in messages.
Mechanism parseMechanism(const std::string& text, const std::string& source,
                         const std::vector<std::string>& overrides = {});

/// The mechanism's keys of a scenario or mechanism file, from gravity to arm. Numbers read
/// back bitwise; a hole without an end has no depth there.
std::string mechanismText(const Mechanism& mechanism);

}  // namespace assembly_cell
