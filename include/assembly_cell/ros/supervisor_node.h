// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <actionlib/server/simple_action_server.h>
#include <ros/ros.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "assembly_cell/AlignPegAction.h"
#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/MoveToContactAction.h"
#include "assembly_cell/align/align.h"
#include "assembly_cell/align/press.h"
#include "assembly_cell/ros/ros_plant.h"

namespace assembly_cell::ros_bridge {

/// Node assembly_supervisor: runs the strategies over the cell through ROS. It alone moves
/// anything. One goal at a time. See docs/interfaces.md.
class SupervisorNode {
 public:
  /// Throws InputError for bad parameters or scenario.
  SupervisorNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);
  ~SupervisorNode();

 private:
  using AlignServer = actionlib::SimpleActionServer<AlignPegAction>;
  using ContactServer = actionlib::SimpleActionServer<MoveToContactAction>;

  void executeAlign(const AlignPegGoalConstPtr& goal);
  void executeContact(const MoveToContactGoalConstPtr& goal);
  AlignmentReport report(const AlignResult& result, double wall_time) const;

  Mechanism mechanism_;  ///< nominal parts
  Pose X_CP_;            ///< peg in the carrier, at rest
  AlignParameters parameters_;
  PressLimits limits_;

  std::unique_ptr<RosPlant> plant_;
  std::mutex busy_;  ///< held by the goal that runs
  ros::Publisher report_pub_;
  tf2_ros::StaticTransformBroadcaster frames_;
  std::unique_ptr<AlignServer> align_server_;
  std::unique_ptr<ContactServer> contact_server_;
};

}  // namespace assembly_cell::ros_bridge
