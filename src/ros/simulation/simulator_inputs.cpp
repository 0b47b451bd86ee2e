// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/simulator_inputs.h"

#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/process/master_call.h"

namespace assembly_cell::ros_bridge {

SimulatorInputs::SimulatorInputs(ros::NodeHandle& nh, const SimulatorSettings& settings,
                                 SimulatorState& state, LockstepAnswers& answers)
    : state_(state), answers_(answers) {
  findEarlierPublishers(nh);
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  lease_sub_ = nh.subscribe("lease", kQueue, &SimulatorInputs::onLease, this, hints);
  exciter_sub_ = nh.subscribe("exciter", kQueue, &SimulatorInputs::onExciter, this, hints);
  if (settings.follow_motion) {
    motion_sub_ = subscribeStream<CarrierMotion>(
        nh, "carrier_motion", kQueue, [this](const auto& m) { onCarrierMotion(*m); }, nullptr,
        settings.lockstep);
  } else {
    command_sub_ =
        nh.subscribe("carrier_command", kQueue, &SimulatorInputs::onCarrierCommand, this, hints);
  }
}

// Their latched messages were sent to an earlier boot.
void SimulatorInputs::findEarlierPublishers(const ros::NodeHandle& nh) {
  auto state = registrations();
  if (!state) return;
  for (const std::string topic : {"carrier_command", "exciter", "lease"}) {
    for (const std::string& node : state->publishers[nh.resolveName(topic)]) {
      earlier_publishers_.insert(topic + node);
    }
  }
}

template <class Message>
Sender SimulatorInputs::senderOf(const ros::MessageEvent<Message const>& event, const char* topic) {
  Sender sender;
  sender.node = event.getPublisherName();
  const ros::Time& stamp = event.getConstMessage()->header.stamp;
  sender.stamped = !stamp.isZero();
  sender.stamp = state_.timeOf(stamp);
  // the first message of an earlier publisher
  sender.latched = earlier_publishers_.erase(topic + sender.node) > 0 &&
                   (*event.getConnectionHeaderPtr())["latching"] == "1";
  return sender;
}

template <class Message>
bool SimulatorInputs::accept(const Sender& sender, const char* topic, const Message& message) {
  if (!isFromEarlierBoot(state_.gate.guard(), sender, state_.now) &&
      !answers_.count(sender.node, topic, message.header)) {
    return false;
  }
  answers_.notifyIfComplete();
  return true;
}

void SimulatorInputs::onCarrierCommand(
    const ros::MessageEvent<geometry_msgs::PoseStamped const>& event) {
  const geometry_msgs::PoseStamped& command = *event.getConstMessage();
  const std::lock_guard<std::mutex> lock(state_.mutex);
  const Sender sender = senderOf(event, "carrier_command");
  if (!accept(sender, "carrier_command", command)) return;
  const auto refuse = [&](GuardReason reason, const std::string& why) {
    warn(state_.gate.refuse("carrier_command", sender.node, {reason, why}));
  };
  const std::string& frame = command.header.frame_id;
  if (frame != kCarrierBaseFrame) {
    refuse(GuardReason::kFrame,
           "frame_id is \"" + printable(frame) + "\": give " + kCarrierBaseFrame);
    return;
  }
  try {
    warn(state_.gate.move(sender, fromPose(command.pose, "pose"), state_.now));
  } catch (const InputError& error) {
    refuse(GuardReason::kNotFinite, error.what());
  }
}

void SimulatorInputs::onExciter(const ros::MessageEvent<Exciter const>& event) {
  const Exciter& message = *event.getConstMessage();
  const std::lock_guard<std::mutex> lock(state_.mutex);
  const Sender sender = senderOf(event, "exciter");
  if (!accept(sender, "exciter", message)) return;
  ExciterCommand checked;
  checked.amplitude = message.amplitude;
  checked.frequency = message.frequency;
  checked.phase = message.phase;
  checked.direction = message.direction;
  // one that is off may have any direction
  if (!message.on && std::isfinite(message.amplitude)) {
    checked.amplitude = 0.0;
    checked.direction = 1;
  }
  DriveCommand command;
  command.drive.amplitude = message.on ? message.amplitude : 0.0;
  command.drive.frequency = message.frequency;
  command.drive.phase = message.phase;
  command.drive.direction = message.direction;
  if (!message.header.stamp.isZero()) command.reference = sender.stamp;
  warn(state_.gate.drive(sender, checked, command, state_.now));
}

void SimulatorInputs::onLease(const ros::MessageEvent<Lease const>& event) {
  const std::lock_guard<std::mutex> lock(state_.mutex);
  warnThrottled(
      state_.gate.renew(senderOf(event, "lease"), event.getConstMessage()->session, state_.now));
}

void SimulatorInputs::onCarrierMotion(const CarrierMotion& motion) {
  const auto pose = [](const geometry_msgs::Pose& p) { return fromPose(p, "carrier_motion"); };
  const CarrierPoses poses{motion.step, pose(motion.before), pose(motion.at), pose(motion.after)};
  const std::lock_guard<std::mutex> lock(state_.mutex);
  state_.gate.follow(poses);
  answers_.setMotionEnd(state_.timeOf(motion.header.stamp));
  answers_.notifyIfComplete();
}

}  // namespace assembly_cell::ros_bridge
