// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Which contacts are closed, and which of them slide, stick or carry nothing. Each function leaves
// the context with v' of its modes and ready for a step.
#pragma once

#include "context.h"

namespace assembly_cell {

/// Sets a slot's mode; its point moves to the set that it is searched with.
void setMode(std::size_t i, Mode mode, Context& c, Evaluation& e);

/// Closes the slots that are in reach at the present state, however they were, then decide().
/// `initial`: at the start of a run.
void findModes(const System& s, bool initial, Context& c, Evaluation& e);

/// The same within a run, where a step may have been off: no more energy than `limit` is left [J].
void findModesWithin(const System& s, double limit, Context& c, Evaluation& e);

/// At an event: slots that have closed or left are told so, then decide().
void changeModes(const System& s, Context& c, Evaluation& e);

/// Finds a consistent mode of each closed slot: forces push, friction stays within its cones,
/// sliding contacts slide against their friction, idle ones don't approach.
void decide(const System& s, Context& c, Evaluation& e);

/// After a step without event: idle contacts out of reach open, fast slip is armed, depths heal.
void updateSlots(const System& s, Context& c, Evaluation& e);

/// A contact closes deeper than it can have come: it is kept there. `handed`: gap of the contact
/// that it takes over from.
void keepDepth(std::size_t i, double handed, Context& c, Evaluation& e);

/// Slip that begins has a friction of fixed direction. Below zero: it goes elsewhere than against
/// that, fast enough to tell; under the rigid law, which keeps resting points at zero speed, only
/// when it goes along with it [m/s].
double slipAhead(const System& s, const Slot& slot, std::size_t i, const Evaluation& e);

}  // namespace assembly_cell
