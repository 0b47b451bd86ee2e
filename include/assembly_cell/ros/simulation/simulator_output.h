// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <ros/ros.h>
#include <tf2_ros/transform_broadcaster.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "assembly_cell/PlantState.h"
#include "assembly_cell/StrainSamples.h"
#include "assembly_cell/cell/guarded_cell.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/static_frames.h"
#include "assembly_cell/ros/simulation/simulator_settings.h"
#include "assembly_cell/ros/simulation/simulator_state.h"
#include "assembly_cell/ros/simulation/truth_output.h"

namespace assembly_cell::ros_bridge {

/// What the simulator publishes: blocks, poses, ground truth, clock, state of the plant.
class SimulatorOutput {
 public:
  /// All are referred to, `setup` only during the call.
  SimulatorOutput(ros::NodeHandle& nh, const SimulatorSettings& settings,
                  const SimulatorSetup& setup, SimulatorState& state, GuardedCell& cell);

  bool wantsAccelerations() const { return accelerometers_pub_.getNumSubscribers() > 0; }

  // by the thread that computes
  void publishBlock(const StrainBlock& block, std::uint32_t sequence);
  void publishState();       ///< at the present time
  void publishPlantState();  ///< if it differs from the last one
  void publishClock(const ros::Time& stamp);
  /// A start, or a state that was set: another boot id.
  void onPlantRestart();

 private:
  void publishStaticFrames(const SimulatorSetup& setup);
  /// Stamp of a time of the present cell.
  ros::Time stampAt(double cell_time) const { return state_.stampOf(cell_.base() + cell_time); }

  const SimulatorSettings& settings_;
  SimulatorState& state_;
  GuardedCell& cell_;
  std::vector<geometry_msgs::TransformStamped> frames_;  // sent last
  std::uint32_t boot_id_ = 0;
  PlantState plant_state_;  // last published
  ros::Time clock_stamp_;   // last published
  LatestPublisher<StrainSamples> bridge_a_pub_, bridge_b_pub_;
  LatestPublisher<geometry_msgs::PoseStamped> carrier_pub_;
  ros::Publisher accelerometers_pub_, clock_pub_, plant_state_pub_;
  std::optional<TruthOutput> truth_;  // none: not published
  tf2_ros::TransformBroadcaster tf_;
  StaticFrames static_tf_;
};

}  // namespace assembly_cell::ros_bridge
