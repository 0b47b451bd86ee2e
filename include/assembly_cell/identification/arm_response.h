// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "assembly_cell/identification/measure.h"

namespace assembly_cell {

// The response of the arm that carries the peg: a chirp of the commanded height in light contact,
// force against command.

/// At the start the peg hangs free over the face and the hole.
struct ArmPlan {
  double force_limit = 40.0;  ///< contact force at which the measurement is aborted [N]
  double beside = 0.02;       ///< distance of the contact's place from the start, on the face [m]
  double tilt = 0.07;         ///< of the peg against the face, its low side outward [rad]
  double period = 2.5;        ///< of the chirp [s]
  int periods = 4;            ///< of them the first one, while the contact settles, is left out
};

/// A block in contact.
struct ArmSample {
  double time = 0.0;     ///< its end, plant clock [s]
  double command = 0.0;  ///< travel towards the face, issued then [m]
  double force = 0.0;    ///< along the face's normal, as it is known then [N]
};

/// Response at one frequency of the chirp.
struct ArmResponsePoint {
  double frequency = 0.0;  ///< [rad/s]
  double gain = 0.0;       ///< [N/m]
  double phase = 0.0;      ///< of the force against the command; negative: later [rad]
  double sd = 0.0;         ///< of the phase, and of the gain's logarithm
};

struct ArmIdentification {
  ArmResponse arm;
  /// Stiffness at the peg's edge by the mechanism as drawn [N/m]
  double drawn_stiffness = 0.0;
  std::vector<ArmResponsePoint> points;
  double force = 0.0;  ///< largest of the chirp [N]
  double time = 0.0;   ///< duration in cell time [s]
};

/// Throws InputError where the mount is too stiff for a chirp within the force limit. Smaller
/// chirps have been tried.
void checkArmPlan(const Mechanism& nominal, const ArmPlan& plan);

/// Blocks of a peg that follows `travel` in light contact.
struct ArmRecording {
  std::vector<ArmSample> samples;
  double upright = 0.0;  ///< compliance that an upright peg's edge has more, as drawn [m/N]
  double reach = 0.0;    ///< amplitude of the command [m]
  double time = 0.0;     ///< of all, with the moves [s]
};
/// Presses the tilted peg lightly on the face beside the hole and commands `travel` of the time
/// [s], -1 to 1, in units of the chirp's amplitude, for `duration` [s]. The path is the one by
/// which the force stays along the normal, so that friction has no effect. Throws InputError,
/// AlignError, PlantError.
ArmRecording recordArm(Plant& plant, const Mechanism& nominal, const ArmPlan& plan,
                       const std::function<double(double)>& travel, double duration,
                       const std::function<void(const IdentificationProgress&)>& progress = {});

/// The response from blocks of a chirp that begins at `begin` [s]. Logarithm of gain and phase are
/// polynomials of the frequency; stiffness and delay are their limits at 0. Standard deviations
/// contain the scatter from period to period, forces at frequencies that the chirp doesn't have,
/// and the effect of the polynomials' last term. Throws AlignError `no_reading` where the force
/// doesn't follow the command.
ArmIdentification fitArm(const std::vector<ArmSample>& samples, double begin, const ArmPlan& plan);

/// The response as a line of a scenario or mechanism file.
std::string armLine(const ArmResponse& arm);

/// Travel of the chirp, in units of its amplitude.
double chirpAt(double time, double period);

/// Measures the series stiffness at an upright peg's edge, corrected as drawn for the tilt, and the
/// delay from a command to its effect in the force as a strategy receives it. The peg hangs where
/// it did at the end. Throws InputError as checkArmPlan(), AlignError, PlantError.
ArmIdentification identifyArm(
    Plant& plant, const Mechanism& nominal, const ArmPlan& plan,
    const std::function<void(const IdentificationProgress&)>& progress = {});

}  // namespace assembly_cell
