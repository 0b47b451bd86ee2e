// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/align/estimation/clearance.h"
#include "assembly_cell/align/parameters.h"
#include "assembly_cell/align/plant.h"
#include "assembly_cell/math/curve.h"
#include "assembly_cell/mechanism/sensors.h"

namespace assembly_cell {

/// Progress for log lines and for the action's feedback.
struct AlignProgress {
  /// State once load and walls have shown that the peg is out of the hole.
  static constexpr char kOutside[] = "outside";

  std::string state;  ///< of the state machine
  int contacts = 0;   ///< readings taken
  double time = 0.0;  ///< plant clock [s]
  std::string message;
  double position_sd = 0.0;  ///< of the hole's estimated centre, 2 axes; 0: not known [m]
  double rotation_sd = 0.0;  ///< of its axis, 2 axes [rad]
  double depth = 0.0;        ///< of the bottom edge, during the insertion [m]
  double force = 0.0;        ///< contact force there [N]
  int walls = 0;             ///< bore-wall contacts there, as in BoreReading
  double axial = 0.0;        ///< force there up the peg's axis [N]
  double clearance = 0.0;    ///< as in AlignResult; sd 0: not known [m]
  double clearance_sd = 0.0;
};

/// A measured direction of a contact.
struct DirectionReading {
  double start = 0.0, end = 0.0;  ///< window of the reading, plant clock [s]
  double direction = 0.0;         ///< azimuth of the contact on the peg's edge, peg axes [rad]
  double sd = 0.0;                ///< [rad]
};

/// Wrench of the contacts in the bore, without the peg's weight, at the centre of its bottom edge.
struct BoreReading {
  double depth = 0.0;     ///< of that centre below the plane, as measured [m]
  double along = 0.0;     ///< up the peg's axis [N]
  double sideways = 0.0;  ///< [N]
  double moment = 0.0;    ///< across the axis [N·m]
  int walls = 0;          ///< bore-wall contacts: none, one, or two at both ends

  double force() const { return std::hypot(along, sideways); }
};

/// Result of an insertion.
struct InsertResult {
  bool seated = false;  ///< at the depth, or on the floor
  BoreReading end;
  double force = 0.0;                ///< largest mean over a block on the path down [N]
  double time = 0.0;                 ///< plant clock used [s]
  int backed_out = 0;                ///< times that the peg was stuck and was pulled up again
  std::vector<BoreReading> profile;  ///< one a millimetre
  Curve curve;                       ///< a sample a step of 20 ms; in a long insertion fewer
};

/// Result of an alignment.
struct AlignResult {
  bool success = false;
  AlignFailure failure = AlignFailure::kNone;
  std::string reason;  ///< "aligned", or the failure's name and what happened
  bool known = false;  ///< offset and tilt were estimated
  /// Estimated: hole centre relative to the peg's bottom centre at reference_time [m]
  Eigen::Vector2d offset{0, 0};
  Eigen::Matrix2d offset_covariance = Eigen::Matrix2d::Zero();  ///< [m²]
  Eigen::Vector2d tilt{0, 0};  ///< estimated tilt of the peg axis then, rotation vector x, y [rad]
  double tilt_sd = 0.0;        ///< [rad]
  /// Estimated clearance, hole's less peg's radius: drawn, by touches and between walls [m]
  Clearance clearance;
  /// Offset from wrenches alone, before touches and walls; twin_force only. [m]
  std::optional<Eigen::Vector2d> wrench_offset;
  Eigen::Matrix2d wrench_covariance = Eigen::Matrix2d::Zero();  ///< [m²]
  int contacts = 0;                                             ///< readings taken
  double time = 0.0;                                            ///< plant clock used [s]
  /// Plant clock when the peg hung at rest, before its first move [s]
  double reference_time = 0.0;
  std::vector<DirectionReading> readings;  ///< of the last estimate
  /// Depth of the bottom edge below the plane at the end. 0 without success, and where the peg was
  /// in the hole from the start, so that the face was not touched. [m]
  double depth = 0.0;
  InsertResult insert;
};

/// Descent of an arm to its first touch.
struct ArmTouch {
  double slower = 1.0;  ///< factor of the speed that keeps the force below 45 % of the limit
  double speed = 0.0;   ///< [m/s]
  double force = 0.0;   ///< greatest force before the arm has stopped [N]
};

/// The first touch with the arm's delay of the parameters or, where that is 0, of the mechanism;
/// see docs/how_to/arm.md.
ArmTouch armTouch(const Mechanism& mechanism, const AlignParameters& parameters);

/// checkParameters(), and whether the goal is possible with this mechanism and these sensors.
/// Throws InputError naming the parameter or the mechanism's key.
void checkGoal(const Mechanism& mechanism, const AlignParameters& parameters,
               Sensors sensors = Sensors::kBoth);

/// Runs a strategy until the peg's edge is within the hole, or the peg is seated where an insertion
/// is requested, or it fails. `mechanism`: the nominal parameters of the parts, not their poses.
/// Throws InputError for bad parameters, PlantError when the plant fails.
AlignResult align(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                  const std::function<void(const AlignProgress&)>& progress = nullptr);

/// Moves the peg out of the hole along its bore, led by the walls, from a depth of
/// `parameters.inserted`. Where that isn't known, 0, a peg that hangs free is moved up until no
/// wall is beside it; false: none was. Throws InputError for bad parameters, AlignError where the
/// peg doesn't come out, PlantError.
bool withdraw(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
              const std::function<void(const AlignProgress&)>& progress = nullptr);

}  // namespace assembly_cell
