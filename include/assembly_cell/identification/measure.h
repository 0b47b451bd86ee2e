// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/align/plant.h"
#include "assembly_cell/identification/response.h"

namespace assembly_cell {

/// Steps of the measurement, in cell time. At the start the peg hangs free over the face and the
/// hole.
struct IdentificationPlan {
  // hanging: stepped sine, each step in both directions of the exciter
  std::vector<double> hanging;  ///< frequencies [rad/s]
  double hanging_force = 1.5;   ///< amplitude of the exciter [N]
  // poses under gravity: rotated about both axes, both ways
  double lift = 0.012;  ///< before the rotation [m]
  double turn = 0.2;    ///< rotation [rad]
  // pressed: stepped sine on the face beside the hole, and a slow push sideways
  std::vector<double> pressed;  ///< frequencies [rad/s]
  int places = 3;               ///< number of positions around the hole
  double beside = 0.02;         ///< distance of each from the start, on the face [m]
  double tilt = 0.07;           ///< of the peg against the face, its low side outward [rad]
  double press = 15.0;          ///< press force [N]
  double force_limit = 40.0;    ///< contact force at which the press is aborted [N]
  // each step
  double swing = 0.6;        ///< waiting time for a swing of the hanging peg to decay [s]
  double settle = 0.12;      ///< waiting time before a window of the pressed peg [s]
  double window = 0.2;       ///< whole periods of 50 and 60 Hz [s]
  double time_limit = 60.0;  ///< no step starts later [s]
};

/// Frequencies around the resonances of the mechanism as drawn, multiples of 5 Hz so that a window
/// has whole periods, none of them 50 or 60 Hz. Throws InputError as operatingFrequency.
IdentificationPlan planFor(const Mechanism& nominal);

/// A step of a stepped sine.
struct VibrationReading {
  ExciterParameters exciter;             ///< as commanded
  WrenchPhasor phasor;                   ///< of sensor_b's wrench
  Matrix6 covariance = Matrix6::Zero();  ///< of the real part, and of the imaginary, by white noise
  std::optional<int> place;              ///< index of the pressed position; none: hanging
  Eigen::Matrix3d R_BS = Eigen::Matrix3d::Identity();  ///< sensor axes in the carrier's base
  Vector6 contact = Vector6::Zero();                   ///< as in PressedState; 0 hanging
  double since_zero = 0.0;  ///< from the zero of `contact` to the window [s]
  bool held_out = false;    ///< left out of the fit, to check it
};

/// The peg at rest in a rotated pose.
struct PoseReading {
  Eigen::Matrix3d R_BS = Eigen::Matrix3d::Identity();
  double time = 0.0;                     ///< middle of the window, plant clock [s]
  Vector6 wrench = Vector6::Zero();      ///< mean of sensor_b
  Matrix6 covariance = Matrix6::Zero();  ///< of the mean, by white noise and rounding
};

/// Friction by a push sideways.
struct FrictionReading {
  double coefficient = 0.0;  ///< half the difference between sliding forth and back
  double sd = 0.0;
};

struct IdentificationData {
  std::vector<VibrationReading> vibrations;
  std::vector<PoseReading> poses;
  std::optional<FrictionReading> friction;
  std::vector<std::string> notes;  ///< steps that failed and why
  double time = 0.0;               ///< duration in cell time [s]
};

struct IdentificationProgress {
  std::string state;  ///< tare, hanging, gravity, pressed, push
  double time = 0.0;  ///< cell time since the beginning [s]
  int readings = 0;
};

/// Carries out the plan. Failed steps in contact are listed in `notes`. Throws AlignError when the
/// hanging peg can't be excited, PlantError when the plant fails.
IdentificationData measure(Plant& plant, const Mechanism& nominal, const IdentificationPlan& plan,
                           const std::function<void(const IdentificationProgress&)>& progress = {});

class GuardedCarrier;

/// Up before a travel aside [m]
inline constexpr double kClearFace = 4e-3;
/// Where a tilted peg is tared before it touches the face.
struct PlaceBeside {
  Eigen::Vector2d outward{1.0, 0.0};  ///< direction from the start, unit vector, carrier axes
  double beside = 0.0;                ///< distance [m]
  double tilt = 0.0;                  ///< its low side outward [rad]
  int blocks = 10;                    ///< of the tare
};
/// Moves the peg there from `start` and tares it. Returns the axes of the carrier, in its base.
/// Throws AlignError, PlantError.
Eigen::Matrix3d tareBeside(GuardedCarrier& carrier, const Mechanism& mechanism, const Pose& start,
                           const PlaceBeside& place);

/// One step of the stepped sine: exciter as commanded, `settle` and `window` [s]. `contact` is the
/// mean over the window less the tare. The exciter stays on. Throws AlignError no_reading.
VibrationReading readVibration(GuardedCarrier& carrier, const ExciterParameters& exciter,
                               double settle, double window);

}  // namespace assembly_cell
