// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/outcome.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/math/roots.h"

namespace assembly_cell {
namespace {

// Depth by which a goal may be missed: errors of the measured plane, the carrier's compliance [m].
constexpr double kShort = 2e-4;
// Depth by which a peg that leans on the wall for some seconds sinks into it [m].
constexpr double kLeans = 2e-5;

}  // namespace

Eigen::Vector2d tiltOf(const Pose& X_HP) {
  const Eigen::Vector3d axis = X_HP.R.col(2);
  const double sine = std::hypot(axis.x(), axis.y());
  if (sine == 0.0) return Eigen::Vector2d::Zero();
  return Eigen::Vector2d(-axis.y(), axis.x()) * (std::atan2(sine, axis.z()) / sine);
}

double reachInBore(double peg_radius, double hole_radius) {
  constexpr double kSunk = 1e-4;  // depth of the wall's deformation in a usual clearance [m]
  return hole_radius + std::max(hole_radius - peg_radius, kSunk);
}

double greatestReach(const Pose& X_HP, double chamfers, double peg_radius, double hole_radius) {
  const Pose X = shoulderPose(X_HP, chamfers);
  const double highest = X.p.z() + peg_radius * X.R.col(2).head<2>().norm();
  return highest <= -kShort ? hole_radius + kLeans : hole_radius;
}

bool inPlace(const Pose& X_HP, double chamfers, double edge_reach, double peg_radius,
             double hole_radius, double depth) {
  if (depth == 0.0) {
    return edge_reach <= greatestReach(X_HP, chamfers, peg_radius, hole_radius);
  }
  const double deepest = peg_radius * X_HP.R.col(2).head<2>().norm() - X_HP.p.z();
  return deepest >= depth - kShort && edge_reach <= reachInBore(peg_radius, hole_radius);
}

double edgeReach(const Pose& X_HP, double peg_radius, const Eigen::Vector2d& bore_lean) {
  const auto reach = [&](double a) {
    const Eigen::Vector3d p =
        X_HP.R * Eigen::Vector3d(peg_radius * std::cos(a), peg_radius * std::sin(a), 0.0) + X_HP.p;
    return (p.head<2>() - p.z() * bore_lean).norm();
  };
  // the distance has at most two maxima round the edge: best of a grid, then golden section
  constexpr int kGrid = 360;
  constexpr double kStep = 2.0 * M_PI / kGrid;
  int best = 0;
  for (int i = 1; i < kGrid; ++i) {
    if (reach(i * kStep) > reach(best * kStep)) best = i;
  }
  const double at =
      leastIn((best - 1) * kStep, (best + 1) * kStep, [&](double a) { return -reach(a); }, 0.0, 40);
  return std::max(reach(best * kStep), reach(at));
}

}  // namespace assembly_cell
