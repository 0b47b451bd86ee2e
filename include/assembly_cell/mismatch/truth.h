// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {

// Ground truth that was drawn for one run: plain numbers. Exact by default. SI units.

/// How a sensor's samples differ from the wrench in it. Torques count against forces at 30 mm.
struct SensorTruth {
  static constexpr double kLever = 0.03;  ///< [m]
  Matrix6 matrix = Matrix6::Zero();       ///< E of w' = (I + E) w, torques in N at the lever
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  ///< of the sensor in its frame, vector [rad]
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();    ///< of its origin there [m]
  Vector6 drift = Vector6::Zero();                     ///< of the zeros [N/min], [N·m/min]
  double walk = 0.0;  ///< random walk of every zero, torques at the lever [N/√min]
  Eigen::Vector3d hum = Eigen::Vector3d::Zero();  ///< amplitude, sensor axes [N]
  double hum_frequency = 0.0;                     ///< [Hz]
  double hum_phase = 0.0;                         ///< [rad]
  double latency = 0.0;         ///< a sample's stamp is so much later than its wrench [s]
  std::uint64_t walk_seed = 0;  ///< of the walk's random numbers

  /// I + E in SI units.
  Matrix6 gain() const {
    Matrix6 E = matrix;
    E.topRightCorner<3, 3>() /= kLever;
    E.bottomLeftCorner<3, 3>() *= kLever;
    return Matrix6::Identity() + E;
  }
};

/// How the carrier differs from what is commanded and reported.
struct CarrierTruth {
  static constexpr double kTurn = 0.1;  ///< rotations against translations [rad/m]
  Eigen::Vector3d reading_noise = Eigen::Vector3d::Zero();  ///< sd of the reported pose [m]
  Eigen::Vector3d repeatability = Eigen::Vector3d::Zero();  ///< sd of a move's end [m]
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  ///< of the encoders' base in the base [rad]
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();    ///< of its origin there [m]
  Eigen::Vector3d scale = Eigen::Vector3d::Zero();  ///< a distance s is reported as (1 + scale) s
  double latency = 0.0;                             ///< from a command to its effect [s]
  double jitter = 0.0;                              ///< of the latency, uniform from 0 [s]
  double lag = 0.0;  ///< time constant of the commanded motion's first-order lag [s]
  Eigen::Vector3d backlash = Eigen::Vector3d::Zero();  ///< whole gap behind the encoders [m]
  std::uint64_t reading_seed = 0, repeatability_seed = 0, jitter_seed = 0;
};

/// Burr in the bore: while the peg's edge is in this part of the depth, the friction of all
/// contacts is multiplied. Taken once a block.
struct BurrTruth {
  double friction = 1.0;  ///< factor of both coefficients
  double depth = 0.0;     ///< where it begins below the hole's plane [m]
  double length = 0.0;    ///< along the bore [m]; 0: no burr
};

/// Ground truth of a simulated cell besides its scenario.
struct CellTruth {
  SensorTruth sensor_a, sensor_b;
  CarrierTruth carrier;
  BurrTruth burr;
};

/// Numbers of one entry of `scale` or `add`.
struct DrawnChange {
  std::string key;   ///< as in the file
  std::string path;  ///< without ".each"
  bool each = false;
  std::vector<double> values;    ///< one, or one for each entry
  double low = 0.0, high = 0.0;  ///< how far another draw may reach
};

/// All that was drawn.
struct Truth {
  std::vector<DrawnChange> scale, add;
  Imperfections imperfections;  ///< exciter, compliance and the bore's lean
  CellTruth cell;
  Eigen::Vector2d bore_tilt = Eigen::Vector2d::Zero();  ///< of the bore's axis in `hole` [rad]
  Eigen::Vector2d face_tilt = Eigen::Vector2d::Zero();  ///< of the block against the base [rad]
  std::vector<std::string> drawn;  ///< key paths of the file, in its order, scale and add apart
};

}  // namespace assembly_cell
