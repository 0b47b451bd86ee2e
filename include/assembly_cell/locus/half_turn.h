// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <complex>
#include <optional>

#include "assembly_cell/locus/contact_model.h"

namespace assembly_cell {

// The motion in the plane is the same for a contact C and for C*, half a turn further on the edge
// (docs/theory/thesis.md, "Locus"). Quantities that are odd under the half turn distinguish
// them: vertical motion, yaw, or the shift of the contact when the peg is tilted a little.

/// A phasor Re(U e^{ia}) of the exciter's angle a as measured.
struct MeasuredPhasor {
  std::complex<double> value;
  double variance = 0.0;  ///< of the real and of the imaginary part each
};

struct HalfTurnEvidence {
  std::optional<MeasuredPhasor> vertical;  ///< of the centre of mass [m]: an acceleration over −ω²
  std::optional<MeasuredPhasor> yaw;       ///< of the peg [rad]: a rate over iω
};

/// Vertical motion and yaw from a fit of the coupling's six displacements, as centreOfMassLocus
/// without tilts. frequency: rate of the exciter's angle, negative for a clockwise one [rad/s].
HalfTurnEvidence halfTurnEvidence(const Mechanism& mechanism, double frequency,
                                  const HarmonicFit& fit);

/// Multiplies the odds of both directions by those of the evidence and puts the likelier first.
/// The model error is a twentieth of the predicted motion, or the estimate's misfit where larger.
/// axes: how the evidence was measured. Throws InputError as contactDirection.
DirectionEstimate resolveHalfTurn(const Mechanism& mechanism, const OperatingPoint& point,
                                  const HalfTurnEvidence& evidence, DirectionEstimate estimate,
                                  LocusAxes axes = LocusAxes::kHole);

}  // namespace assembly_cell
