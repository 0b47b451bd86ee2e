// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/bridge/conversions.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/guard/message_check.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kQuaternionTolerance = 1e-3;  // of the norm: larger is a mistake, not rounding

geometry_msgs::Quaternion toQuaternion(const Eigen::Matrix3d& R) {
  Eigen::Quaterniond q(R);
  q.normalize();
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  geometry_msgs::Quaternion out;
  out.x = q.x();
  out.y = q.y();
  out.z = q.z();
  out.w = q.w();
  return out;
}

}  // namespace

geometry_msgs::Point toPoint(const Eigen::Vector3d& p) {
  geometry_msgs::Point out;
  out.x = p.x();
  out.y = p.y();
  out.z = p.z();
  return out;
}

geometry_msgs::Vector3 toVector3(const Eigen::Vector3d& v) {
  geometry_msgs::Vector3 out;
  out.x = v.x();
  out.y = v.y();
  out.z = v.z();
  return out;
}

geometry_msgs::Pose toPose(const Pose& X) {
  geometry_msgs::Pose out;
  out.position = toPoint(X.p);
  out.orientation = toQuaternion(X.R);
  return out;
}

geometry_msgs::PoseStamped poseStamped(const std::string& frame, const Pose& X,
                                       const ros::Time& stamp) {
  geometry_msgs::PoseStamped out;
  out.header.stamp = stamp;
  out.header.frame_id = frame;
  out.pose = toPose(X);
  return out;
}

geometry_msgs::TransformStamped transformStamped(const std::string& parent,
                                                 const std::string& child, const Pose& X,
                                                 const ros::Time& stamp) {
  geometry_msgs::TransformStamped out;
  out.header.stamp = stamp;
  out.header.frame_id = parent;
  out.child_frame_id = child;
  out.transform.translation = toVector3(X.p);
  out.transform.rotation = toQuaternion(X.R);
  return out;
}

Pose fromPose(const geometry_msgs::Pose& pose, const std::string& source) {
  const Eigen::Vector3d p(pose.position.x, pose.position.y, pose.position.z);
  const Eigen::Quaterniond q(pose.orientation.w, pose.orientation.x, pose.orientation.y,
                             pose.orientation.z);
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(p(axis)) <= kPositionField.high) continue;
    throw InputError(source + text(": position.%c is %.12g: give metres, at most %g", "xyz"[axis],
                                   p(axis), kPositionField.high));
  }
  if (!q.coeffs().allFinite() || std::abs(q.norm() - 1.0) > kQuaternionTolerance) {
    throw InputError(
        source + text(": orientation has norm %g: give a unit quaternion x, y, z, w", q.norm()));
  }
  return {q.normalized().toRotationMatrix(), p};
}

geometry_msgs::Wrench toWrench(const Vector6& w) {
  geometry_msgs::Wrench out;
  out.force = toVector3(w.head<3>());
  out.torque = toVector3(w.tail<3>());
  return out;
}

Vector6 fromWrench(const geometry_msgs::Wrench& w) {
  Vector6 out;
  out << w.force.x, w.force.y, w.force.z, w.torque.x, w.torque.y, w.torque.z;
  return out;
}

}  // namespace assembly_cell::ros_bridge
