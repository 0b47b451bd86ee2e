// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/AccelerometerSamples.h>
#include <assembly_cell/Ack.h>
#include <assembly_cell/AlignPegActionFeedback.h>
#include <assembly_cell/AlignPegGoal.h>
#include <assembly_cell/AlignmentReport.h>
#include <assembly_cell/AssemblePegActionFeedback.h>
#include <assembly_cell/AssemblePegGoal.h>
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
#include "assembly_cell/ros/bridge/stream_subscriber.h"

namespace assembly_cell::ros_bridge {

// What a message may hold: finite numbers in their ranges, whole samples, stamps that can be added
// to. A good one costs no allocation.
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
// of goals only what their nodes can't answer in words
MessageCheck check(const AlignPegGoal& goal);
MessageCheck check(const AssemblePegGoal& goal);
MessageCheck check(const CalibrateSensorsGoal& goal);
MessageCheck check(const IdentifyGoal& goal);
MessageCheck check(const IdentifyLocusGoal& goal);
MessageCheck check(const MoveToContactGoal& goal);
MessageCheck check(const RetreatGoal& goal);
// what a goal tells while it runs
MessageCheck check(const AlignPegActionFeedback& message);
MessageCheck check(const AssemblePegActionFeedback& message);
MessageCheck check(const geometry_msgs::PoseStamped& message);
MessageCheck check(const geometry_msgs::WrenchStamped& message);
MessageCheck check(const geometry_msgs::TwistStamped& message);
MessageCheck check(const sensor_msgs::JointState& message);
MessageCheck check(const trajectory_msgs::JointTrajectory& message);
MessageCheck check(const CarrierMotion& message);

/// `stamp` moved by `seconds`, at the ends of what a stamp can hold if it would leave them.
ros::Time later(const ros::Time& stamp, double seconds);

/// What this process has refused and survived, for its log and its diagnostics.
class IncomingLog {
 public:
  struct Figures {
    std::uint64_t refused = 0;  ///< messages
    std::uint64_t caught = 0;   ///< exceptions of callbacks
    std::string last;           ///< in words; empty: nothing yet
  };
  static IncomingLog& ofThisProcess();

  /// Counts, and warns at most once a second for a topic.
  void refuse(const std::string& topic, const std::string& publisher, const std::string& why);
  void caught(const std::string& where, const std::string& what);
  Figures figures() const;

 private:
  bool due(const std::string& topic);

  mutable std::mutex mutex_;
  Figures figures_;
  std::map<std::string, ros::WallTime> warned_;  // by topic or place
};

/// Publishes the figures of the log once a second of wall time, as the status "<node>: messages".
class IncomingDiagnostics {
 public:
  explicit IncomingDiagnostics(ros::NodeHandle& nh);

 private:
  void publish();

  ros::Publisher pub_;
  ros::WallTimer timer_;
  std::uint64_t told_ = 0;  // refused and caught, so far
};

/// Runs `what`; an exception is logged and counted, not passed on. False if there was one.
template <class What>
bool guarded(const std::string& where, const What& what) {
  try {
    what();
    return true;
  } catch (const std::exception& error) {
    IncomingLog::ofThisProcess().caught(where, error.what());
    return false;
  }
}

/// The door of a stream of blocks or poses. A stream has one publisher: who comes in between is a
/// stranger, until the first one has been silent for 5 s; in lockstep, where a plant may stand,
/// for a minute. Its stamps follow one another (StampWindow).
class StreamDoor {
 public:
  explicit StreamDoor(bool lockstep = false);
  // Empty, or why the message is refused.
  std::string judgePublisher(const std::string& publisher);
  std::string judgeStamp(const ros::Time& stamp);

 private:
  double silence_;  // of a publisher that has gone, wall clock [s]
  StampWindow window_;
  std::string publisher_;
  ros::WallTime heard_;
};

/// Hands a message on, with the name of its publisher where the callback takes that.
template <class Message, class Callback>
void hand(const Callback& callback, const ros::MessageEvent<Message const>& event) {
  const auto message = event.getConstMessage();
  if constexpr (std::is_invocable_v<Callback, decltype(message), std::string>) {
    callback(message, event.getPublisherName());
  } else {
    callback(message);
  }
}

/// A subscription that gives `callback` (of a shared pointer, or of that and the publisher's name)
/// what check() passes. What it throws ends no process.
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
    guarded(name, [&] { hand(callback, event); });
  };
  return nh.subscribe<Message, const Event&>(topic, queue, receive, ros::VoidConstPtr(), hints);
}

/// For what the publisher of a stream has sent and the node can't use, with the reason.
template <class Message>
using Unusable = std::function<void(const Message&, const std::string&)>;

/// The same of a stream of blocks or poses. `unusable`: a lockstep goes on after that, too.
template <class Message, class Callback>
StreamSubscriber subscribeStream(ros::NodeHandle& nh, const std::string& topic, std::uint32_t queue,
                                 Callback callback, const Unusable<Message>& unusable = nullptr,
                                 bool lockstep = false) {
  using Event = ros::MessageEvent<Message const>;
  const std::string name = nh.resolveName(topic);
  const auto door = std::make_shared<StreamDoor>(lockstep);
  const auto heard = std::make_shared<std::atomic<bool>>(false);
  const boost::function<void(const Event&)> receive = [=](const Event& event) {
    const auto message = event.getConstMessage();
    std::string why = door->judgePublisher(event.getPublisherName());
    const bool stranger = !why.empty();
    if (!stranger) *heard = true;
    if (why.empty()) why = check(*message).text();
    if (why.empty()) why = door->judgeStamp(message->header.stamp);
    if (!why.empty()) {
      IncomingLog::ofThisProcess().refuse(name, event.getPublisherName(), why);
      if (unusable && !stranger) guarded(name, [&] { unusable(*message, why); });
      return;
    }
    guarded(name, [&] { hand(callback, event); });
  };
  const auto subscribe = [nh, topic, queue, receive]() mutable {
    return nh.subscribe<Message, const Event&>(topic, queue, receive, ros::VoidConstPtr(),
                                               ros::TransportHints().tcpNoDelay());
  };
  return StreamSubscriber(nh, subscribe, heard, lockstep);
}

}  // namespace assembly_cell::ros_bridge
