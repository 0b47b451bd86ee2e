// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/calibration/calibration_topics.h"

#include <assembly_cell/CalibrationStatus.h>

#include "assembly_cell/ros/bridge/calibration_messages.h"

namespace assembly_cell::ros_bridge {

CalibrationTopics::CalibrationTopics(ros::NodeHandle pnh, const CalibrationSession& session)
    : session_(session) {
  status_pub_ = pnh.advertise<CalibrationStatus>("status", 1, true);
  observations_pub_ = pnh.advertise<std_msgs::String>(
      "observations", 10, [this](const ros::SingleSubscriberPublisher& subscriber) {
        subscriber.publish(observationsMessage());
      });
  for (const Side side : kSides) {
    calibration_pub_[side] =
        pnh.advertise<SensorCalibration>(sensorName(side) + "/calibration", 1, true);
  }
  const MaybePerSide<ActiveCalibration> active = session.active();
  publishCalibrations({active.a.has_value(), active.b.has_value()});
  publishStatus(false);
}

SensorCalibration CalibrationTopics::messageOf(Side side, const Calibration& c) const {
  SensorCalibration message = toMessage(c);
  const std::lock_guard<std::mutex> lock(mutex_);
  message.header.stamp = active_since_[side];
  message.header.frame_id = sensorName(side);
  return message;
}

void CalibrationTopics::publishCalibrations(const PerSide<bool>& changed) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const Side side : kSides) {
      if (changed[side]) active_since_[side] = ros::Time::now();
    }
  }
  for (const Side side : kSides) {
    if (!changed[side]) continue;
    calibration_pub_[side].publish(messageOf(side, session_.active()[side]->calibration));
  }
}

void CalibrationTopics::publishStatus(bool in_action) {
  const ObservationSet set = session_.observations();
  const MaybePerSide<ActiveCalibration> active = session_.active();
  CalibrationStatus status;
  status.observations = static_cast<std::uint32_t>(set.observations.size());
  if (!set.observations.empty()) status.last_id = set.observations.back().id;
  if (active.a) status.calibration_a = active.a->calibration.id;
  if (active.b) status.calibration_b = active.b->calibration.id;
  status.state = in_action ? "calibrate" : "idle";
  status.header.stamp = ros::Time::now();
  status_pub_.publish(status);
  // The whole observation file, so that a bag's last message is the session: written out only for a
  // subscriber, who gets it on connecting and after each change.
  if (observations_pub_.getNumSubscribers() > 0) observations_pub_.publish(observationsMessage());
}

std_msgs::String CalibrationTopics::observationsMessage() const {
  std_msgs::String file;
  file.data = observationsText(session_.observations());
  return file;
}

}  // namespace assembly_cell::ros_bridge
