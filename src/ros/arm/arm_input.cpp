// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/arm/arm_input.h"

#include <type_traits>
#include <utility>

#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"

namespace assembly_cell::ros_bridge {

ArmInput::ArmInput(const std::string& topic, const std::string& base_frame,
                   std::unique_ptr<ArmKinematics> kinematics)
    : topic_(topic), base_frame_(base_frame), joints_(std::move(kinematics)) {}

void ArmInput::refuse(const std::string& publisher, const std::string& why) {
  IncomingLog::ofThisProcess().refuse(topic_, publisher, why);
  refusal_ = topic_ + " of " + publisher + " refused: " + why;
}

// A message of the arm: what all streams are checked for.
template <class Message>
std::optional<ArmInput::State> ArmInput::accept(const ros::MessageEvent<Message const>& event) {
  const Message& m = *event.getConstMessage();
  std::string why = filter_.checkPublisher(event.getPublisherName());
  if (why.empty()) why = check(m).text();
  if (why.empty() && m.header.stamp.isZero()) why = "header.stamp is 0: give the state's time";
  if (why.empty()) why = filter_.checkStamp(m.header.stamp);
  if constexpr (std::is_same_v<Message, sensor_msgs::JointState>) {
    if (why.empty()) why = joints_.update(m.name, m.position);
  }
  if (!why.empty()) {
    refuse(event.getPublisherName(), why);
    return {};
  }
  State state;
  state.stamp = m.header.stamp;
  if constexpr (std::is_same_v<Message, sensor_msgs::JointState>) {
    state.X_base_flange = joints_.flange();
  } else {
    state.X_base_flange = fromPose(m.pose, "current_pose");
  }
  received_ = true;
  refusal_.clear();
  return state;
}

std::optional<ArmInput::State> ArmInput::take(
    const ros::MessageEvent<sensor_msgs::JointState const>& event) {
  const sensor_msgs::JointState& m = *event.getConstMessage();
  const ArmJoints::Share share = joints_.shareOf(m.name);
  if (share == ArmJoints::Share::kAll) return accept(event);
  const std::string& publisher = event.getPublisherName();
  if (share == ArmJoints::Share::kSome) {
    refuse(publisher, joints_.missing(m.name));
    return {};
  }
  if (received_) return {};
  // until the arm's joints are received the message that is most like theirs is named
  const std::size_t similar = joints_.similar(m.name);
  if (!refusal_.empty() && similar <= similar_) return {};
  similar_ = similar;
  if (similar > 0) {
    refuse(publisher, joints_.missing(m.name));
  } else {
    refusal_ = topic_ + " of " + publisher + ": " + joints_.missing(m.name);
  }
  return {};
}

std::optional<ArmInput::State> ArmInput::take(
    const ros::MessageEvent<geometry_msgs::PoseStamped const>& event) {
  const std::string& frame = event.getConstMessage()->header.frame_id;
  if (frame == base_frame_) return accept(event);
  refuse(event.getPublisherName(),
         "frame_id is \"" + printable(frame) + "\": give \"" + base_frame_ + "\"");
  return {};
}

}  // namespace assembly_cell::ros_bridge
