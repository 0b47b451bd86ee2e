// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <cstdint>
#include <optional>

#include "assembly_cell/Exciter.h"
#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/identification/unknowns.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell::ros_bridge {

/// Publishes carrier_command and exciter, and keeps what was commanded last. Stamps are the end of
/// the block that a command follows from. Guarded by the plant's monitor.
class PlantCommands {
 public:
  explicit PlantCommands(ros::NodeHandle& nh);

  /// X_BC: pose of the carrier in its base.
  void moveCarrier(const Pose& X_BC, const ros::Time& stamp);
  /// Amplitude 0: off. The phase refers to the stamp.
  void drive(const ExciterParameters& drive, const ros::Time& stamp);
  void stopExciter(const ros::Time& stamp);
  /// Publishes the last commands again, the exciter's with its phase at `stamp`.
  void repeat(const ros::Time& stamp);

  /// No pose of the carrier is repeated until the next one.
  void forgetCarrier() { commanded_.reset(); }
  /// The goal has ended: it has moved nothing from here on.
  void endGoal() { moved_ = false; }
  bool hasMoved() const { return moved_; }
  /// A restarted plant counts commands from 0.
  void onPlantRestart() { count_ = 0; }
  std::uint32_t count() const { return count_; }  ///< published to this boot of the plant

  /// Published amplitude and phase compensate these errors of the exciter.
  void setDriveErrors(const DriveErrors& errors) { errors_ = errors; }
  const Exciter& exciter() const { return exciter_; }  ///< last, without the compensation

 private:
  ros::Publisher carrier_pub_, exciter_pub_;
  std::optional<Pose> commanded_;  // X_BC
  Exciter exciter_;
  DriveErrors errors_;
  bool moved_ = false;
  std::uint32_t count_ = 0;
};

}  // namespace assembly_cell::ros_bridge
