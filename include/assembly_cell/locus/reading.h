// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/locus/contact_model.h"
#include "assembly_cell/locus/half_turn.h"
#include "assembly_cell/locus/harmonic_fit.h"
#include "assembly_cell/locus/sliding_friction.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

// Locus measurement: evaluation of the samples of a window. Used by the simulated plant, the
// estimator's node, the strategies and the tool.

/// Limits of a locus measurement. Origins, and what half and twice of each do:
/// docs/theory/locus.md, "Limits".
struct ReadingLimits {
  double false_alarm = 0.01;     ///< rate at which a true mode is refused
  double indifference = 0.05;    ///< ratio of the axes, or of N to P, that counts as none
  double misfit = 0.2;           ///< of a single contact, relative to the locus: more is none
  double direction_sd = 0.1;     ///< of a direction: more is none [rad]
  double half_turn = 0.99;       ///< weight of one end of the diameter that settles it
  double axes_ratio = 0.1;       ///< a single contact's flatter locus looks like a double one's
  double friction_across = 0.4;  ///< fraction of the force across the slip: more is no slide
  double friction_sds = 3.0;     ///< a coefficient below so many of its sd is none
};

/// How to improve the next measurement.
enum class ReadingAdvice {
  kNone = 0,
  kReadLonger = 1,  ///< the mode is undecided, or noise hides the direction: a longer window
  kPressMore = 2    ///< the contact slips: press more or shake less
};
/// Empty for kNone, else what to do.
const char* toString(ReadingAdvice advice);

/// Result of a locus measurement. All in sensor axes, taken as upright (LocusAxes::kSensor).
struct LocusReading {
  Locus locus;  ///< of the centre of mass
  ModeDecision mode;
  HalfTurnEvidence evidence;                   ///< empty where only the plane was measured
  Eigen::Vector3d force{0, 0, 0};              ///< static contact force on the peg by the mean [N]
  double misfit = 0.0;                         ///< of the best single contact; 0: not evaluated
  std::optional<DirectionEstimate> direction;  ///< of a single contact, its half turn resolved
  std::optional<SlidingFriction> friction;     ///< of a peg that slides
  ReadingAdvice advice = ReadingAdvice::kNone;
  std::string refusal;  ///< by name, `too_uncertain`; empty: of use
  double better_frequency =
      0.0;  ///< best one for the direction, where this one isn't sufficient [rad/s]
};

/// Input of a locus measurement.
struct MeasuredMotion {
  HarmonicFit fit;              ///< of the coupling's six displacements, sensor axes; or
  bool plane = false;           ///< of x and y of the centre of mass itself
  std::optional<double> press;  ///< contact force [N]; none: from the mean displacement
};

/// Measurement from a fit. `previous`: mode of a sliding estimate, for its hysteresis. An exciter
/// of amplitude 0 gives locus, mode and force only. Throws InputError as contactDirection, and
/// where the model has no answer at the exciter's frequency.
LocusReading readLocus(const Mechanism& mechanism, const ExciterParameters& exciter,
                       const MeasuredMotion& motion, const ReadingLimits& limits = {},
                       std::optional<LocusMode> previous = {});

/// Measurement from the samples of a window: angle of the exciter [rad] and the coupling's
/// displacements, 6 × n, as fitHarmonic. Refused where its noise would hide the direction of the
/// worst contact; then, and where a single contact would look like two, with a better frequency.
LocusReading readLocus(const Mechanism& mechanism, const ExciterParameters& exciter,
                       const std::vector<double>& angle, const std::vector<double>& displacements,
                       const ReadingLimits& limits = {});

/// Recomputes direction, half turn and advice of a measurement at an operating point whose tilts,
/// press and kind of contact are more accurate than the mean of the samples. Throws InputError as
/// contactDirection.
void explain(const Mechanism& mechanism, const OperatingPoint& point, const ReadingLimits& limits,
             LocusReading& reading, LocusAxes axes = LocusAxes::kSensor);

}  // namespace assembly_cell
