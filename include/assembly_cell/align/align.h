// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/align/plant.h"

namespace assembly_cell {

/// The way down after the alignment. Defaults are those of the default cell.
struct InsertParameters {
  double depth = 0.0;    ///< of the bottom edge below the plane; 0: the peg stays aligned [m]
  bool floor = false;    ///< down to the floor of the hole instead; depth is 0 then
  double force = 12.0;   ///< contact force at which the peg stops [N]
  double speed = 0.012;  ///< without resistance [m/s]
  double exciter = 0.0;  ///< shakes the peg on the way down; 0: off [N]

  bool wanted() const { return floor || depth > 0.0; }
  /// Depth at which the peg is seated: the one asked for, or the hole's. [m]
  double goal(double hole_depth) const { return floor ? hole_depth : depth; }
};

/// Parameters of a strategy. Defaults are those of the default cell.
struct AlignParameters {
  std::string strategy = "auto";
  double press_force = 0.0;        ///< while a locus is read; 0: chosen [N]
  double press_tolerance = 0.05;   ///< fraction of press_force
  double force_limit = 40.0;       ///< abort above [N]
  double descent_limit = 0.02;     ///< abort when no contact within [m]
  double approach_step = 1e-4;     ///< travel down in one block before contact [m]
  double exciter_amplitude = 0.0;  ///< 0: chosen [N]
  double exciter_frequency = 0.0;  ///< 0: chosen, see chooseVibration() [rad/s]
  int exciter_direction = 1;
  double shake = 1.5;             ///< exciter while the contact settles, times its amplitude
  double settle = 0.1;            ///< before a reading, after the exciter shook harder [s]
  double window = 0.2;            ///< of one reading at most [s]
  double sweep_tilt = 0.052;      ///< commanded tilt of the sweep, about 3 degrees [rad]
  int sweep_readings = 20;        ///< of a round, with those for the plane, at most
  double direction_limit = 0.01;  ///< expected sd of a reading beyond which nothing is tried [rad]
  double lift = 3e-4;             ///< above the touch before a rotation [m]
  double insertion_depth = 5e-4;  ///< of the edge below the plane that counts as aligned [m]
  double insertion_force = 2.0;   ///< more than this on the way means not aligned [N]
  int rounds = 3;                 ///< sweeps at most

  // what is known of exciter and carrier besides the mechanism, as in OperatingPoint
  Eigen::Vector2d exciter_ellipse{0, 0};
  double carrier_compliance = 0.0;  ///< [m/N]

  // twin_force
  double contact_force = 15.0;      ///< of each contact [N]
  double contact_tilt = 0.052;      ///< of the peg against the plane, about 3 degrees [rad]
  double contact_window = 0.2;      ///< that is averaged, hanging free and pressed [s]
  double settled_force = 0.02;      ///< a window whose halves differ by more is not settled [N]
  int fewest_contacts = 3;          ///< before the peg is moved over the hole
  int most_contacts = 12;           ///< of one attempt
  double required_position = 3e-5;  ///< sd of the hole, per axis, that is enough [m]
  double required_rotation = 1e-3;  ///< [rad]

  InsertParameters insert;
  /// Depth of the bottom edge below the plane at the start, as an end before has told it; 0: not
  /// known, or not in the hole. [m]
  double inserted = 0.0;
};

/// Progress for people and for the action's feedback.
struct AlignProgress {
  std::string state;  ///< of the state machine
  int contacts = 0;   ///< readings taken
  double time = 0.0;  ///< plant clock [s]
  std::string message;
  double position_sd = 0.0;  ///< of the hole's centre as known now, 2 axes; 0: not known [m]
  double rotation_sd = 0.0;  ///< of its axis, 2 axes [rad]
  double depth = 0.0;        ///< of the bottom edge, on the way down [m]
  double force = 0.0;        ///< there [N]
  int walls = 0;             ///< points of the peg that the bore pushes there, as BoreReading
};

/// A direction of contact that was felt.
struct DirectionReading {
  double start = 0.0, end = 0.0;  ///< window of the reading, plant clock [s]
  double direction = 0.0;         ///< azimuth of the contact on the peg's edge, peg axes [rad]
  double sd = 0.0;                ///< [rad]
};

/// What the peg feels in the bore: the contacts' wrench at the centre of its bottom edge, less its
/// weight.
struct BoreReading {
  double depth = 0.0;     ///< of that centre below the plane, as felt [m]
  double along = 0.0;     ///< up the peg's axis [N]
  double sideways = 0.0;  ///< [N]
  double moment = 0.0;    ///< across the axis [N·m]
  int walls = 0;          ///< points that the bore pushes: none, one, or two at both ends

  double force() const { return std::hypot(along, sideways); }
};

/// How the way down ended.
struct InsertResult {
  bool seated = false;  ///< at the depth, or on the floor
  BoreReading end;
  double force = 0.0;                ///< the greatest mean over a block on the way [N]
  double time = 0.0;                 ///< plant clock used [s]
  int backed_out = 0;                ///< times that the peg was stuck and went up again
  std::vector<BoreReading> profile;  ///< one each millimetre
};

/// How an alignment ended.
struct AlignResult {
  bool success = false;
  AlignFailure failure = AlignFailure::kNone;
  std::string reason;  ///< "aligned", or the failure's name and what happened
  bool known = false;  ///< offset and tilt were estimated
  Eigen::Vector2d offset{
      0, 0};  ///< estimated: hole centre relative to the peg's bottom centre at reference_time [m]
  Eigen::Matrix2d offset_covariance = Eigen::Matrix2d::Zero();  ///< [m²]
  Eigen::Vector2d tilt{0, 0};  ///< estimated tilt of the peg axis then, rotation vector x, y [rad]
  double tilt_sd = 0.0;        ///< [rad]
  /// The same offset as wrenches alone told it, before touches and walls; twin_force only.
  std::optional<Eigen::Vector2d> wrench_offset;
  Eigen::Matrix2d wrench_covariance = Eigen::Matrix2d::Zero();  ///< [m²]
  int contacts = 0;                                             ///< readings taken
  double time = 0.0;                                            ///< plant clock used [s]
  double reference_time =
      0.0;  ///< plant clock when the peg hung at rest, before its first move [s]
  std::vector<DirectionReading> readings;  ///< that the last estimate rests on
  double depth = 0.0;  ///< of the bottom edge below the plane at the end, 0 without success [m]
  InsertResult insert;
};

/// Throws InputError naming the parameter, its value and its range.
void checkParameters(const AlignParameters& parameters);

/// The same with what these parts can't: throws InputError naming the parameter or the mechanism's
/// key.
void checkGoal(const Mechanism& mechanism, const AlignParameters& parameters);

/// Runs a strategy until the peg's edge lies within the hole, or is seated where an insertion is
/// asked for, or a failure is named. `mechanism`
/// gives the nominal parameters of the parts (not where they are). Throws InputError for bad
/// parameters, PlantError when the plant fails.
AlignResult align(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                  const std::function<void(const AlignProgress&)>& progress = nullptr);

/// Out of the hole along its bore, the walls leading, from a depth of `parameters.inserted`. Throws
/// InputError for bad parameters, AlignError where the peg doesn't come out, PlantError.
void withdraw(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
              const std::function<void(const AlignProgress&)>& progress = nullptr);

}  // namespace assembly_cell
