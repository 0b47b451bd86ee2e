// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>

#include <functional>
#include <string>
#include <utility>

#include "assembly_cell/align/plant.h"
#include "assembly_cell/identification/mechanism_record.h"
#include "assembly_cell/ros/estimation/twin_force_client.h"
#include "assembly_cell/ros/supervision/block_stream.h"
#include "assembly_cell/ros/supervision/goal_clock.h"
#include "assembly_cell/ros/supervision/locus_requests.h"
#include "assembly_cell/ros/supervision/plant_commands.h"
#include "assembly_cell/ros/supervision/plant_link.h"
#include "assembly_cell/ros/supervision/plant_monitor.h"

namespace assembly_cell::ros_bridge {

/// The cell through ROS as a strategy's plant: publishes carrier_command and exciter, joins the
/// messages of a block, requests locus measurements by the action identify_locus.
///
/// In lockstep a block is acknowledged when the strategy requests the next one, so its decisions
/// follow blocks and not the wall clock; without a strategy it is acknowledged at once. Without
/// lockstep a block older than kFreshAge is never returned and never leads to a command.
///
/// Between begin() and end() the node owns the plant (PlantLink). If its lease expires, the plant
/// stops; then commands are sent again and a measurement is restarted, and the goal goes on. A
/// measurement that the estimator can't finish is repeated once.
class RosPlant : public Plant {
 public:
  RosPlant(ros::NodeHandle& nh, const PlantSettings& settings);

  /// Begins a goal: waits for a block, whose end is time 0 of the plant clock, and for ownership.
  /// `cancelled` is polled during waits; when it returns true, next() throws.
  void begin(const std::function<bool()>& cancelled);

  /// The goal has failed: continues in a new session, for `seconds` at most, so that the peg can be
  /// freed. What made the goal fail doesn't end it. Throws PlantError without data.
  void recover(double seconds);

  /// Ends the goal: exciter off, measurements cancelled, the plant released. hold: the carrier is
  /// commanded to stay where it is.
  void end(bool hold);

  /// The node shuts down: every wait ends, but those of a recovery.
  void stop() { goal_.stop(); }

  struct State {
    ros::Time stamp;         ///< end of the latest block
    ros::Time origin;        ///< time 0 of the plant clock; zero before a goal's first block
    double time = 0.0;       ///< of `stamp` on the plant clock [s]
    Pose start;              ///< X_BC, carrier in its base, at begin()
    Pose carrier;            ///< X_BC at `stamp`
    bool has_moved = false;  ///< the goal has commanded something
    bool has_data = false;   ///< blocks are arriving
    bool is_stopping = false;
  };
  State state() const;

  /// Displacements and the drive of the exciter are computed by the identified mechanism; null: by
  /// the drawing.
  void setMechanism(const KnownMechanism* known);

  PlantBlock next(const PlantCommand& command) override;
  TwinForceSensing* twinForce() override {
    return goal_.settings().sensors == Sensors::kBoth ? &twin_force_ : nullptr;
  }

 private:
  using Lock = PlantMonitor::Lock;

  void waitFor(Lock& lock, const std::string& what, const std::function<bool()>& ready);
  PlantBlock nextBlock(const PlantCommand& command, bool is_first);
  void takeBlock(Lock& lock);
  void takeFreshBlock(Lock& lock);
  void restoreCommands(Lock& lock);
  void requestLocus(Lock& lock, const LocusRequest& request);
  void takeLocus(Lock& lock, PlantBlock& block);

  PlantMonitor monitor_;
  PlantLink link_;
  PlantCommands commands_;
  VibrationWindow vibration_;
  BlockStream blocks_;  // after the parts that its callbacks use
  GoalClock goal_;
  LocusRequests locus_;
  SaturationCheck saturation_;
  TwinForceClient twin_force_;
};

/// A plant that passes each block to `observer` before the strategy gets it.
class ObservedPlant : public Plant {
 public:
  ObservedPlant(Plant& plant, std::function<void(const PlantBlock&)> observer)
      : plant_(plant), observer_(std::move(observer)) {}

  PlantBlock next(const PlantCommand& command) override {
    const PlantBlock block = plant_.next(command);
    observer_(block);
    return block;
  }

 private:
  Plant& plant_;
  std::function<void(const PlantBlock&)> observer_;
};

}  // namespace assembly_cell::ros_bridge
