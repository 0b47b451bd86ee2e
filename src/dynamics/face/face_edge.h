// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Edge circle of a nearly level peg over plane or floor: first harmonics around it, and the arc
// that is over ground.
#pragma once

#include <algorithm>
#include <cmath>

#include "context.h"
#include "integration/evaluation.h"

namespace assembly_cell {

/// Arc of the edge over ground: about ± half [rad]; half >= π: the whole circle.
struct Arc {
  double about = 0.0, half = M_PI;
  bool whole() const { return !(half < M_PI); }
  double from() const { return about - half; }
  double to() const { return about + half; }
  bool has(double t) const { return std::abs(std::remainder(t - about, 2.0 * M_PI)) <= half; }
};

/// First harmonic on the edge circle: value at the parameter t is middle + cosine cos t + sine sin
/// t.
struct Round {
  double middle, cosine, sine;
  double at(double t) const { return middle + cosine * std::cos(t) + sine * std::sin(t); }
  double swing() const { return std::hypot(cosine, sine); }
  double min() const { return middle - swing(); }
  double minAt() const { return std::atan2(-sine, -cosine); }
  double minAt(const Arc& arc) const {
    const double t = minAt();
    if (arc.has(t)) return t;
    return at(arc.from()) < at(arc.to()) ? arc.from() : arc.to();
  }
  double min(const Arc& arc) const { return arc.whole() ? min() : at(minAt(arc)); }
  double max(const Arc& arc) const {
    if (arc.has(minAt() + M_PI)) return middle + swing();
    return std::max(at(arc.from()), at(arc.to()));
  }
};

/// Spring-dashpot law: points of a face are not moved.
inline bool hasSprings(const System& s) {
  return s.scenario.contact.law == ContactLaw::kSpringDashpot;
}

/// Height of the edge over the ground [m].
Round heights(const Context& c, const EdgeCircle& edge);
/// Upward speed of the material points of the edge [m/s].
Round speeds(const Evaluation& e);

/// Height of the plane or floor under the edge [m].
double groundUnder(const System& s, const EdgeCircle& edge);
/// Arc of the edge over ground. over_hole: the face covers part of the hole.
Arc groundOf(const System& s, const EdgeCircle& edge, bool over_hole);
/// Lateral distance of the edge from a change of its ground (rim, hole wall) [m].
double sameGround(const System& s, const Face& face, const EdgeCircle& edge);

bool nearlyLevel(const EdgeCircle& edge);
/// The whole edge is over plane or floor and nearly level, and the contact law supports faces.
bool hasGround(const System& s, const EdgeCircle& edge);
/// The face is nearly level, covers part of the hole, and can rest beside it.
bool reachesOver(const System& s, const EdgeCircle& edge);
/// hasGround() or reachesOver().
bool canRestOnFace(const System& s, const EdgeCircle& edge);

}  // namespace assembly_cell
