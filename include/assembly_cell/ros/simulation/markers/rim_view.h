// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <optional>
#include <string>

#include "assembly_cell/ros/bridge/static_frames.h"

namespace assembly_cell::ros_bridge {

/// A camera above the rim, for a second view in rviz (display Camera): `rim_view/camera_info`, a
/// blank picture on `rim_view/image`, and the frame `rim_camera` (x right, y down, z into the hole;
/// x of it is x of the hole's frame). Sends only while the picture has a subscriber. For one
/// thread.
class RimView {
 public:
  explicit RimView(ros::NodeHandle& nh);
  ~RimView();
  /// To be called at the markers' rate; sends twice a second of wall time. hole_frame: that in
  /// which rim and peg are drawn. hole_radius [m]; without one (0) there is nothing to see.
  void update(const std::string& hole_frame, double hole_radius);

 private:
  ros::Publisher image_pub_, info_pub_;
  std::optional<StaticFrames> frame_;  // from the first subscriber on
  std::string parent_;                 // of the camera's frame
  ros::WallTime sent_;
};

}  // namespace assembly_cell::ros_bridge
