// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/ros/bridge/live_settings.h"
#include "assembly_cell/ros/simulation/markers/marker_canvas.h"
#include "assembly_cell/ros/simulation/markers/marker_settings.h"
#include "assembly_cell/ros/simulation/markers/rim_view.h"

namespace assembly_cell::ros_bridge {

/// Node contact_markers: contacts, locus, hypotheses, estimated hole and peg, true peg, lines of
/// action and uncertainty of the twin-force estimate, the hole's rim, of a sensor's live wrench the
/// line of action and its point, and in words state, result, names and legend, for rviz. Subscribes
/// and works only while `markers` has a subscriber. To be spun by one thread.
class ContactMarkersNode {
 public:
  /// Threads of its callbacks.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for bad parameters or robot description.
  ContactMarkersNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);

 private:
  void update();
  void subscribe();
  /// Feedback of a goal while it runs. The first of a goal ends what the last goal has left.
  template <class Feedback>
  void onFeedback(const Feedback& feedback);
  void publish();

  ros::NodeHandle nh_;
  std::unique_ptr<LiveSettings> live_;
  MarkerSettings settings_;  // of the present picture
  PartShapes shapes_;
  MarkerInputs view_;
  MarkerCanvas canvas_;
  bool active_ = false;
  std::vector<ros::Subscriber> subs_;
  RimView rim_view_;
  ros::Publisher pub_;
  ros::WallTimer timer_;
};

}  // namespace assembly_cell::ros_bridge
