// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <string>

#include "assembly_cell/PlantState.h"
#include "assembly_cell/SupervisorState.h"
#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell::ros_bridge {

/// The state of a node that moves the peg: its goal, and whether the peg is free. Published on
/// ~state at every change, without the reason while a goal runs. Thread-safe.
class PegState {
 public:
  /// stamp: end of the latest block, for the state's header. is_known: whether the peg is free at
  /// the start of the node; else it counts as in contact until a goal shows what it is.
  PegState(ros::NodeHandle& pnh, std::function<ros::Time()> stamp, bool is_known = true);

  /// With the reason of the goal before, also while one runs.
  SupervisorState get() const;

  /// Applies `edit`, which finds the header's stamp set, and publishes the state if it returns
  /// true. With an exception of `edit` the state stays as it was.
  void update(const std::function<bool(SupervisorState&)>& edit);

 private:
  const std::function<ros::Time()> stamp_;
  mutable std::mutex mutex_;
  SupervisorState state_;
  ros::Publisher pub_;
};

/// False until a goal has shown what the peg is: no goal has since the node was started.
bool isKnown(const SupervisorState& state);
/// The reason of a state that isn't known.
std::string notKnown(const std::string& reason);

/// Keeps the supervisor's state up to date with goals of mechanism_identifier, which moves the peg,
/// too, and publishes the state as a diagnostic status.
class PegMonitor {
 public:
  /// name: of the supervisor, resolved.
  PegMonitor(ros::NodeHandle& nh, const std::string& name, PegState& state);

 private:
  void onIdentifier(const SupervisorState& identifier);
  void onPlant(const PlantState& plant);
  void publishDiagnostics();

  const std::string name_;
  PegState& state_;
  std::atomic<bool> identifier_runs_{false};
  ros::Publisher diagnostics_pub_;
  ros::Subscriber identifier_sub_, plant_sub_;
  ros::WallTimer timer_;
};

/// A peg that a goal has left in the hole.
struct InsertedPeg {
  double depth = 0.0;  ///< of the peg's edge in the hole [m]; 0: not in it
  Pose carrier;        ///< X_BC at that depth
  bool known = false;  ///< a goal of this node has measured the depth, or that there is no wall

  /// Depth with the carrier at X_BC: less by what it has moved out since. 0 if that motion isn't
  /// along the bore. [m]
  double depthAt(const Pose& X_BC) const;
};

}  // namespace assembly_cell::ros_bridge
