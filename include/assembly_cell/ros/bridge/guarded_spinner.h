// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/callback_queue.h>
#include <ros/ros.h>

#include <atomic>
#include <thread>
#include <vector>

namespace assembly_cell::ros_bridge {

/// Calls the callbacks of a queue, as ros::AsyncSpinner, but an exception of a callback ends
/// neither the thread nor the process: it is logged and counted (IncomingLog).
class GuardedSpinner {
 public:
  explicit GuardedSpinner(unsigned threads, ros::CallbackQueue* queue = nullptr);
  ~GuardedSpinner();
  GuardedSpinner(const GuardedSpinner&) = delete;
  GuardedSpinner& operator=(const GuardedSpinner&) = delete;

  void start();
  /// Returns once no callback is running.
  void stop();
  /// Returns once ROS has been shut down and no callback is running.
  void wait();

 private:
  void spin();

  const unsigned count_;
  ros::CallbackQueue* const queue_;
  std::atomic<bool> stopping_{false};
  std::vector<std::thread> threads_;
};

}  // namespace assembly_cell::ros_bridge
