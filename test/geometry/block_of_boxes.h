// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "assembly_cell/description/part_pairs.h"
#include "contact_reference.h"

namespace assembly_cell {

// The block as rings of boxes whose inner faces are tangent to a circle round the hole's axis:
// polygons of so many sides, at their corners 1 µm outside the circle.
constexpr int kBlockSides = 360;
constexpr double kBlockRadius = 0.1, kBlockDepth = 0.04;  // [m]

// one box of a ring from the height `top` down to the block's lower face
inline PartShape boxOfRing(int i, double inner, double top) {
  PartShape box;
  box.size = Eigen::Vector3d(kBlockRadius - inner, 2 * kBlockRadius * std::tan(kPi / kBlockSides),
                             top + kBlockDepth);
  box.X_PS.R =
      Eigen::AngleAxisd(2 * kPi * i / kBlockSides, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  box.X_PS.p =
      box.X_PS.R * Eigen::Vector3d(0.5 * (kBlockRadius + inner), 0, 0.5 * (top - kBlockDepth));
  return box;
}

// FCL: a peg of this length on its bottom edge and the block
inline bool meet(const std::vector<PartShape>& block, const EdgeCircle& e, double length) {
  const Eigen::Vector3d axis = e.axis0.cross(e.axis1);
  PartShape peg;
  peg.kind = PartShape::Kind::kCylinder;
  peg.size = Eigen::Vector3d(2 * e.radius, 2 * e.radius, length);
  peg.X_PS.R << fromThesisAxes(e.axis0), fromThesisAxes(e.axis1), fromThesisAxes(axis);
  peg.X_PS.p = fromThesisAxes(e.center + 0.5 * length * axis);
  const auto meets = [&](const PartShape& box) { return shapesMeet(peg, box); };
  return std::any_of(block.begin(), block.end(), meets);
}

}  // namespace assembly_cell
