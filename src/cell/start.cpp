// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/start.h"

#include <cmath>

namespace assembly_cell {

Scenario startAt(const Scenario& scenario, const Eigen::Vector2d& offset,
                 const Eigen::Vector2d& tilt, double height) {
  Scenario s = scenario;
  const Eigen::Matrix3d R = rotationFromVector({Eigen::Vector3d(tilt.x(), tilt.y(), 0.0)});
  const double low = tipRadius(s.mechanism.peg) * std::hypot(R(2, 0), R(2, 1));
  const Eigen::Vector3d bottom(offset.x(), offset.y(), height + low);
  const Eigen::Vector3d coupling =
      bottom + (s.mechanism.peg.half_height + s.mechanism.peg.coupling_height) * R.col(2);
  const EulerAngles angles = eulerFromRotation(R);
  s.rest = {coupling.x(), coupling.y(), coupling.z(), angles.psi, angles.theta, angles.phi};
  InitialState& start = s.initial;
  start = InitialState{};
  start.position = bottom + s.mechanism.peg.half_height * R.col(2);
  start.euler = angles;
  start.carrier_x = s.rest.x;
  start.carrier_y = s.rest.y;
  start.carrier_yaw = s.rest.yaw;
  return s;
}

Pose carrierBase(const Scenario& scenario) {
  RestPose base = scenario.rest;
  base.yaw = 0.0;
  return poseFromRest(base);
}

}  // namespace assembly_cell
