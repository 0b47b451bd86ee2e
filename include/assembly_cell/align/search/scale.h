// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// A light touch of the default cell: a force of this size in any direction is contact [N]
inline constexpr double kTouchForce = 1.5;

/// Lengths, forces and times of a search for a mechanism, over those of the default cell (25 mm,
/// 0.395 kg, 5e4 N/m, 50 N·m/rad), where all factors are 1. Constants of strategies are those of
/// the default cell; a factor carries them over.
struct Scale {
  double length = 1.0;  ///< the peg's radius
  double travel = 1.0;  ///< the same, 1 at least: free travel over the plane, which costs nothing
  /// A light touch: a moving peg swings against the sensor by a part of its weight, which must not
  /// be a touch. Between a fifth of the default's 1.5 N and 4 N, a tenth of the force limit.
  double force = 1.0;
  double sink = 1.0;  ///< travel down that a light touch on the edge takes
  double give = 1.0;  ///< travel sideways that a light touch on the bottom takes
  double step = 1.0;  ///< travel in a block that neither swings the peg nor presses it, 1 at most
  /// Change of force from block to block at rest: less than a part of a light touch, and than moves
  /// the peg by a quarter of the clearance.
  double still = 1.0;
  double time = 1.0;  ///< decay of the slowest swing of the peg in its coupling, 1 to 20

  /// Blocks that correspond to `blocks` of the default cell, where the peg swings for longer.
  int timed(int blocks) const;
};

/// Of a light touch, at most: a tenth of the force limit. [N]
inline constexpr double kMaxTouchForce = 4.0;
/// Half of the repeatability of a machine of mismatch level 2: a stiff coupling pushes by as much
/// without a contact. [m]
inline constexpr double kLanding = 1.5e-5;

/// Throws InputError for a coupling without stiffness in some direction.
Scale scaleOf(const Mechanism& mechanism);

/// Travel of the carrier down for a force on one point of the edge. [m/N]
double pressCompliance(const Mechanism& mechanism);

/// Travel of the bottom's centre for a force across the peg there, the carrier held. [m/N]
double sidewaysCompliance(const Mechanism& mechanism);

}  // namespace assembly_cell
