// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/Point.h>
#include <geometry_msgs/Pose.h>
#include <geometry_msgs/Transform.h>
#include <geometry_msgs/Vector3.h>
#include <geometry_msgs/Wrench.h>

#include <string>

#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/scene/scenario.h"

namespace assembly_cell::ros_bridge {

geometry_msgs::Point toPoint(const Eigen::Vector3d& p);
geometry_msgs::Vector3 toVector3(const Eigen::Vector3d& v);

/// Quaternions on the wire are unit, with w ≥ 0.
geometry_msgs::Pose toPose(const Pose& X);
geometry_msgs::Transform toTransform(const Pose& X);

/// Throws InputError that names `source` and the field: non-finite, or a quaternion whose norm is
/// off by more than 1e-3 (nearer ones are normalised).
Pose fromPose(const geometry_msgs::Pose& pose, const std::string& source);

/// Force before torque, [N], [N·m].
geometry_msgs::Wrench toWrench(const Vector6& w);
Vector6 fromWrench(const geometry_msgs::Wrench& w);

/// Rest pose of the mechanism as the pose of the coupling's rest point in `hole`:
/// position (x2e, x3e, x1e), orientation rotationFromEuler(theta3e, theta2e, theta1e).
Pose poseFromRest(const RestPose& rest);
RestPose restFromPose(const Pose& X);

}  // namespace assembly_cell::ros_bridge
