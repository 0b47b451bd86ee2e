// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// Force in any direction that counts as a contact in the default cell [N]
inline constexpr double kTouchForce = 1.5;

/// Ratios of a mechanism's lengths, forces and times to those of the default cell (radius 25 mm,
/// 0.395 kg, 5e4 N/m, 50 N·m/rad). Constants of strategies are those of the default cell; they are
/// multiplied by one of these factors.
struct Scale {
  double length = 1.0;  ///< the peg's radius
  double travel = 1.0;  ///< the peg's radius, 1 at least: free travel above the plane
  /// Force of a touch, above what the peg's weight causes when it swings. It is between a fifth of
  /// the default cell's 1.5 N and 4 N, a tenth of the force limit.
  double force = 1.0;
  double sink = 1.0;  ///< travel down for the force of a touch on the edge
  double give = 1.0;  ///< travel sideways for the force of a touch on the bottom
  double step = 1.0;  ///< travel in a block that doesn't make the peg swing or press, 1 at most
  /// Change of force from block to block of a peg at rest. It is less than a part of a touch, and
  /// less than moves the peg by a quarter of the clearance.
  double still = 1.0;
  double time = 1.0;  ///< decay of the slowest swing of the peg in its coupling, 1 to 20

  /// Number of blocks that corresponds to `blocks` of the default cell: times `time`.
  int timed(int blocks) const;
};

/// Greatest force of a touch in any cell: a tenth of the force limit. [N]
inline constexpr double kMaxTouchForce = 4.0;
/// Half of the repeatability of a machine of mismatch level 2. A stiff coupling that is displaced
/// by as much must not show a contact. [m]
inline constexpr double kLanding = 1.5e-5;

/// The factors of a mechanism. Throws InputError for a coupling without stiffness in some
/// direction.
Scale scaleOf(const Mechanism& mechanism);

/// Compliance at one point of the edge: travel of the carrier down over the force. [m/N]
double pressCompliance(const Mechanism& mechanism);

/// Lateral compliance at the bottom's centre, the carrier at rest. [m/N]
double sidewaysCompliance(const Mechanism& mechanism);

}  // namespace assembly_cell
