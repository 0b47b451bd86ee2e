// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Chatter (Zeno behaviour): events so dense that they are not worth locating, as of a peg that lies
// flat and rocks. For a while the run goes on in short steps: with regularised or held contacts the
// integrator's, modes decided after each; with rigid contacts steps of a time-stepping scheme.
#pragma once

#include "context.h"

namespace assembly_cell {

/// Shortest step amid chatter, however far its error: modes change from one to the next. Of the
/// rigid law half and twice take 14 % more and 21 % less.
constexpr double kMinChatterStep = 5e-7;  // [s]

/// Notes an event at time t; chatter begins where the last ones are that dense.
void noteEvent(const System& s, const Evaluation& e, double t, Context& c);
void beginChatter(double t, Context& c);

/// The peg's tilt is too small to tell its lowest point.
bool isFlat(const Evaluation& e);

/// Length of a step amid chatter; h: the integrator's own.
double chatterStep(const System& s, const Evaluation& e, double h);

/// Rigid law, to time t: an impact that lets no point be closer than zero at the end, again and
/// again (a flat peg that is stopped on one side comes down on the other), then free flight. Of
/// first order at contacts; a peg at rest hops by nanometres. Never gives energy.
void takeChatterStep(const System& s, double t, Context& c, Evaluation& e);

}  // namespace assembly_cell
