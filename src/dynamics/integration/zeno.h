// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Zeno behaviour: accumulation of events, for example of a flat peg that rocks. During a Zeno phase
// no event is located. The run continues in short steps: with regularised or viscous contacts those
// of the integrator, with a mode decision after each; with rigid contacts those of a time-stepping
// scheme (Moreau).
#pragma once

#include "context.h"

namespace assembly_cell {

/// Minimum step in a Zeno phase, independent of its error. With the rigid law, half and twice of it
/// take 14 % more and 21 % less effort.
constexpr double kMinZenoStep = 5e-7;  // [s]

/// Records an event at time t [s]; begins a Zeno phase if the last ones are too dense.
void recordEvent(const System& s, const Evaluation& e, double t, Context& c);
void beginZenoPhase(double t, Context& c);

/// The peg's tilt is below 1e-3 rad: its lowest point moves around the edge at the least rocking.
bool isFlat(const Evaluation& e);

/// Length of a step in a Zeno phase [s]; h: step size of the integrator.
double zenoStep(const System& s, const Evaluation& e, double h);

/// Time-stepping scheme of the rigid law, to time t [s]: plastic impacts, repeated until no gap is
/// negative at the step's end, then free motion. First order at contacts; a peg at rest moves by
/// nanometres between impacts. The energy never increases.
void takeTimeSteppingStep(const System& s, double t, Context& c, Evaluation& e);

}  // namespace assembly_cell
