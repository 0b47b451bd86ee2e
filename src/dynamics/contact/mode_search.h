// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Which of the closed contacts carry, stick and slide at one moment, and where slip that begins
// goes: a search, as each mode depends on the forces of all.
#pragma once

#include "context.h"

namespace assembly_cell {

/// Changes modes one by one until none is contradicted, or they go round in a circle: pulled
/// contacts get idle, those beyond their cones slide, idle ones that approach join. first: of a
/// decision, whose limit of accelerations [m/s²] is set by those that count here.
void agree(const System& s, bool first, double& limit, Context& c, Evaluation& e);

/// What the modes contradict most: pulled, beyond a cone, idle but approaching [N].
double contradiction(const System& s, const Context& c, const Evaluation& e);

/// Where they still do, by more than the limit: of all combinations the one that is contradicted
/// least. Of few points off a face.
void tryAll(const System& s, double limit, Context& c, Evaluation& e);

/// Turns slip that begins to where it goes.
void turnSlip(const System& s, double limit, Context& c, Evaluation& e);

}  // namespace assembly_cell
