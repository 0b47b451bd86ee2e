// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/arm/arm_bridge_publisher.h"

#include <assembly_cell/Lease.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>

#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/diagnostics.h"
#include "assembly_cell/ros/process/participants.h"

namespace assembly_cell::ros_bridge {

namespace {

ros::Time stampAt(const ArmBridge& bridge, double time) {
  ros::Time stamp;
  return stamp.fromNSec(static_cast<std::uint64_t>(bridge.time().stampAt(time)));
}

}  // namespace

ArmBridgePublisher::ArmBridgePublisher(ros::NodeHandle& nh, ros::NodeHandle& pnh, bool lockstep)
    : name_(pnh.getNamespace()), participant_(participantName(nh.getNamespace(), name_)) {
  ros::NodeHandle arm_nh(nh, "arm");
  carrier_pub_ = nh.advertise<geometry_msgs::PoseStamped>("carrier_pose", kQueue, true);
  plant_state_pub_ = nh.advertise<PlantState>("plant_state", 10, true);
  exciter_pub_ = arm_nh.advertise<Exciter>("exciter", kQueue, true);
  wrench_pub_ = pnh.advertise<geometry_msgs::WrenchStamped>("wrench", kQueue);
  diagnostics_pub_ = nh.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
  if (lockstep) {
    ack_pub_ = {arm_nh, "ack", kQueue};
  } else {
    lease_pub_ = arm_nh.advertise<Lease>("lease", kQueue);
  }
}

void ArmBridgePublisher::publishFrames(const CellPlace& place, const std::string& base_frame) {
  const ros::Time stamp = ros::Time::now();
  const Pose X_HB{Eigen::Matrix3d::Identity(), {0.0, 0.0, place.carrier_height}};
  static_tf_.send({transformStamped(kHoleFrame, kCarrierBaseFrame, X_HB, stamp),
                   transformStamped(kHoleFrame, base_frame, inverse(place.X_base_hole), stamp)});
  tf_.emplace();
}

void ArmBridgePublisher::refuse(const std::string& what, const std::string& node,
                                const GuardVerdict& verdict) {
  if (what != "lease") ++refused_.count;
  refused_.node = node;
  refused_.last = {verdict.reason, what + " of " + node + " refused: " + verdict.text};
  ROS_WARN_THROTTLE(1.0, "%s", refused_.last.text.c_str());
}

void ArmBridgePublisher::exciter(const Exciter& command) {
  exciter_on_ = command.on && command.amplitude > 0.0;
  ++exciter_count_;
  exciter_pub_.publish(command);
}

void ArmBridgePublisher::block(const std_msgs::Header& header, ArmBridge& bridge) {
  const ros::Time end = stampAt(bridge, bridge.block().end);
  if (wrench_pub_.getNumSubscribers() > 0) {
    geometry_msgs::WrenchStamped contact;
    contact.header.stamp = end;
    contact.header.frame_id = header.frame_id;
    contact.wrench = toWrench(bridge.guard().wrench[1]);
    wrench_pub_.publish(contact);
  }
  if (!lease_pub_) return;
  Lease lease;
  lease.header.stamp = end;
  lease.session = bridge.bootId();
  lease_pub_.publish(lease);
}

void ArmBridgePublisher::changes(ArmBridge& bridge) {
  while (const auto pose = bridge.poses().next()) {
    const ros::Time stamp = stampAt(bridge, pose->end);
    carrier_pub_.publish(poseStamped(kCarrierBaseFrame, pose->X, stamp));
    if (!tf_) continue;
    tf_->sendTransform(transformStamped(kCarrierBaseFrame, kCarrierFrame, pose->X, stamp));
  }
  if (exciter_on_ && !bridge.guard().guard.shaking) {
    Exciter off;
    off.header.stamp = stampAt(bridge, bridge.time().now());
    off.header.frame_id = kPegFrame;
    off.direction = 1;
    exciter(off);
  }
  state(bridge);
}

// Called with each point and each state of the arm: without a change nothing is copied.
void ArmBridgePublisher::state(ArmBridge& bridge) {
  const ArmGuard& arm = bridge.guard();
  const bool held = isHalted(arm) || arm.guard.expired;
  const bool was_held = published_ && published_->held;
  if (published_ && arm.guard.session == published_->session &&
      arm.guard.owner == published_->holder && held == published_->held &&
      isHalted(arm) == published_->overload && bridge.bootId() == published_->life &&
      arm.guard.shaking == published_->exciter && arm.text == published_->reason &&
      refused_.count == published_->refused) {
    return;
  }
  PlantState state;
  state.life = bridge.bootId();
  state.session = arm.guard.session;
  state.holder = arm.guard.owner;
  state.held = held;
  state.overload = isHalted(arm);
  state.exciter = arm.guard.shaking;
  state.reason = arm.text;
  state.refused = refused_.count;
  state.refused_node = refused_.node;
  state.refused_reason = refused_.last.good() ? "" : toString(refused_.last.reason);
  state.refusal = refused_.last.text;
  if (held && !was_held) {
    ROS_WARN("arm %s, exciter off: %s", toString(arm.mode), arm.text.c_str());
  }
  if (bridge.time().started()) state.header.stamp = stampAt(bridge, bridge.time().now());
  published_ = state;
  plant_state_pub_.publish(state);
}

void ArmBridgePublisher::acknowledge(std::uint32_t sequence, const ArmBridge& bridge) {
  Ack ack;
  ack.node = participant_;
  ack.sequence = sequence;
  ack.commands = exciter_count_;
  ack.session = bridge.bootId();
  ack_pub_.publish(ack);
}

void ArmBridgePublisher::diagnostics(ArmBridge& bridge, const std::string& flange,
                                     std::uint64_t points, const std::string& stuck) {
  const ArmGuard& arm = bridge.guard();
  using Status = diagnostic_msgs::DiagnosticStatus;
  Status status;
  status.name = name_.substr(1) + ": arm";
  status.hardware_id = flange;
  const std::string missing = stuck.empty() ? bridge.missing() : "a block waits for " + stuck;
  status.level = isHalted(arm) ? Status::ERROR : missing.empty() ? Status::OK : Status::WARN;
  status.message = toString(arm.mode);
  if (!arm.text.empty()) status.message += ": " + arm.text;
  if (!missing.empty() && !isHalted(arm)) status.message += ": " + missing;
  const Vector6& x = arm.measured;
  publishStatus(diagnostics_pub_, status,
                {{"Reason", toString(arm.reason)},
                 {"Held by", arm.guard.owner},
                 {"Carrier in its base",
                  text("%.6f %.6f %.6f m, %.5f %.5f %.5f rad", x(0), x(1), x(2), x(3), x(4), x(5))},
                 {"Points sent", std::to_string(points)},
                 {"Commands refused", std::to_string(refused_.count)},
                 {"Last refusal", refused_.last.text}});
}

void ArmBridgePublisher::restart() {
  exciter_count_ = 0;
  exciter_on_ = false;
}

}  // namespace assembly_cell::ros_bridge
