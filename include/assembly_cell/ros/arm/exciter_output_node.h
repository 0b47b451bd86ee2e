// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/Exciter.h>
#include <ros/ros.h>

#include <memory>
#include <mutex>
#include <string>

#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/ros/process/periodic_thread.h"
#include "assembly_cell/shaker/guarded_shaker.h"

namespace assembly_cell::ros_bridge {

/// Node exciter_output: drives a shaker (a sound card, a motor with an unbalance, or a plug-in)
/// with the exciter commands that the bridge has accepted, see shaker/guarded_shaker.h. The
/// bridge's sign of life is carrier_pose; time is that of the wall clock. See docs/how_to/arm.md.
class ExciterOutputNode {
 public:
  /// Threads for its callbacks.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter, or a shaker that can't be opened.
  ExciterOutputNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);
  /// Switches the shaker off, and waits until the device has played it.
  void stop();

 private:
  void open(ros::NodeHandle& pnh);
  void subscribe(ros::NodeHandle& arm_nh);
  double since(const ros::Time& stamp) const { return (stamp - epoch_).toSec(); }  ///< [s]
  double now() const { return since(ros::Time::now()); }
  // with the mutex locked
  void work();
  void publishDone();
  void publishDiagnostics();

  ros::NodeHandle nh_;
  std::string type_;
  std::shared_ptr<void> loader_;  // of a plug-in, outlives it
  std::mutex mutex_;
  ros::Time epoch_;  // zero of the shaker's time
  std::unique_ptr<GuardedShaker> shaker_;
  Exciter done_;  // published last
  ros::Publisher done_pub_, speed_pub_, diagnostics_pub_;
  ros::Subscriber exciter_sub_, index_sub_;
  StreamSubscriber life_sub_;
  ros::WallTimer diagnostics_timer_;
  PeriodicThread thread_;  // last: uses the other members
};

}  // namespace assembly_cell::ros_bridge
