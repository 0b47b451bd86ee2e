// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

namespace assembly_cell {

/// Peg in double contact, tilted by phi about the chord, vibrating by theta about it.
struct SlidingCase {
  double K = 0.0, I = 0.0;  ///< about the chord, 4.17 and 4.18
  double w = 0.0, h = 0.0, kx = 0.0, l = 0.0, m = 0.0, g = 0.0;
  double phi = 0.0;    ///< static tilt [rad], below a right angle
  double theta = 0.0;  ///< amplitude [rad]
  double d = 0.0;      ///< peg axis to chord; only the inertia forces depend on it
};

enum class SlidingBand { kLow, kIntermediate, kHigh };
const char* toString(SlidingBand band);

/// Ratios of sliding to normal force at both ends of the swing: the peg slides in when p1 > mu, out
/// when p2 > mu. Empty where the normal force is not positive: the contacts lift.
struct SlidingRatio {
  SlidingBand band = SlidingBand::kLow;
  double w_lower = 0.0, w_upper = 0.0;  ///< intermediate band [rad/s]
  double D = 0.0;                ///< force into the hole per rotation, without inertia forces
  std::optional<double> p1, p2;  ///< thesis form, quasi-static
  std::optional<double> p1_inertia, p2_inertia;  ///< ratios with the inertia forces
};

/// 4.19–4.28 in one form, and completed by the d'Alembert forces. Corrected: F_S for the second
/// F_x, cos((a + th)/2) before 4.24, the signs and parentheses of 4.23–4.28, the band's limit;
/// without inertia forces the reversal at high frequency of 4.27 and 4.28 is an artefact. Throws
/// InputError for K < kx (2h + l)², which 4.17 excludes.
SlidingRatio slidingRatio(const SlidingCase& s);

// ---- design aid ----

/// Peg, support and friction of a map over frequency and amplitude.
struct DesignCase {
  double m = 0.0, r = 0.0, h = 0.0, g = 0.0;
  double K = 0.0;            ///< about the chord
  double kx = 0.0, l = 0.0;  ///< transverse stiffness at G, height of G above the peg's top
  double d = 0.0;            ///< peg axis to chord, below r
  double phi = 0.0, mu = 0.0;
  bool inertia = true;  ///< complete form; false: the thesis's
};

enum class VibrationOutcome {
  kSticks,      ///< p1 and p2 at most mu
  kAssembles,   ///< p1 > mu >= p2
  kSlidesBoth,  ///< p1 > p2 > mu: in both directions, more inwards
  kSlidesOut,   ///< p2 > mu, p2 >= p1
  kLifts,       ///< a contact lifts and the other slips (4.41)
  kWalksOut     ///< a contact lifts and the other sticks: 4.35–4.41
};
const char* toString(VibrationOutcome outcome);

struct DesignPoint {
  double theta = 0.0;  ///< amplitude of 4.16 [rad]
  std::optional<double> p1, p2;
  VibrationOutcome outcome = VibrationOutcome::kSticks;
};

/// Outcome for a force F at frequency w. One contact lifts when hypot(d w² theta, 2hF/(m s))
/// exceeds g (4.31 with inertia forces); half a radian of amplitude counts as lifting.
DesignPoint designPoint(const DesignCase& c, double w, double F);

}  // namespace assembly_cell
