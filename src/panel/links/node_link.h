// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/ros.h>

#include <mutex>
#include <string>

#include "cell_view.h"
#include "locked_subscriber.h"
#include "node_registry.h"
#include "requests/async_requests.h"

namespace assembly_cell::panel {

/// Diagnostics of the nodes; once a second it checks silent nodes and slow requests.
class NodeLink {
 public:
  NodeLink(const ros::NodeHandle& nh, AsyncRequests& requests);
  /// Fills in nodes, simulator, and the force limit of goals.
  void show(CellView& view) const;

 private:
  void update(const diagnostic_msgs::DiagnosticArray& array);  // with the mutex locked
  void check();
  void checkSilent(const std::string& node);

  AsyncRequests& requests_;
  mutable std::mutex mutex_;
  LockedSubscriber topics_;
  NodeRegistry registry_;
  SimulatorView simulator_;
  double force_limit_ = 0.0;  // of goals [N]
  ros::Subscriber diagnostics_sub_;
  ros::WallTimer timer_;
};

}  // namespace assembly_cell::panel
