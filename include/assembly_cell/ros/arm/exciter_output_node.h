// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/Exciter.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>
#include <std_msgs/Header.h>

#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/shaker/shaker.h"

namespace assembly_cell::ros_bridge {

/// Node exciter_output: gives what the bridge lets pass of the exciter to a shaker: a sound card, a
/// motor with an unbalance, or a plug-in. It plays by the wall clock. Without a sign of life of the
/// bridge (carrier_pose) for ~timeout it is off, and stays off until it is told anew. See
/// docs/how_to/arm.md.
class ExciterOutputNode {
 public:
  /// Of its callbacks.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter, or a shaker that can't be opened.
  ExciterOutputNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);
  ~ExciterOutputNode();
  /// Off, and time for the device to play it.
  void stop();

 private:
  void readParameters(ros::NodeHandle& pnh);
  void open(ros::NodeHandle& pnh);
  void onExciter(const Exciter& exciter, const std::string& publisher);
  void onIndex(const std_msgs::Header& pulse);
  // with the lock
  void drive(const ExciterCommand& command, const ros::Time& reference);
  void refuse(const std::string& publisher, const std::string& why);
  void watch();
  void work();
  void publishDone();
  double since(const ros::Time& stamp) const { return (stamp - epoch_).toSec(); }  // [s]

  void loop();
  void publishDiagnostics();

  ros::NodeHandle nh_, arm_nh_;
  double timeout_ = 0.1;                                   // [s]
  double max_amplitude_ = 50.0, max_frequency_ = 20000.0;  // [N], [rad/s]
  std::string type_;
  std::shared_ptr<void> loader_;  // of a plug-in, outlives it
  std::shared_ptr<Shaker> shaker_;

  std::mutex mutex_;
  std::condition_variable changed_;
  bool quit_ = false;
  ros::Time epoch_;  // the shaker's zero
  ros::Time alive_;  // the bridge's last pose came in
  ExciterCommand asked_;
  std::uint64_t refused_ = 0;
  std::string reason_;  // why it is off; empty: it was told
  Exciter done_;
  bool told_ = false;

  ros::Publisher done_pub_, speed_pub_, diagnostics_pub_;
  ros::Subscriber exciter_sub_, index_sub_;
  StreamSubscriber life_sub_;
  ros::WallTimer diagnostics_timer_;
  std::thread thread_;
};

}  // namespace assembly_cell::ros_bridge
