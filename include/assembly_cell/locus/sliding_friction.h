// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <complex>

#include "assembly_cell/locus/contact_model.h"

namespace assembly_cell {

/// Coulomb coefficient of a peg that slides on a circle under the rotating exciter.
struct SlidingFriction {
  double coefficient = 0.0;
  double sd = 0.0;
  /// Fraction of the force that turns with the exciter which is across the slip instead of against
  /// it: 0 where Coulomb's law holds, large where the peg does not slide on a circle.
  double across = 0.0;
};

/// μ = −F sin(arg P) / N of a peg that is only shifted, without damping (thesis chapter 9, 9.3).
/// force: the exciter's [N]; press: contact force [N], positive.
SlidingFriction slidingFriction(const Locus& locus, double force, double press);

/// Friction through the whole mechanism, damping, rocking and carrier included: the motion follows
/// from the six displacements of the coupling, the contact force from the motion; μ is its
/// component against the slip of the peg's bottom, over the press. Throws InputError as
/// contactResponse, and for a press of 0.
SlidingFriction slidingFriction(const Mechanism& mechanism, const OperatingPoint& point,
                                const HarmonicFit& fit);

}  // namespace assembly_cell
