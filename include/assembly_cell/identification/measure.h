// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/align/plant.h"
#include "assembly_cell/identification/response.h"

namespace assembly_cell {

/// What is done to the cell, in cell time. The peg begins hanging free over the face, the hole
/// somewhere below.
struct IdentificationPlan {
  // hanging: stepped sine, each step with the exciter turning either way
  std::vector<double> hanging;  ///< frequencies [rad/s]
  double hanging_force = 1.5;   ///< amplitude of the exciter [N]
  // a turn under gravity, about both axes, both ways
  double lift = 0.012;  ///< before it [m]
  double turn = 0.2;    ///< [rad]
  // pressed: stepped sine on the face beside the hole, and a slow push sideways
  std::vector<double> pressed;  ///< frequencies [rad/s]
  int places = 3;               ///< round the hole
  double beside = 0.02;         ///< from where the peg hangs to each; the face must be there [m]
  double tilt = 0.07;           ///< of the peg against the face, its low side outward [rad]
  double press = 15.0;          ///< [N]
  double force_limit = 40.0;    ///< contact force at which it is given up [N]
  // each step
  double swing = 0.6;        ///< until a swing of the hanging peg has died away [s]
  double settle = 0.12;      ///< before a window of the pressed one [s]
  double window = 0.2;       ///< whole periods of 50 and 60 Hz [s]
  double time_limit = 60.0;  ///< no step begins later [s]
};

/// Frequencies for a mechanism: where its resonances are as drawn, multiples of 5 Hz so that a
/// window holds whole periods, none of them 50 or 60 Hz. Throws InputError as operatingFrequency.
IdentificationPlan planFor(const Mechanism& nominal);

/// A step of a stepped sine.
struct VibrationReading {
  ExciterParameters exciter;             ///< as it was asked for
  WrenchPhasor phasor;                   ///< of sensor_b's wrench
  Matrix6 covariance = Matrix6::Zero();  ///< of its real part by white noise, as of the imaginary
  std::optional<int> place;              ///< where the peg was pressed; none: it hung
  Eigen::Matrix3d R_BS = Eigen::Matrix3d::Identity();  ///< sensor axes in the carrier's base
  Vector6 contact = Vector6::Zero();                   ///< as in PressedState; 0 where it hung
  double since_zero = 0.0;  ///< from the zero of `contact` to the window [s]
  bool held_out = false;    ///< left out of the fit, to judge it
};

/// The peg at rest in a turned pose.
struct PoseReading {
  Eigen::Matrix3d R_BS = Eigen::Matrix3d::Identity();
  double time = 0.0;                     ///< middle of the window, plant clock [s]
  Vector6 wrench = Vector6::Zero();      ///< mean of sensor_b
  Matrix6 covariance = Matrix6::Zero();  ///< of it, by white noise and rounding
};

/// The push sideways.
struct FrictionReading {
  double coefficient = 0.0;  ///< half of what lies between sliding to and fro
  double sd = 0.0;
};

struct IdentificationData {
  std::vector<VibrationReading> vibrations;
  std::vector<PoseReading> poses;
  std::optional<FrictionReading> friction;
  std::vector<std::string> notes;  ///< what could not be done and why
  double time = 0.0;               ///< cell time that it took [s]
};

struct IdentificationProgress {
  std::string state;  ///< tare, hanging, gravity, pressed, push
  double time = 0.0;  ///< cell time since the beginning [s]
  int readings = 0;
};

/// Carries out the plan. What contact refuses is named in `notes`, and the rest goes on. Throws
/// AlignError where not even the hanging peg can be shaken, PlantError when the plant fails.
IdentificationData measure(Plant& plant, const Mechanism& nominal, const IdentificationPlan& plan,
                           const std::function<void(const IdentificationProgress&)>& progress = {});

class GuardedCarrier;
/// One step of the stepped sine: exciter as asked for, `settle` and `window` [s]. `contact` is the
/// mean over the window less the tare. The exciter goes on. Throws AlignError no_reading.
VibrationReading readVibration(GuardedCarrier& carrier, const ExciterParameters& exciter,
                               double settle, double window);

}  // namespace assembly_cell
