// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <mutex>
#include <string>

#include "assembly_cell/align/search/guarded_carrier.h"
#include "assembly_cell/ros/supervision/peg_state.h"
#include "assembly_cell/ros/supervision/ros_plant.h"

namespace assembly_cell::ros_bridge {

/// What moves the peg out of contact.
struct PegRelease {
  const Mechanism& mechanism;
  const PressLimits& limits;
};

/// Frees the peg after a failed goal, in a session of its own. was_free: at the goal's start, so
/// that the carrier returns there. Throws AlignError, PlantError.
void freePeg(RosPlant& plant, const PegRelease& release, bool was_free);

/// How a goal has ended.
struct GoalEnd {
  bool failed = false;
  bool begun = false;     ///< something may have moved
  bool pressing = false;  ///< the peg stays in contact on purpose
  bool freed = false;     ///< freeing the peg was the goal and isn't tried again
  bool stuck = false;
  bool shown = false;  ///< the peg was shown to be out of the hole by a goal that failed later
  int contacts = 0;    ///< measurements until the plant failed
  double time = 0.0;   ///< plant clock [s], 0: the goal had no block
  AlignFailure failure = AlignFailure::kNone;
  std::string reason;
};

/// Goals over the plant, one at a time: their begin and end in the peg's state, and freeing of the
/// peg after a failure.
class GoalRunner {
 public:
  GoalRunner(RosPlant& plant, PegState& state) : plant_(plant), state_(state) {}

  /// Owned by the goal that runs; not owned: another goal runs.
  std::unique_lock<std::mutex> tryLock() { return std::unique_lock(mutex_, std::try_to_lock); }
  /// Returns once no goal runs.
  void wait() { const std::lock_guard<std::mutex> lock(mutex_); }

  /// Runs `goal`, which begins the plant's goal; its exceptions end it. If it fails, the peg is
  /// freed where there are data to detect contact by. needs_free_peg: refused if the peg is stuck.
  /// Call it with the lock owned.
  GoalEnd run(const std::string& name, bool needs_free_peg, const PegRelease& release,
              const std::function<void(GoalEnd&)>& goal);

  /// True unless the goal was cancelled before it moved anything, which leaves the peg's state.
  bool hasBegun(AlignFailure failure) const;

 private:
  /// Writes the exception that is being handled into the end of the goal.
  void setException(GoalEnd& end) const;
  void leave(const GoalEnd& end, const PegRelease& release, bool was_free);

  RosPlant& plant_;
  PegState& state_;
  std::mutex mutex_;
};

}  // namespace assembly_cell::ros_bridge
