// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <optional>

#include "assembly_cell/ros/bridge/static_frames.h"

namespace assembly_cell::ros_bridge {

/// A camera above the rim, for a second view in rviz (display Camera): `rim_view/camera_info`, a
/// blank picture on `rim_view/image`, and the frame `rim_camera` (x right, y down, z into the hole;
/// x of it is x of `hole`). Sends only while the picture has a subscriber. For one thread.
class RimView {
 public:
  explicit RimView(ros::NodeHandle& nh);
  ~RimView();
  /// To be called at the markers' rate; sends twice a second of wall time. hole_radius [m]; without
  /// one (0) there is nothing to see.
  void update(double hole_radius);

 private:
  ros::Publisher image_pub_, info_pub_;
  std::optional<StaticFrames> frame_;  // from the first subscriber on
  ros::WallTime sent_;
};

}  // namespace assembly_cell::ros_bridge
