// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/AccelerometerSamples.h>
#include <assembly_cell/Ack.h>
#include <assembly_cell/AlignPegActionFeedback.h>
#include <assembly_cell/AlignPegGoal.h>
#include <assembly_cell/AlignmentReport.h>
#include <assembly_cell/AssemblePegActionFeedback.h>
#include <assembly_cell/AssemblePegGoal.h>
#include <assembly_cell/AssemblyRecord.h>
#include <assembly_cell/AssemblyVerdict.h>
#include <assembly_cell/CalibrateSensorsGoal.h>
#include <assembly_cell/CarrierMotion.h>
#include <assembly_cell/ContactArray.h>
#include <assembly_cell/DisplacementSamples.h>
#include <assembly_cell/Exciter.h>
#include <assembly_cell/IdentifyGoal.h>
#include <assembly_cell/IdentifyLocusGoal.h>
#include <assembly_cell/LocusEstimate.h>
#include <assembly_cell/MoveToContactGoal.h>
#include <assembly_cell/PlantState.h>
#include <assembly_cell/RecorderState.h>
#include <assembly_cell/RetreatGoal.h>
#include <assembly_cell/SensorCalibration.h>
#include <assembly_cell/StrainSamples.h>
#include <assembly_cell/SupervisorState.h>
#include <assembly_cell/TwinForceState.h>
#include <assembly_cell/WrenchSamples.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TwistStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <type_traits>
#include <utility>

#include "assembly_cell/guard/message_check.h"
#include "assembly_cell/ros/bridge/incoming_log.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"

namespace assembly_cell::ros_bridge {

// Checks of messages: finite numbers in their ranges, whole samples, stamps that can be added to.
// Without allocation for a valid message.
MessageCheck check(const StrainSamples& message);
MessageCheck check(const WrenchSamples& message);
MessageCheck check(const DisplacementSamples& message);
MessageCheck check(const AccelerometerSamples& message);
MessageCheck check(const Exciter& message);
MessageCheck check(const Ack& message);
MessageCheck check(const PlantState& message);
MessageCheck check(const SupervisorState& message);
MessageCheck check(const SensorCalibration& message);
MessageCheck check(const LocusEstimate& message);
MessageCheck check(const ContactArray& message);
MessageCheck check(const AlignmentReport& message);
MessageCheck check(const TwinForceState& message);
MessageCheck check(const AssemblyRecord& message);
MessageCheck check(const AssemblyVerdict& message);
MessageCheck check(const RecorderState& message);
// of goals only what their nodes don't answer themselves
MessageCheck check(const AlignPegGoal& goal);
MessageCheck check(const AssemblePegGoal& goal);
MessageCheck check(const CalibrateSensorsGoal& goal);
MessageCheck check(const IdentifyGoal& goal);
MessageCheck check(const IdentifyLocusGoal& goal);
MessageCheck check(const MoveToContactGoal& goal);
MessageCheck check(const RetreatGoal& goal);
// feedback of goals
MessageCheck check(const AlignPegActionFeedback& message);
MessageCheck check(const AssemblePegActionFeedback& message);
MessageCheck check(const geometry_msgs::PoseStamped& message);
MessageCheck check(const geometry_msgs::WrenchStamped& message);
MessageCheck check(const geometry_msgs::TwistStamped& message);
/// The header only: joints of other devices may be anything, see ArmJoints for those of an arm.
MessageCheck check(const sensor_msgs::JointState& message);
MessageCheck check(const trajectory_msgs::JointTrajectory& message);
MessageCheck check(const CarrierMotion& message);

/// `stamp` + `seconds`, limited to the range of stamps.
ros::Time later(const ros::Time& stamp, double seconds);

/// Filter of a stream of blocks or poses. A stream has one publisher: messages of others are
/// refused until the first one has been silent for 5 s; in lockstep, where the plant may stand
/// still, for a minute. Its stamps follow one another (StampWindow).
class StreamFilter {
 public:
  explicit StreamFilter(bool lockstep = false);
  /// Both return an empty text, or why the message is refused.
  std::string checkPublisher(const std::string& publisher);
  std::string checkStamp(const ros::Time& stamp);

 private:
  double silence_;  // after which another publisher is accepted, wall clock [s]
  StampWindow window_;
  std::string publisher_;
  ros::WallTime received_;
};

/// Calls `callback` with the message, and with the name of its publisher if it takes that.
template <class Message, class Callback>
void deliver(const Callback& callback, const ros::MessageEvent<Message const>& event) {
  const auto message = event.getConstMessage();
  if constexpr (std::is_invocable_v<Callback, decltype(message), std::string>) {
    callback(message, event.getPublisherName());
  } else {
    callback(message);
  }
}

/// Subscription whose messages pass check() before `callback` gets them (a shared pointer, or that
/// and the publisher's name). Exceptions of the callback are logged and counted.
template <class Message, class Callback>
ros::Subscriber subscribeChecked(ros::NodeHandle& nh, const std::string& topic, std::uint32_t queue,
                                 Callback callback,
                                 const ros::TransportHints& hints = ros::TransportHints()) {
  using Event = ros::MessageEvent<Message const>;
  const std::string name = nh.resolveName(topic);
  const boost::function<void(const Event&)> receive = [name, callback](const Event& event) {
    const auto message = event.getConstMessage();
    if (const MessageCheck found = check(*message); !found.good()) {
      IncomingLog::ofThisProcess().refuse(name, event.getPublisherName(), found.text());
      return;
    }
    guarded(name, [&] { deliver(callback, event); });
  };
  return nh.subscribe<Message, const Event&>(topic, queue, receive, ros::VoidConstPtr(), hints);
}

/// Callback for a refused message of the stream's publisher, with the reason.
template <class Message>
using Unusable = std::function<void(const Message&, const std::string&)>;

/// Subscribes to a stream of blocks or poses. `unusable`: in lockstep such a block must be
/// acknowledged, too.
template <class Message, class Callback>
StreamSubscriber subscribeStream(ros::NodeHandle& nh, const std::string& topic, std::uint32_t queue,
                                 Callback callback, const Unusable<Message>& unusable = nullptr,
                                 bool lockstep = false) {
  using Event = ros::MessageEvent<Message const>;
  const std::string name = nh.resolveName(topic);
  const auto filter = std::make_shared<StreamFilter>(lockstep);
  const auto received = std::make_shared<std::atomic<bool>>(false);
  const boost::function<void(const Event&)> receive = [=](const Event& event) {
    const auto message = event.getConstMessage();
    std::string why = filter->checkPublisher(event.getPublisherName());
    const bool is_unknown = !why.empty();
    if (!is_unknown) *received = true;
    if (why.empty()) why = check(*message).text();
    if (why.empty()) why = filter->checkStamp(message->header.stamp);
    if (!why.empty()) {
      IncomingLog::ofThisProcess().refuse(name, event.getPublisherName(), why);
      if (unusable && !is_unknown) guarded(name, [&] { unusable(*message, why); });
      return;
    }
    guarded(name, [&] { deliver(callback, event); });
  };
  const auto subscribe = [nh, topic, queue, receive]() mutable {
    return nh.subscribe<Message, const Event&>(topic, queue, receive, ros::VoidConstPtr(),
                                               ros::TransportHints().tcpNoDelay());
  };
  return StreamSubscriber(nh, subscribe, received, lockstep);
}

}  // namespace assembly_cell::ros_bridge
