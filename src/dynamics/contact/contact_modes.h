// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Contact modes: which contacts are closed, and which of them slip, stick or carry no force. After
// each function the context has v' of its modes and is ready for a step.
#pragma once

#include "context.h"

namespace assembly_cell {

/// Sets a slot's mode and moves its point between the sets of closed and open slots.
void setMode(std::size_t i, Mode mode, Context& c, Evaluation& e);

/// Closes the slots within reach at the present state, independent of their modes before, then
/// decide(). `initial`: at the start of a run, where the reach is kInitialReach.
void findModes(const System& s, bool initial, Context& c, Evaluation& e);

/// findModes() within a run after an inaccurate step: energy above `limit` [J] is removed.
void findModesWithin(const System& s, double limit, Context& c, Evaluation& e);

/// At an event: updates the slots that have closed or opened, then decide().
void changeModes(const System& s, Context& c, Evaluation& e);

/// Finds consistent modes of the closed slots: no normal force pulls, friction of sticking contacts
/// stays within its cone, slip is opposite to friction, idle contacts don't approach.
void decide(const System& s, Context& c, Evaluation& e);

/// After a step without event: opens idle contacts out of reach, arms fast slip, reduces depths.
void updateSlots(const System& s, Context& c, Evaluation& e);

/// Sets Slot::depth of a contact that closes deeper than its motion explains. `handed`: gap of the
/// contact that it takes over from [m].
void keepDepth(std::size_t i, double handed, Context& c, Evaluation& e);

/// Event function of beginning slip, whose friction has a fixed direction [m/s]. Below zero: the
/// slip is faster than the threshold and not opposite to friction; under the rigid law, which keeps
/// the speed of sticking points at zero, only if it has the direction of friction.
double slipAhead(const System& s, const Slot& slot, std::size_t i, const Evaluation& e);

}  // namespace assembly_cell
