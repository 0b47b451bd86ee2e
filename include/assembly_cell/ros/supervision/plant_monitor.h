// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>

#include "assembly_cell/ros/process/shared_spinner.h"

namespace assembly_cell::ros_bridge {

/// The mutex of a RosPlant's parts, and waits of the strategy's thread for what callbacks change.
/// In lockstep, where the nodes of a process share one thread, the waiting thread runs the
/// callbacks itself: no other thread has to wake up.
class PlantMonitor {
 public:
  using Lock = std::unique_lock<std::mutex>;
  using Steady = std::chrono::steady_clock;

  explicit PlantMonitor(bool lockstep) : lockstep_(lockstep) {}

  Lock lock() const { return Lock(mutex_); }
  void notify() { changed_.notify_all(); }

  /// Returns after notify(), when ready() or after kTick of wall time. The lock is released
  /// meanwhile.
  void waitForChange(Lock& lock, const std::function<bool()>& ready);
  /// Runs `call`, which may take long, without the lock; callbacks go on in their own thread.
  void runUnlocked(Lock& lock, const std::function<void()>& call);

  /// A step of the strategy: between them, in lockstep, callbacks wait for the strategy's thread.
  void beginStep();
  void endStep() { helper_.reset(); }

  /// The strategy's thread is running now; waitForChange() calls it, too.
  void onActivity() { active_ = Steady::now(); }
  Steady::time_point lastActivity() const { return active_; }

  static constexpr double kTick = 0.02;  ///< [s wall]

 private:
  const bool lockstep_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  Steady::time_point active_;
  std::optional<SharedSpinner::Helper> helper_;  // of the strategy's thread, during a step
};

}  // namespace assembly_cell::ros_bridge
