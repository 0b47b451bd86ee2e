// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/bridge/static_frames.h"

#include <tf2_ros/static_transform_broadcaster.h>

#include <mutex>

namespace assembly_cell::ros_bridge {

struct StaticFrames::Shared {
  std::mutex mutex;
  tf2_ros::StaticTransformBroadcaster broadcaster;
};

StaticFrames::StaticFrames() {
  // as long as one object exists
  static std::mutex mutex;
  static std::weak_ptr<Shared> of_this_process;
  const std::lock_guard<std::mutex> lock(mutex);
  shared_ = of_this_process.lock();
  if (shared_) return;
  shared_ = std::make_shared<Shared>();
  of_this_process = shared_;
}

void StaticFrames::send(const std::vector<geometry_msgs::TransformStamped>& frames) {
  const std::lock_guard<std::mutex> lock(shared_->mutex);
  shared_->broadcaster.sendTransform(frames);
}

}  // namespace assembly_cell::ros_bridge
