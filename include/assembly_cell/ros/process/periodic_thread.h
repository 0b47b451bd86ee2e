// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace assembly_cell::ros_bridge {

/// Calls a function once a period in a thread of its own, until destroyed. Late calls are made up
/// for, by at most 0.1 s. Exceptions are logged.
class PeriodicThread {
 public:
  PeriodicThread() = default;
  ~PeriodicThread() { stop(); }
  PeriodicThread(const PeriodicThread&) = delete;
  PeriodicThread& operator=(const PeriodicThread&) = delete;

  void start(double period, std::function<void()> work);  ///< [s]
  /// Returns after the last call.
  void stop();

 private:
  void run(std::chrono::steady_clock::duration period, const std::function<void()>& work);

  std::mutex mutex_;
  std::condition_variable changed_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace assembly_cell::ros_bridge
