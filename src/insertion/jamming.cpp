// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/insertion/jamming.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "assembly_cell/math/validity.h"

namespace assembly_cell {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Wrench (f_x, f_z, moment / r) of a force at a point relative to the centre of the base.
Vector3d wrenchOf(const Vector2d& point, const Vector2d& force, double radius) {
  const double moment = point.x() * force.y() - point.y() * force.x();
  return Vector3d(force.x(), force.y(), moment / radius).normalized();
}

// Edges of both friction cones as wrenches.
std::array<Vector3d, 4> contactWrenches(const PegInHole& fit, const TwoPointContact& contact,
                                        double friction) {
  const double r = fit.peg_radius;
  const Vector2d side(std::sin(contact.tilt), std::cos(contact.tilt));  // up along the peg
  const Vector2d base(side.y(), -side.x());  // to the right along its base
  const Vector2d at_wall = -r * base, at_mouth = r * base + contact.depth * side;
  const Vector2d right(1.0, 0.0), up(0.0, 1.0);
  return {wrenchOf(at_wall, right + friction * up, r), wrenchOf(at_wall, right - friction * up, r),
          wrenchOf(at_mouth, -base + friction * side, r),
          wrenchOf(at_mouth, -base - friction * side, r)};
}

}  // namespace

JammingDiagram jammingDiagram(double peg_radius, double depth, double friction) {
  requirePositive({{"peg_radius", peg_radius}, {"depth", depth}, {"friction", friction}});
  return {friction, peg_radius, finiteResult("lambda", depth / (2 * peg_radius * friction))};
}

JammingPoint jammingPoint(const JammingDiagram& diagram, const TipLoad& load) {
  requireFinite({{"F_x", load.F_x}, {"M", load.M}});
  requirePositive("F_z", load.F_z);
  JammingPoint point;
  point.lateral = finiteResult("lateral", load.F_x / load.F_z);
  point.moment = finiteResult("moment", load.M / (diagram.radius * load.F_z));
  const double slope = (1 + diagram.lambda) * diagram.friction;
  const double to_one_point = 1 / diagram.friction - std::abs(point.lateral);
  const double to_two_point = diagram.lambda - std::abs(point.moment + slope * point.lateral);
  point.margin =
      finiteResult("margin", std::min(to_one_point, to_two_point / std::hypot(1.0, slope)));
  return point;
}

std::array<std::array<double, 2>, 4> corners(const JammingDiagram& diagram) {
  const double x = 1 / diagram.friction, y = 2 * diagram.lambda + 1;
  return {{{x, -1.0}, {-x, y}, {-x, 1.0}, {x, -y}}};
}

double restMargin(const PegInHole& fit, double tilt, double friction, const TipLoad& load) {
  const TwoPointContact contact = twoPointContact(fit, tilt);
  if (contact.depth <= wedgingDepth(fit, friction)) {
    refuse("friction", friction, "give less than depth / (2 peg_radius): this peg can be wedged");
  }
  requireFinite({{"F_x", load.F_x}, {"F_z", load.F_z}, {"M", load.M}});
  // wrench of the contacts that balances the load
  const Vector3d needed(-load.F_x, load.F_z, -load.M / fit.peg_radius);
  const double size = needed.norm();
  if (!(size > 0.0) || !std::isfinite(size)) {
    refuse("F_z", load.F_z, "give a load of some size");
  }
  const std::array<Vector3d, 4> edges = contactWrenches(fit, contact, friction);
  double margin = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < edges.size(); ++i) {
    for (std::size_t j = 0; j < edges.size(); ++j) {
      if (i == j) continue;
      const Vector3d inwards = edges[i].cross(edges[j]).normalized();
      // all edges are on one side of a face of the cone
      const bool face = std::all_of(edges.begin(), edges.end(), [&](const Vector3d& edge) {
        return inwards.dot(edge) >= -1e-12;  // rounding of unit vectors
      });
      if (face) margin = std::min(margin, inwards.dot(needed) / size);
    }
  }
  return margin;
}

}  // namespace assembly_cell
