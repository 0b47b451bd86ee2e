// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Face contact of the peg's bottom on the plane or on the hole's floor, to within the resolution of
// a gap. It is represented by three points of the edge: material points of the peg on the plane
// under the scenario's contact law, in the slots of the lowest point and of the crossings of edge
// and rim. Any three points that are not collinear prescribe the same motion of a flat face, so
// they can be moved: around the centre of pressure while it is inside the face; one of them to the
// tipping point. Under the rigid law each impact of a rocking peg is computed, at its fastest
// point, until the face rests.
#pragma once

#include "context.h"
#include "integration/evaluation.h"

namespace assembly_cell {

/// Event function of the face [m]. Below zero: a peg on its edge has become flat, or a face contact
/// opens, loses the ground under its edge, or penetrates deeper beside its points. e: at
/// Level::kEvents.
double faceEvent(const System& s, const Context& c, const Evaluation& e);

/// At the start of a step: sets Face::across, whose height is the event function of a flat peg.
void beginFaceStep(Context& c, const Evaluation& e);

/// Updates an active face at its event: opened, or penetrating beside its points. True if
/// approaching points have been closed.
bool updateFace(const System& s, Context& c, Evaluation& e);

/// Activates the face contact if the peg is on its edge and flat. Returns whether it did.
bool beginFace(const System& s, Context& c, Evaluation& e);

/// Deactivates the face contact: its slots are open and without a point.
void dropFace(Context& c, Evaluation& e);

/// Rigid law: impact of the closed points, with the points of the face moved to its fastest ones.
void faceImpact(const System& s, Context& c, Evaluation& e);

}  // namespace assembly_cell
