// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <string>

#include "assembly_cell/align/plant.h"

namespace assembly_cell {

/// Parameters of a strategy. Defaults are those of the default cell.
struct AlignParameters {
  std::string strategy = "single_contact";
  double press_force = 12.0;         ///< [N]
  double press_tolerance = 0.05;     ///< fraction of press_force
  double force_limit = 40.0;         ///< abort above [N]
  double descent_limit = 0.02;       ///< abort when no contact within [m]
  double approach_step = 1e-4;       ///< way down in one block before contact [m]
  double exciter_amplitude = 1.0;    ///< [N]
  double exciter_frequency = 770.0;  ///< [rad/s]; 0: operatingFrequency()
  int exciter_direction = 1;
  double shake = 1.5;             ///< exciter while the contact settles, times its amplitude
  double settle = 0.1;            ///< vibrating before a reading, each of shaken and not [s]
  double window = 0.2;            ///< of one reading [s]
  double sweep_tilt = 0.052;      ///< commanded tilt of the sweep, about 3 degrees [rad]
  int sweep_readings = 36;        ///< once round
  double lift = 3e-4;             ///< above the touch before a rotation [m]
  double insertion_depth = 5e-4;  ///< of the edge below the plane that counts as aligned [m]
  double insertion_force = 2.0;   ///< more than this on the way means not aligned [N]
  int rounds = 3;                 ///< sweeps at most

  // twin_force
  double contact_force = 15.0;      ///< of each contact [N]
  double contact_tilt = 0.052;      ///< of the peg against the plane, about 3 degrees [rad]
  double contact_window = 0.2;      ///< that is averaged, hanging free and pressed [s]
  double settled_force = 0.02;      ///< a window whose halves differ by more is not settled [N]
  int fewest_contacts = 3;          ///< before the peg is moved over the hole
  int most_contacts = 12;           ///< of one round
  double required_position = 3e-5;  ///< sd of the hole, per axis, that is enough [m]
  double required_rotation = 1e-3;  ///< [rad]
  Pose X_AH{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0, 0, 0.06)};  ///< hole in sensor_a
};

/// Progress for people and for the action's feedback.
struct AlignProgress {
  std::string state;  ///< of the state machine
  int contacts = 0;   ///< readings taken
  double time = 0.0;  ///< plant clock [s]
  std::string message;
  double position_sd = 0.0;  ///< of the hole's centre as known now, 2 axes; 0: not known [m]
  double rotation_sd = 0.0;  ///< of its axis, 2 axes [rad]
};

/// How an alignment ended.
struct AlignResult {
  bool success = false;
  std::string reason;  ///< "aligned", or the named failure
  bool known = false;  ///< offset and tilt were estimated
  Eigen::Vector2d offset{
      0, 0};  ///< estimated: hole centre relative to the peg's bottom centre at reference_time [m]
  Eigen::Matrix2d offset_covariance = Eigen::Matrix2d::Zero();  ///< [m²]
  Eigen::Vector2d tilt{0, 0};  ///< estimated tilt of the peg axis then, rotation vector x, y [rad]
  double tilt_sd = 0.0;        ///< [rad]
  int contacts = 0;            ///< readings taken
  double time = 0.0;           ///< plant clock used [s]
  double reference_time =
      0.0;  ///< plant clock when the peg hung at rest, before its first move [s]
};

/// Throws InputError naming the parameter, its value and its range.
void checkParameters(const AlignParameters& parameters);

/// Runs a strategy until the peg's edge lies within the hole or a failure is named. `mechanism`
/// gives the nominal parameters of the parts (not where they are). Throws InputError for bad
/// parameters, PlantError when the plant fails.
AlignResult align(Plant& plant, const Scenario& mechanism, const AlignParameters& parameters,
                  const std::function<void(const AlignProgress&)>& progress = nullptr);

}  // namespace assembly_cell
