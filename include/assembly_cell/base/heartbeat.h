// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace assembly_cell {

/// A sign of life of a long computation: calls `report` once a `pause` with the seconds since it
/// began, in a thread of its own, until it is destroyed.
class Heartbeat {
 public:
  Heartbeat(std::chrono::milliseconds pause, std::function<void(double seconds)> report);
  ~Heartbeat();
  Heartbeat(const Heartbeat&) = delete;
  Heartbeat& operator=(const Heartbeat&) = delete;

  /// Something else was printed: a whole pause from now on.
  void rest();

 private:
  void beat();

  const std::chrono::milliseconds pause_;
  const std::function<void(double seconds)> report_;
  std::mutex mutex_;
  std::condition_variable end_;
  const std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point next_;
  bool ended_ = false;
  std::thread thread_;
};

}  // namespace assembly_cell
