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

/// Notes the event functions of the closed slots at the first or second of these stages.
void noteStage(const System& s, const Context& c, const Evaluation& e, int stage,
               StageEvents& stages);

/// When a mode is broken inside a step that ends with none broken: sticking contacts are shaken
/// loose and caught again within it. 0 where none is found. at_end: events of the step's end;
/// e: of it, kept; inside: workspace.
double hiddenEvent(const System& s, const Context& c, const Trial& step, const Events& at_end,
                   Evaluation& e, Evaluation& inside);

/// Shortens a step that ends with events broken (`at_end`) to end at the first of them.
void locateEvent(const System& s, const Context& c, const Events& at_end, Trial& step,
                 Evaluation& e);

}  // namespace assembly_cell
