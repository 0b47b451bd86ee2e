// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/twin_force/line_of_action.h"

#include <Eigen/Geometry>

namespace assembly_cell {

std::optional<LineOfAction> lineOfAction(const Vector6& wrench) {
  const Eigen::Vector3d F = wrench.head<3>(), M = wrench.tail<3>();
  const double force = F.stableNorm();
  if (!(force > 0.0) || !wrench.allFinite()) return std::nullopt;
  LineOfAction line;
  line.direction = F / force;
  line.force = force;
  line.couple = line.direction.dot(M);
  line.point = line.direction.cross(M / force);
  return line;
}

}  // namespace assembly_cell
