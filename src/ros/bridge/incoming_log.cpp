// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/bridge/incoming_log.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/ros.h>

#include <utility>

#include "assembly_cell/ros/bridge/diagnostics.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kWarnPeriod = 1.0;  // of one topic or place, wall clock [s]

}  // namespace

IncomingLog& IncomingLog::ofThisProcess() {
  static IncomingLog log;
  return log;
}

bool IncomingLog::isDue(const std::string& where) {
  const ros::WallTime now = ros::WallTime::now();
  ros::WallTime& last = logged_[where];
  if (!last.isZero() && (now - last).toSec() < kWarnPeriod) return false;
  last = now;
  return true;
}

void IncomingLog::refuse(const std::string& topic, const std::string& publisher,
                         const std::string& why) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++figures_.refused;
  figures_.last = topic + " of " + publisher + ": " + why;
  if (isDue(topic)) ROS_WARN("refused: %s", figures_.last.c_str());
}

void IncomingLog::caught(const std::string& where, const std::string& what) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++figures_.caught;
  figures_.last = where + ": " + what;
  if (isDue(where)) ROS_ERROR("a callback failed: %s", figures_.last.c_str());
}

IncomingDiagnostics::IncomingDiagnostics(ros::NodeHandle& nh)
    : pub_(nh.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10)),
      timer_(nh.createWallTimer(ros::WallDuration(1.0),
                                [this](const ros::WallTimerEvent&) { publish(); })) {}

void IncomingDiagnostics::publish() {
  const IncomingLog::Figures figures = IncomingLog::ofThisProcess().figures();
  diagnostic_msgs::DiagnosticStatus status;
  status.name = ros::this_node::getName().substr(1) + ": messages";
  status.hardware_id = "none";
  const bool news = figures.refused + figures.caught !=
                    std::exchange(published_, figures.refused + figures.caught);
  status.level =
      news ? diagnostic_msgs::DiagnosticStatus::WARN : diagnostic_msgs::DiagnosticStatus::OK;
  status.message = news ? "refused: " + figures.last : "none refused";
  publishStatus(pub_, status,
                {{"Refused", std::to_string(figures.refused)},
                 {"Callbacks failed", std::to_string(figures.caught)},
                 {"Last", figures.last}});
}

IncomingLog::Figures IncomingLog::figures() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return figures_;
}

}  // namespace assembly_cell::ros_bridge
