// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/TransformStamped.h>

#include <memory>
#include <vector>

namespace assembly_cell::ros_bridge {

/// Sends static frames to `/tf_static`. The nodes of a process share one sender: ROS keeps the last
/// message of a process for who connects late, so that must hold the frames of all. Thread-safe.
class StaticFrames {
 public:
  StaticFrames();
  void send(const std::vector<geometry_msgs::TransformStamped>& frames);

 private:
  struct Shared;
  std::shared_ptr<Shared> shared_;
};

}  // namespace assembly_cell::ros_bridge
