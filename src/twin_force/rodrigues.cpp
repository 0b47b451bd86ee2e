// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/twin_force/rodrigues.h"

#include <Eigen/Geometry>
#include <cmath>

#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/scene/input_error.h"

namespace assembly_cell {
namespace {

constexpr double kHalfTurn = 1e-8;  // [rad] from π

}  // namespace

Eigen::Matrix3d rotationFromGibbs(const GibbsVector& g) {
  const Eigen::Matrix3d cross = skew(g.value);
  return Eigen::Matrix3d::Identity() +
         2.0 / (1.0 + g.value.squaredNorm()) * (cross + cross * cross);
}

Eigen::Matrix3d rotationFromRodrigues(const RodriguesVector& lambda) {
  const Eigen::Matrix3d cross = skew(lambda.value);
  return Eigen::Matrix3d::Identity() +
         (cross + 0.5 * cross * cross) / (1.0 + 0.25 * lambda.value.squaredNorm());
}

GibbsVector gibbsFromRotation(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  // |w| = cos θ/2, half the distance of θ from π
  if (!(std::abs(q.w()) > 0.5 * kHalfTurn)) {
    throw InputError(
        "rotation: value of half a turn: Gibbs and Rodrigues vectors are infinite there, "
        "use a quaternion");
  }
  return {q.vec() / q.w()};
}

RodriguesVector rodriguesFromRotation(const Eigen::Matrix3d& R) {
  return {2.0 * gibbsFromRotation(R).value};
}

}  // namespace assembly_cell
