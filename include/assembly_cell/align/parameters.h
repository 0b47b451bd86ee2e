// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace assembly_cell {

class FieldList;

// Parameters of the strategies. Defaults are those of the default cell. Units, ranges and
// descriptions: src/align/parameters.cpp.

/// The insertion after the alignment.
struct InsertParameters {
  double depth = 0.0;    ///< goal: of the bottom edge below the plane; 0: the peg stays aligned [m]
  bool floor = false;    ///< goal: down to the floor of the hole instead; depth is 0 then
  double force = 12.0;   ///< [N]
  double speed = 0.012;  ///< [m/s]
  double exciter = 0.0;  ///< [N]
  double time_limit = 0.0;  ///< 0: chosen, see align.cpp [s]

  bool wanted() const { return floor || depth > 0.0; }
  /// Depth at which the peg is seated: the goal's, or the hole's. [m]
  double goal(double hole_depth) const { return floor ? hole_depth : depth; }
};

struct AlignParameters {
  std::string strategy = "auto";
  double press_force = 0.0;        ///< 0: chosen [N]
  double press_tolerance = 0.05;   ///< fraction of press_force
  double force_limit = 40.0;       ///< [N]
  double time_limit = 0.0;         ///< 0: that of the strategy, see align.cpp [s]
  double descent_limit = 0.02;     ///< [m]
  double approach_step = 1e-4;     ///< in one block [m]
  double arm_delay = 0.0;          ///< from a contact to its reaction; 0: no arm [s]
  double exciter_amplitude = 0.0;  ///< 0: chosen [N]
  double exciter_frequency = 0.0;  ///< 0: chosen, see chooseVibration() [rad/s]
  int exciter_direction = 1;
  double shake = 1.5;         ///< of exciter_amplitude
  double settle = 0.1;        ///< [s]
  double window = 0.2;        ///< [s]
  double sweep_tilt = 0.052;  ///< about 3 degrees [rad]
  int sweep_readings = 20;
  double direction_limit = 0.01;  ///< [rad]
  double lift = 3e-4;             ///< [m]
  double insertion_depth = 5e-4;  ///< [m]
  double insertion_force = 2.0;   ///< [N]
  int rounds = 3;

  // twin_force
  double contact_force = 15.0;  ///< [N]
  double contact_tilt = 0.052;  ///< about 3 degrees [rad]
  double contact_window = 0.2;  ///< [s]
  double settled_force = 0.02;  ///< [N]
  int fewest_contacts = 3;
  int most_contacts = 12;
  double required_position = 3e-5;  ///< [m]
  double required_rotation = 1e-3;  ///< [rad]

  InsertParameters insert;

  // not set by people: of exciter and carrier besides the mechanism, as in OperatingPoint
  Eigen::Vector2d exciter_ellipse{0, 0};
  double carrier_compliance = 0.0;  ///< [m/N]
  /// Depth of the bottom edge below the plane at the start, as the previous goal has measured it;
  /// 0: unknown, or not in the hole. [m]
  double inserted = 0.0;
  /// Time limits where none are given, of a carrier that follows at once; 0: none [s]
  double default_time = 0.0, default_insert_time = 0.0;
  double spent = 0.0;  ///< by strategies before this one [s]
};

std::vector<std::string> strategyNames();

/// What a person can set; `insert.depth` and `insert.floor` are of a goal.
void fields(FieldList& f, InsertParameters& p);
void fields(FieldList& f, AlignParameters& p);
/// The fields without those of the insertion.
void alignFields(FieldList& f, AlignParameters& p);

/// Throws InputError naming the parameter, its value and its range.
void checkParameters(const AlignParameters& parameters);

}  // namespace assembly_cell
