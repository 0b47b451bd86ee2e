// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/arm/emulated_arm_node.h"

#include <assembly_cell/CarrierMotion.h>
#include <geometry_msgs/TwistStamped.h>
#include <sensor_msgs/JointState.h>
#include <std_srvs/Trigger.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <algorithm>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/process/participants.h"

namespace assembly_cell::ros_bridge {

namespace {

// Greatest lead of the arm's time over the simulator's newest stamp, so that a paused simulator
// stops the arm. [s]
constexpr double kMaxAhead = 0.1;

void checkFrame(const std_msgs::Header& header, const std::string& base) {
  if (header.frame_id == base) return;
  throw InputError("frame_id is \"" + printable(header.frame_id) + "\": give " + base);
}

}  // namespace

EmulatedArmNode::EmulatedArmNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : nh_(nh), participant_(participantName(nh.getNamespace(), pnh.getNamespace())) {
  Parameters parameters(pnh);
  lockstep_ = parameters.flag("lockstep", false);
  const double factor = parameters.number("real_time_factor", Range{1e-3, 1e3}, 1.0);
  time_ = std::make_unique<NodeTime>(lockstep_, factor);
  const CellPlace place = loadCellPlace(parameters.text("place"));
  EmulatedArmSettings settings;
  const std::string description = parameters.text("description", settings.description);
  auto kinematics =
      std::make_unique<ArmKinematics>(Parameters(nh_).text(description), place.flange, description);
  settings.home.assign(static_cast<std::size_t>(kinematics->joints()), 0.0);
  parameters.read(fieldsOf(settings));
  parameters.refuseUnknown();
  controller_ = std::make_unique<ArmController>(settings, place, std::move(kinematics));

  ros::NodeHandle arm_nh(nh_, "arm");
  // latched: a participant that connects late must receive the first one
  if (lockstep_) ack_pub_ = {nh_, "ack", kQueue};
  joints_pub_ = arm_nh.advertise<sensor_msgs::JointState>("joint_states", kQueue, true);
  pose_pub_ = arm_nh.advertise<geometry_msgs::PoseStamped>("current_pose", kQueue, true);
  motion_pub_ = nh_.advertise<CarrierMotion>("carrier_motion", kQueue, true);
  subscribe(arm_nh, settings.interface);
  unlock_srv_ = pnh.advertiseService<std_srvs::Trigger::Request, std_srvs::Trigger::Response>(
      "unlock", [this](std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
        const std::lock_guard<std::mutex> lock(mutex_);
        response.success = controller_->isPlaced() && controller_->arm().stopped;
        response.message =
            response.success ? controller_->arm().why : "the arm has not stopped by itself";
        if (response.success) unlock(controller_->arm());
        return true;
      });
  if (lockstep_) return;
  thread_.start(1.0 / (settings.arm.rate * factor), [this] {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (controller_->isPlaced()) runUntil(std::min(time_->now(), time_->newest() + kMaxAhead));
  });
}

template <class Message, class Command>
void EmulatedArmNode::take(const Message& message, const Command& command) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!controller_->isPlaced()) return;
  const double time = time_->at(static_cast<StampNs>(message.header.stamp.toNSec()));
  command(message, time);
  if (lockstep_) runUntil(time);
}

void EmulatedArmNode::subscribe(ros::NodeHandle& arm_nh, ArmInterface interface) {
  simulated_sub_ = subscribeStream<geometry_msgs::PoseStamped>(
      arm_nh, "simulated_pose", kQueue, [this](const auto& m) { onSimulated(*m); }, nullptr,
      lockstep_);
  wrench_sub_ = subscribeStream<WrenchSamples>(
      nh_, "sensor_b/wrench_samples", kQueue, [this](const auto& m) { onWrench(*m); }, nullptr,
      lockstep_);
  switch (interface) {
    case ArmInterface::kPose:
      command_sub_ = subscribeStream<geometry_msgs::PoseStamped>(
          arm_nh, "target_frame", kQueue, [this](const auto& message) {
            take(*message, [this](const geometry_msgs::PoseStamped& m, double time) {
              checkFrame(m.header, controller_->kinematics().base());
              controller_->commandPose(fromPose(m.pose, "target_frame"), time);
            });
          });
      break;
    case ArmInterface::kTwist:
      command_sub_ = subscribeStream<geometry_msgs::TwistStamped>(
          arm_nh, "twist", kQueue, [this](const auto& message) {
            take(*message, [this](const geometry_msgs::TwistStamped& m, double time) {
              checkFrame(m.header, controller_->kinematics().base());
              const auto &v = m.twist.linear, &w = m.twist.angular;
              controller_->commandTwist((Vector6() << v.x, v.y, v.z, w.x, w.y, w.z).finished(),
                                        time);
            });
          });
      break;
    case ArmInterface::kJoints:
      command_sub_ = subscribeStream<trajectory_msgs::JointTrajectory>(
          arm_nh, "command", kQueue, [this](const auto& message) {
            take(*message, [this](const trajectory_msgs::JointTrajectory& m, double time) {
              controller_->commandJoints(m.joint_names, m.points[0].positions, time);
            });
          });
      break;
  }
}

void EmulatedArmNode::onSimulated(const geometry_msgs::PoseStamped& pose) {
  const Pose X = fromPose(pose.pose, "simulated_pose");
  const auto stamp = static_cast<StampNs>(pose.header.stamp.toNSec());
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool restarted = !time_->started() || stamp < simulated_;
  if (restarted) time_->start(stamp);
  simulated_ = stamp;
  time_->observe(stamp);
  const double time = time_->at(stamp);
  std::string error;
  if (!controller_->setCarrier(X, time, restarted, error)) return;
  if (!error.empty()) ROS_ERROR("%s", error.c_str());
  if (early_) setLoad(*early_);
  early_.reset();
  publish(time);
}

void EmulatedArmNode::onWrench(const WrenchSamples& samples) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (controller_->isPlaced()) {
    setLoad(samples);
  } else {
    early_ = samples;
  }
}

// The answer: the bridge's next points, on another topic, are received after this load.
void EmulatedArmNode::setLoad(const WrenchSamples& samples) {
  const std::size_t count = samples.wrench.size() / 6;
  Vector6 mean = Vector6::Zero();
  for (std::size_t i = 0; i < count; ++i) mean += Vector6::Map(samples.wrench.data() + 6 * i);
  mean /= static_cast<double>(count);
  EmulatedArm& arm = controller_->arm();
  const bool before = arm.stopped;
  load(arm, mean);
  if (arm.stopped && !before) ROS_WARN("%s", arm.why.c_str());
  if (!lockstep_) return;
  Ack ack;
  ack.node = participant_;
  ack.sequence = samples.sequence;
  ack_pub_.publish(ack);
}

void EmulatedArmNode::runUntil(double time) {
  if (time <= controller_->arm().time && !lockstep_) return;
  advance(controller_->arm(), controller_->kinematics(), time);
  publish(time);
}

void EmulatedArmNode::publish(double time) {
  const ArmKinematics& kinematics = controller_->kinematics();
  const EmulatedArm& arm = controller_->arm();
  const JointVector q = encoders(arm);
  ros::Time stamp;
  stamp.fromNSec(static_cast<std::uint64_t>(time_->stampAt(time)));
  sensor_msgs::JointState joints;
  joints.header.stamp = stamp;
  joints.name = kinematics.names();
  joints.position.assign(q.begin(), q.end());
  joints.velocity.assign(arm.rate.begin(), arm.rate.end());
  joints_pub_.publish(joints);
  if (pose_pub_.getNumSubscribers() > 0 || lockstep_) {
    pose_pub_.publish(poseStamped(kinematics.base(), kinematics.forward(q), stamp));
  }
  const CarrierPoses poses = carrier(arm, kinematics);
  CarrierMotion motion;
  motion.header.stamp = stamp;
  motion.header.frame_id = kCarrierBaseFrame;
  motion.step = poses.step;
  motion.before = toPose(poses.before);
  motion.at = toPose(poses.at);
  motion.after = toPose(poses.after);
  motion_pub_.publish(motion);
}

}  // namespace assembly_cell::ros_bridge
