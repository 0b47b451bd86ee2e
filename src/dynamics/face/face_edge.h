// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The edge of the peg's face over its ground: quantities that go round it, and what of it has
// ground under it.
#pragma once

#include <algorithm>
#include <cmath>

#include "context.h"
#include "integration/evaluation.h"

namespace assembly_cell {

/// What of the face's edge has ground under it: all, or the arc about a place, away from the hole.
struct Arc {
  double about = 0.0, half = M_PI;
  bool whole() const { return !(half < M_PI); }
  double from() const { return about - half; }
  double to() const { return about + half; }
  bool has(double t) const { return std::abs(std::remainder(t - about, 2.0 * M_PI)) <= half; }
};

/// A quantity of the face's edge: its value at the place t is middle + cosine cos t + sine sin t.
struct Round {
  double middle, cosine, sine;
  double at(double t) const { return middle + cosine * std::cos(t) + sine * std::sin(t); }
  double swing() const { return std::hypot(cosine, sine); }
  double least() const { return middle - swing(); }
  double leastAt() const { return std::atan2(-sine, -cosine); }
  double leastAt(const Arc& arc) const {
    const double t = leastAt();
    if (arc.has(t)) return t;
    return at(arc.from()) < at(arc.to()) ? arc.from() : arc.to();
  }
  double least(const Arc& arc) const { return arc.whole() ? least() : at(leastAt(arc)); }
  double most(const Arc& arc) const {
    if (arc.has(leastAt() + M_PI)) return middle + swing();
    return std::max(at(arc.from()), at(arc.to()));
  }
};

/// Its points are springs, which stay where they are.
inline bool hasSprings(const System& s) {
  return s.scenario.contact.law == ContactLaw::kSpringDashpot;
}

/// Height over the ground [m].
Round heights(const Context& c, const EdgeCircle& edge);
/// Speed upwards of the material points [m/s].
Round speeds(const Evaluation& e);

/// Height of what is under the edge: the plane's or the floor's [m].
double groundUnder(const System& s, const EdgeCircle& edge);
/// What of the edge has ground under it, of a face that reaches over the hole or doesn't.
Arc groundOf(const System& s, const EdgeCircle& edge, bool over_hole);
/// How far the edge is from where the ground under it becomes another [m].
double sameGround(const System& s, const Face& face, const EdgeCircle& edge);

bool nearlyLevel(const EdgeCircle& edge);
/// All of the peg's edge is over plane or floor, nearly level, under a law whose contacts may be
/// carried at points of a face.
bool hasGround(const System& s, const EdgeCircle& edge);
/// The face reaches over the hole and may be carried beside it, level.
bool reachesOver(const System& s, const EdgeCircle& edge);
/// One or the other: a peg that comes down flat lies there.
bool mayLie(const System& s, const EdgeCircle& edge);

}  // namespace assembly_cell
