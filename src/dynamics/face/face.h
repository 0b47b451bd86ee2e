// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The peg's bottom face lies on the plane or on the hole's floor, or so nearly that nobody can
// tell: it is carried at three points of its edge. They are material points of the peg on the plane
// with the contact law in force, in the slots that else hold the lowest point and the crossings of
// edge and rim. Any three points off one line ask for the same motion of a flat face, so they may
// be chosen anew: around the centre of pressure while it lies inside the face; one of them where
// the peg is about to tip. Under the rigid law a peg that rocks comes down flat and strikes with
// its fastest point: every such impact is carried out, until the face lies.
#pragma once

#include "context.h"
#include "integration/evaluation.h"

namespace assembly_cell {

/// Below zero: a peg on its edge has come down flat, or a lying face leaves, loses the ground under
/// its edge, or reaches deeper beside its points [m]. e: at Level::kEvents.
double faceEvent(const System& s, const Context& c, const Evaluation& e);

/// At the start of a step: which point of the edge tells that the face comes down.
void beginFaceStep(Context& c, const Evaluation& e);

/// A face that is carried and has left, or reaches deeper beside its points, at an event. True
/// where points have been closed that approach.
bool updateFace(const System& s, Context& c, Evaluation& e);

/// The peg is on its edge and flat: from now on its face is carried. True where it is.
bool beginFace(const System& s, Context& c, Evaluation& e);

/// The face is carried no more: its slots are open and without a point.
void dropFace(Context& c, Evaluation& e);

/// Rigid law: impact of the closed points, the face's fastest points among them.
void faceImpact(const System& s, Context& c, Evaluation& e);

}  // namespace assembly_cell
