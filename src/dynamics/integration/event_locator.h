// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Event location: times within a step at which a contact opens, closes, sticks or slips.
#pragma once

#include "context.h"
#include "integrator.h"

namespace assembly_cell {

/// Values of the event functions at the evaluation e: gap, normal force and friction of each slot,
/// wedgeMargin() and faceEvent().
Events eventValues(const System& s, const Context& c, const Evaluation& e);

/// Initialises the event functions of the next step from the evaluation of the present state.
void beginStep(const System& s, Context& c, const Evaluation& e);

/// Stores the event functions of the closed slots at the first or second of the stages.
void recordStage(const System& s, const Context& c, const Evaluation& e, int stage,
                 StageEvents& stages);

/// Time within a step at which an event function falls below zero although none is at the step's
/// end (a contact slips and sticks again within the step) [s]; 0 if none is found. at_end: event
/// functions at the step's end; e: evaluation there, unchanged; inside: workspace.
double hiddenEvent(const System& s, const Context& c, const Trial& step, const Events& at_end,
                   Evaluation& e, Evaluation& inside);

/// Shortens a step at whose end event functions are below zero (`at_end`) to end at the first zero.
void locateEvent(const System& s, const Context& c, const Events& at_end, Trial& step,
                 Evaluation& e);

}  // namespace assembly_cell
