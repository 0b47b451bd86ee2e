// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <urdf_model/pose.h>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// X_parent_child of an `origin` element.
inline Pose poseOf(const urdf::Pose& pose) {
  Pose X;
  double x = 0.0, y = 0.0, z = 0.0, w = 1.0;
  pose.rotation.getQuaternion(x, y, z, w);
  X.R = Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix();
  X.p = {pose.position.x, pose.position.y, pose.position.z};
  return X;
}

}  // namespace assembly_cell
