// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// Excitation and press force while a locus is measured.
struct VibrationPoint {
  double frequency = 0.0;     ///< of the exciter [rad/s]
  double amplitude = 0.0;     ///< [N]
  double press = 0.0;         ///< contact force [N]
  double direction_sd = 0.0;  ///< expected of one reading's direction, the worst of all [rad]
};

/// Input of the choice besides the mechanism. Zeros of `given` are chosen.
struct VibrationDemand {
  VibrationPoint given;                ///< direction_sd is not used
  double tilt = 0.052;                 ///< of the peg against the plane [rad]
  double shake = 1.5;                  ///< the contact must hold for this times the amplitude
  double max_press = 0.0;              ///< [N]
  double friction = 0.0;               ///< measured coefficient; 0: the mechanism's
  double window = 0.2;                 ///< of a reading [s]
  double samples = 1000.0;             ///< in a window
  Matrix6 scatter = Matrix6::Zero();   ///< covariance of one sample of sensor_b at rest
  Matrix6 rounding = Matrix6::Zero();  ///< that its converter adds
};

/// Operating point for this sensor. Frequency: where the locus of a contact that still sticks
/// determines the direction best, among those where a single contact is no segment (that is the
/// sign of double contact). Amplitude: as much as friction holds. Press: as little as makes the
/// direction as good as the model. A converter coarser than its noise rounds a vibration of A steps
/// alike in every period: an error of 0.11/√A steps (Bessel series of a rounded sine) that no
/// window averages out, so that coarse converters need force. Throws InputError where no frequency
/// will do.
VibrationPoint chooseVibration(const Mechanism& mechanism, const VibrationDemand& demand);

}  // namespace assembly_cell
