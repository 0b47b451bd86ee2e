// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/arm_output.h"

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TwistStamped.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <cmath>

#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/conversions.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr int kQueue = 100;

}  // namespace

ArmInterface armInterface(const std::string& name) {
  if (name == "pose") return ArmInterface::kPose;
  return name == "twist" ? ArmInterface::kTwist : ArmInterface::kJoints;
}

ArmOutput::ArmOutput(ros::NodeHandle nh, const Settings& settings, const ArmKinematics* kinematics)
    : settings_(settings), kinematics_(kinematics) {
  switch (settings.interface) {
    case ArmInterface::kPose:
      pub_ = nh.advertise<geometry_msgs::PoseStamped>("target_frame", kQueue);
      break;
    case ArmInterface::kTwist:
      pub_ = nh.advertise<geometry_msgs::TwistStamped>("twist", kQueue);
      break;
    case ArmInterface::kJoints:
      pub_ = nh.advertise<trajectory_msgs::JointTrajectory>("command", kQueue);
      break;
  }
}

void ArmOutput::setJoints(const JointVector& q) { q_ = q; }

std::string ArmOutput::send(const CommandMotion& motion, const Vector6& measured,
                            const ros::Time& stamp) {
  switch (settings_.interface) {
    case ArmInterface::kPose:
      pub_.publish(
          poseStamped(settings_.base_frame, settings_.place.flangeOf(motionPose(motion)), stamp));
      break;
    case ArmInterface::kTwist:
      sendTwist(motion, measured, stamp);
      break;
    case ArmInterface::kJoints:
      return sendJoints(motion, stamp);
  }
  return {};
}

void ArmOutput::sendTwist(const CommandMotion& motion, const Vector6& measured,
                          const ros::Time& stamp) {
  const CellPlace& place = settings_.place;
  const Pose now = place.flangeOf(motionPose(motion));
  const Pose before = place.flangeOf(poseOfCoordinates(motion.previous));
  const Pose there = place.flangeOf(poseOfCoordinates(measured));
  const auto turn = [](const Pose& from, const Pose& to) {
    return Eigen::Vector3d(vectorFromRotation(to.R * from.R.transpose()).value);
  };
  const double rate = 1.0 / motion.period, gain = settings_.twist_gain;
  geometry_msgs::TwistStamped twist;
  twist.header.stamp = stamp;
  twist.header.frame_id = settings_.base_frame;
  twist.twist.linear = toVector3(rate * (now.p - before.p) + gain * (now.p - there.p));
  twist.twist.angular = toVector3(rate * turn(before, now) + gain * turn(there, now));
  pub_.publish(twist);
}

std::string ArmOutput::sendJoints(const CommandMotion& motion, const ros::Time& stamp) {
  if (!q_) return {};
  const JointVector before = *q_;
  JointVector q = before;
  const JointSolution solution =
      kinematics_->solve(settings_.place.flangeOf(motionPose(motion)), q);
  std::string why;
  if (!solution.reached) {
    why = text("the joints get no nearer than %g m and %g rad", solution.distance, solution.turn);
    if (solution.at_limit >= 0) {
      why += ": " + kinematics_->names()[static_cast<std::size_t>(solution.at_limit)] +
             " is at its limit";
    }
  }
  const JointVector most = motion.period * kinematics_->limits().speed;
  for (Eigen::Index k = 0; k < q.size(); ++k) {
    if (std::abs(q(k) - before(k)) <= most(k)) continue;
    const double share = std::abs(q(k) - before(k)) / motion.period;
    q(k) = before(k) + std::copysign(most(k), q(k) - before(k));
    if (why.empty()) {
      why = text("joint %s would have to turn by %g rad/s, allowed are %g rad/s",
                 kinematics_->names()[static_cast<std::size_t>(k)].c_str(), share,
                 kinematics_->limits().speed(k));
    }
  }
  trajectory_msgs::JointTrajectory message;
  message.header.stamp = stamp;
  message.joint_names = kinematics_->names();
  message.points.resize(1);
  const JointVector rates = (q - before) / motion.period;
  message.points[0].positions.assign(q.begin(), q.end());
  message.points[0].velocities.assign(rates.begin(), rates.end());
  message.points[0].time_from_start = ros::Duration(motion.period);
  pub_.publish(message);
  q_ = q;
  return why;
}

}  // namespace assembly_cell::ros_bridge
