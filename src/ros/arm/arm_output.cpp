// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/arm/arm_output.h"

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TwistStamped.h>

#include "assembly_cell/arm/arm_point.h"
#include "assembly_cell/ros/bridge/conversions.h"

namespace assembly_cell::ros_bridge {

ArmOutput::ArmOutput(ros::NodeHandle nh, const BridgeSettings& settings, const CellPlace& place,
                     const ArmKinematics* kinematics)
    : settings_(settings), place_(place), kinematics_(kinematics) {
  switch (settings.interface) {
    case ArmInterface::kPose:
      pub_ = nh.advertise<geometry_msgs::PoseStamped>("target_frame", kQueue);
      break;
    case ArmInterface::kTwist:
      pub_ = nh.advertise<geometry_msgs::TwistStamped>("twist", kQueue);
      break;
    case ArmInterface::kJoints:
      pub_ = nh.advertise<trajectory_msgs::JointTrajectory>("command", kQueue);
      joints_.joint_names = kinematics->names();
      joints_.points.resize(1);
      break;
  }
}

void ArmOutput::setJoints(const JointVector& q) {
  q_ = q;
  rest_.reset();
}

std::string ArmOutput::send(const CommandMotion& motion, const Vector6& measured,
                            const ros::Time& stamp) {
  switch (settings_.interface) {
    case ArmInterface::kPose:
      publish(poseStamped(settings_.base_frame, place_.flangeOf(motionPose(motion)), stamp));
      break;
    case ArmInterface::kTwist:
      sendTwist(motion, measured, stamp);
      break;
    case ArmInterface::kJoints:
      return sendJoints(motion, stamp);
  }
  return {};
}

template <class Message>
void ArmOutput::publish(const Message& message) {
  pub_.publish(message);
  ++sent_;
}

void ArmOutput::sendTwist(const CommandMotion& motion, const Vector6& measured,
                          const ros::Time& stamp) {
  const Vector6 v = flangeTwist(place_, motion, measured, settings_.twist_gain);
  geometry_msgs::TwistStamped twist;
  twist.header.stamp = stamp;
  twist.header.frame_id = settings_.base_frame;
  twist.twist.linear = toVector3(v.head<3>());
  twist.twist.angular = toVector3(v.tail<3>());
  publish(twist);
}

std::string ArmOutput::sendJoints(const CommandMotion& motion, const ros::Time& stamp) {
  if (!q_) return {};
  joints_.header.stamp = stamp;
  // at rest the last point is repeated
  if (rest_ == motion.out) {
    publish(joints_);
    return {};
  }
  const JointPoint point = jointPoint(*kinematics_, place_, motion, *q_);
  joints_.points[0].positions.assign(point.q.begin(), point.q.end());
  joints_.points[0].velocities.assign(point.rates.begin(), point.rates.end());
  joints_.points[0].time_from_start = ros::Duration(motion.period);
  publish(joints_);
  rest_.reset();
  if (point.why.empty() && point.q == *q_) rest_ = motion.out;
  q_ = point.q;
  return point.why;
}

}  // namespace assembly_cell::ros_bridge
