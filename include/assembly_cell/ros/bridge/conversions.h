// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/Point.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/Vector3.h>
#include <geometry_msgs/Wrench.h>

#include <cstdint>
#include <string>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell::ros_bridge {

/// Frames of tf, see docs/reference/conventions.md. The simulator publishes those of the
/// ground truth with ~publish_truth only.
constexpr char kWorldFrame[] = "world";
constexpr char kHoleFrame[] = "hole";
constexpr char kCarrierBaseFrame[] = "carrier_base";
constexpr char kCarrierFrame[] = "carrier";
constexpr char kPegFrame[] = "peg";
constexpr char kHoleEstimatedFrame[] = "hole_estimated";
constexpr char kHoleTruthFrame[] = "hole_truth";
constexpr char kPegTruthFrame[] = "peg_truth";

/// Length of the queue of a topic that must lose no message.
constexpr std::uint32_t kQueue = 100;
/// Largest rounding of a stamp, as a fraction of a sample's period.
constexpr double kSampleRounding = 0.01;

geometry_msgs::Point toPoint(const Eigen::Vector3d& p);
geometry_msgs::Vector3 toVector3(const Eigen::Vector3d& v);

/// Quaternions in messages have norm 1 and w ≥ 0.
geometry_msgs::Pose toPose(const Pose& X);
geometry_msgs::PoseStamped poseStamped(const std::string& frame, const Pose& X,
                                       const ros::Time& stamp);
geometry_msgs::TransformStamped transformStamped(const std::string& parent,
                                                 const std::string& child, const Pose& X,
                                                 const ros::Time& stamp);

/// Throws InputError that names `source` and the field: non-finite, or a quaternion whose norm is
/// off by more than 1e-3 (nearer ones are normalised).
Pose fromPose(const geometry_msgs::Pose& pose, const std::string& source);

/// Force before torque, [N], [N·m].
geometry_msgs::Wrench toWrench(const Vector6& w);
Vector6 fromWrench(const geometry_msgs::Wrench& w);

}  // namespace assembly_cell::ros_bridge
