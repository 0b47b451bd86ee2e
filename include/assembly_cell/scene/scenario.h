// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/geometry/contact_geometry.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

// A scenario file, typed. SI units, frame `hole` (z out of the hole). Field by field the layout of
// config/scenarios/*.yaml, see docs/reference/interfaces.md.

enum class ContactLaw { kNone, kSpringDashpot, kViscous, kRigid };

struct ContactParameters {
  ContactLaw law = ContactLaw::kNone;
  double regularisation_speed = 1e-3;  ///< v_ST of the regularised friction [m/s]
  bool stationary_rows = false;        ///< viscous: discrete stick instead (thesis 6.35, 6.36)
  double stiffness = 0.0;              ///< spring_dashpot [N/m]
  double damping = 0.0;                ///< spring_dashpot [N s/m]
  double rate = 0.0;                   ///< viscous k [1/s]
  double pull_back = 0.0;              ///< viscous beta [1/s²]
  /// rigid: energetic (Stronge) coefficient, 0 plastic to 1. Approaches slower than 1 mm/s don't
  /// bounce, so that bounces end; several points bounce one after the other, the fastest first.
  double restitution = 0.0;
  ContactSlotMask features = kAllContactSlots;  ///< slots of the features that a run admits
};

/// What the thesis does differently and wrongly (docs/theory/thesis.md, "Errors of the thesis"),
/// each off by default: to show what it does. Top-level keys thesis_moments and so on. Its
/// pull-back "-15 x1" is contact.pull_back: 15; its coupling of 0.5 sqrt(Kii Kjj) instead of the
/// printed 0.1 is k26, k35.
struct ThesisSwitches {
  bool moments =
      false;  ///< moments of exciter and contacts by Re^-1, Rpe^-1 instead of Re^T, Rpe^T
  bool cross_stiffness = false;  ///< k26 and k35 count twice (listing, 6.14–6.16)
  bool creep = false;            ///< stationary rows demand no acceleration only (6.35, 6.36)
  bool no_centripetal = false;  ///< 6.38–6.40 without omega × (omega × r) and without the way of
                                ///< the contact point and the turn of the normal
  bool sign_flip = false;  ///< viscous: a pulling normal force is negated, not released
};

struct InitialState {
  bool close = false;  ///< lower z until the smallest gap is exactly 0
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< centre of mass [m]
  EulerAngles euler;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();          ///< [m/s]
  Eigen::Vector3d euler_rates = Eigen::Vector3d::Zero();       ///< phi, theta, psi [rad/s]
  double carrier_x = 0.0, carrier_y = 0.0, carrier_yaw = 0.0;  ///< [m], [m], [rad]
  Eigen::Vector3d carrier_velocity = Eigen::Vector3d::Zero();  ///< x, y, yaw
};

struct SolverParameters {
  /// dopri5 (order 5), dop853 (order 8), hamming (the thesis's predictor–corrector, order 4): error
  /// control by tolerance. rk4, and hamming where `step` is given: fixed steps.
  std::string integrator = "dopri5";
  double tolerance = 1e-9;  ///< absolute position error per step [m]; angles 30 rad/m × that
  double max_step = 2e-4;   ///< [s]
  double step = 0.0;        ///< of fixed-step methods [s]
};

/// Errors of the exciting force. Exact by default.
struct ExciterErrors {
  double gain = 1.0;         ///< of the amplitude, which is the ellipse's major axis
  double delay = 0.0;        ///< of the force behind the commanded angle [s]
  double ellipticity = 0.0;  ///< 1 − minor/major axis
  double azimuth = 0.0;      ///< of the major axis, peg axes [rad]
  double harmonic = 0.0;     ///< force at twice the angle, fraction of the amplitude
};

/// Properties of the true parts that a scenario doesn't have. Read from a mismatch file only, see
/// the module `mismatch`; exact by default.
struct Imperfections {
  ExciterErrors exciter;
  /// Behind the carrier's encoders, x, y, z [m/N]: the rest pose shifts by so much of the
  /// coupling's force, through a first-order lag of 10 ms.
  Eigen::Vector3d compliance = Eigen::Vector3d::Zero();
  /// Slope of the bore's axis, x and y per unit of height: the tangent of its tilt.
  Eigen::Vector2d bore_lean = Eigen::Vector2d::Zero();
};

struct Scenario {
  std::string name;
  double duration = 0.0;  ///< [s]
  Mechanism mechanism;
  RestPose rest;  ///< from carrier.rest and coupling.rest
  Eigen::Vector3d push =
      Eigen::Vector3d::Zero();  ///< constant force, peg axes, exciter's point [N]
  ContactParameters contact;
  ThesisSwitches thesis;
  InitialState initial;
  SolverParameters solver;
  Imperfections imperfections;
};

/// Keys of a scenario file.
void fields(FieldList& f, Scenario& s);

/// Reads a scenario file; each override is "key.path=value" (value in YAML syntax) and is applied
/// before the checks. Throws InputError naming file, key path, value and remedy: unreadable file,
/// unknown, missing or duplicate key, wrong type or size, non-finite or unphysical value.
Scenario loadScenario(const std::string& path, const std::vector<std::string>& overrides = {});

/// Reads a scenario from text; `source` names it in messages.
Scenario parseScenario(const std::string& yaml, const std::string& source,
                       const std::vector<std::string>& overrides = {});

}  // namespace assembly_cell
