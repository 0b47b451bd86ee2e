// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/insertion/two_point.h"

#include <cmath>

#include "assembly_cell/math/validity.h"

namespace assembly_cell {

void check(const PegInHole& fit) {
  requirePositive("peg_radius", fit.peg_radius);
  requirePositive("hole_radius", fit.hole_radius);
  if (!(fit.peg_radius < fit.hole_radius)) {
    refuse("peg_radius", fit.peg_radius, "give a peg smaller than its hole");
  }
}

TwoPointContact twoPointContact(const PegInHole& fit, double tilt) {
  check(fit);
  const double d = 2 * fit.peg_radius, D = 2 * fit.hole_radius;
  const double s = std::sin(tilt), c = std::cos(tilt);
  if (!(tilt > 0.0 && tilt < M_PI / 2 && D * c >= d)) {
    refuse("tilt", tilt, "give one above 0, at most acos(peg_radius/hole_radius)");
  }
  // D - d cos = (D - d) + 2 d sin^2(tilt/2), without cancellation
  const double half = std::sin(0.5 * tilt);
  TwoPointContact contact;
  contact.tilt = tilt;
  contact.depth = finiteResult("depth", (D - d + 2 * d * half * half) / s);
  contact.lowest = contact.depth * c;
  contact.wall_contact = contact.lowest - d * s;
  return contact;
}

std::optional<double> twoPointTilt(const PegInHole& fit, double depth) {
  check(fit);
  requirePositive("depth", depth);
  // with u = tan(tilt/2): (D + d) u^2 - 2 l u + (D - d) = 0, its smaller root without cancellation
  const double sum = 2 * (fit.hole_radius + fit.peg_radius);
  const double difference = 2 * (fit.hole_radius - fit.peg_radius);
  const double square =
      (depth - std::sqrt(sum * difference)) * (depth + std::sqrt(sum * difference));
  if (square < 0.0) return std::nullopt;
  return 2 * std::atan(difference / (depth + std::sqrt(square)));
}

double wedgingDepth(const PegInHole& fit, double friction) {
  check(fit);
  requirePositive("friction", friction);
  return finiteResult("depth", 2 * friction * fit.peg_radius);
}

std::optional<double> wedgingTilt(const PegInHole& fit, double friction) {
  return twoPointTilt(fit, wedgingDepth(fit, friction));
}

}  // namespace assembly_cell
