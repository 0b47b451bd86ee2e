// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "face_edge.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

// Maximum tilt of a peg with a face contact, kFlatTilt of zeno.cpp.
constexpr double kNearlyLevel = 1e-3;  // [rad]
// Lateral distance from the hole at which a face is beside it: more than twice the reach of
// contacts. No result changes at half.
constexpr double kOffTheHole = 5e-5;  // [m]
// Maximum cosine of half the arc and of the crossing angle: above it edge and rim are nearly
// tangent.
constexpr double kCrosses = 0.99;

double rimOf(const System& s) { return s.shapes.hole_radius + s.shapes.chamfer.width; }
double offAxis(const EdgeCircle& edge) { return std::hypot(edge.center(1), edge.center(2)); }

// Lateral distance of the edge from the hole [m]; infinite on the floor.
double groundLeft(const System& s, const EdgeCircle& edge) {
  return groundUnder(s, edge) < 0.0 ? HUGE_VAL
                                    : offAxis(edge) - edge.radius - rimOf(s) - kOffTheHole;
}

// Cosine of half the arc between the crossings of edge and rim; beyond ±1 there are none.
double crossing(const System& s, const EdgeCircle& edge) {
  const double rim = rimOf(s), off = offAxis(edge), r = edge.radius;
  return (rim * rim - off * off - r * r) / (2.0 * off * r);
}

// Lateral distance of the edge from a position in which a face can't rest over the hole: nearly
// tangent crossings, or ground that is not wider than the reach of contacts [m].
double overHoleBy(const System& s, const EdgeCircle& edge) {
  const double r = edge.radius;
  return std::min(r * (kCrosses - std::abs(crossing(s, edge))),
                  offAxis(edge) + r - rimOf(s) - kOffTheHole);
}

}  // namespace

Round heights(const Context& c, const EdgeCircle& edge) {
  return {edge.center(0) - c.face.height, edge.radius * edge.axis0(0), edge.radius * edge.axis1(0)};
}

Round speeds(const Evaluation& e) {
  const EdgeCircle& edge = e.edge;
  const Vec3 middle = e.k.v + e.k.omega.cross(Vec3(edge.center - e.k.x));
  return {middle(0), edge.radius * e.k.omega.cross(edge.axis0)(0),
          edge.radius * e.k.omega.cross(edge.axis1)(0)};
}

double groundUnder(const System& s, const EdgeCircle& edge) {
  const double depth = s.shapes.hole_depth;
  return edge.center(0) < -0.5 * depth ? -depth : 0.0;
}

Arc groundOf(const System& s, const EdgeCircle& edge, bool over_hole) {
  if (!over_hole) return {};
  const double away = std::atan2(edge.center(2), edge.center(1));
  const double y = std::sin(away), x = std::cos(away);
  return {std::atan2(x * edge.axis1(1) + y * edge.axis1(2), x * edge.axis0(1) + y * edge.axis0(2)),
          std::acos(std::clamp(crossing(s, edge), -1.0, 1.0))};
}

double sameGround(const System& s, const Face& face, const EdgeCircle& edge) {
  return face.overHole() ? overHoleBy(s, edge) : groundLeft(s, edge);
}

bool nearlyLevel(const EdgeCircle& edge) {
  const double tilt2 = edge.axis0(0) * edge.axis0(0) + edge.axis1(0) * edge.axis1(0);
  return tilt2 < kNearlyLevel * kNearlyLevel;
}

bool reachesOver(const System& s, const EdgeCircle& edge) {
  return s.discrete_friction && !(s.excluded & kFaceSlots) && groundUnder(s, edge) == 0.0 &&
         overHoleBy(s, edge) > 0.0 && (s.admitted & kFaceSlots) == kFaceSlots;
}

bool canRestOnFace(const System& s, const EdgeCircle& edge) {
  return hasGround(s, edge) || (nearlyLevel(edge) && reachesOver(s, edge));
}

bool hasGround(const System& s, const EdgeCircle& edge) {
  return !(s.excluded & kFacePlaneSlot) && nearlyLevel(edge) && groundLeft(s, edge) > 0.0;
}

}  // namespace assembly_cell
