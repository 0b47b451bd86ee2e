// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Events: times within a step at which a contact opens or closes, sticks or slips.
#pragma once

#include "context.h"
#include "integrator.h"

namespace assembly_cell {

/// Event functions of the evaluation e: gap, normal force and friction of each slot; how far
/// sliding contacts are from a wedge.
Events eventValues(const System& s, const Context& c, const Evaluation& e);

/// Sets what the events of the next step are told by, from the evaluation of the present state.
void beginStep(const System& s, Context& c, const Evaluation& e);

/// Exciter or friction turn so far within the step that an event may hide in it.
bool isBlind(const System& s, const Context& c, const Trial& step);
/// Least event function of the closed slots, of forces within a step; below zero where that doesn't
/// tell.
double leastInside(const System& s, const Context& c, const Evaluation& e);

/// A mode is broken inside a step that ends with none broken: sticking contacts are shaken loose
/// and caught within part of a turn of the exciter. e: of the step's end, kept; inside: workspace.
bool hiddenEvent(const System& s, const Context& c, const Trial& step, Evaluation& e,
                 Evaluation& inside);

/// Shortens a step that ends with events broken (`at_end`) to end at the first of them.
void locateEvent(const System& s, const Context& c, const Events& at_end, Trial& step,
                 Evaluation& e);

}  // namespace assembly_cell
