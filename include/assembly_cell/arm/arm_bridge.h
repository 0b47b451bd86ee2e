// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "assembly_cell/arm/arm_guard.h"
#include "assembly_cell/arm/block_poses.h"
#include "assembly_cell/arm/cell_place.h"
#include "assembly_cell/arm/node_time.h"

namespace assembly_cell {

/// Weight below sensor_b. Its wrench changes with the carrier's rotation since the sensor was
/// zeroed.
struct Payload {
  Eigen::Vector3d weight = Eigen::Vector3d::Zero();  ///< in carrier_base [N]; 0: not compensated
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of mass, in sensor_b [m]
};
/// Force and torque at the sensor, axes of the carrier, for the rotations R_zero and R of the
/// carrier in carrier_base. [N], [N·m]
Vector6 weightChange(const Payload& payload, const Eigen::Matrix3d& R_zero,
                     const Eigen::Matrix3d& R);

/// A block of samples of sensor_a or sensor_b (0, 1): 6 × count, zero removed, the last one at
/// `end`.
struct SensorBlock {
  std::size_t sensor = 0;
  const double* values = nullptr;
  std::size_t count = 0;
  double period = 0.0;  ///< [s]
  StampNs end = 0;
  const std::uint8_t* saturated = nullptr;  ///< see ContactSamples
};

/// Node arm_bridge without ROS: stamps to cell time, payload, poses at the ends of blocks, and the
/// checks of a restart, around an ArmGuard. Deterministic in lockstep. Not thread-safe.
class ArmBridge {
 public:
  /// initial: the guard before the first state. boot_id: not 0; the next one follows at a restart
  /// of the sensors' clock.
  ArmBridge(const ArmGuard& initial, const CellPlace& place, const Payload& payload,
            const NodeTime& time, std::uint32_t boot_id);

  /// What a block means for the time of the cell, before it is added.
  enum class Start {
    kWaiting,    ///< no time yet: by the wall clock all sensors have to be received first
    kRestarted,  ///< the sensors' clock went back: a new boot, state and commands are dropped
    kContinues
  };
  Start start(std::size_t sensor, StampNs end);
  void addBlock(const SensorBlock& block);
  /// The zero that a sensor has removed since now.
  void setZero(std::size_t sensor, const Vector6& zero);
  /// Flange in the arm's base. True: the motion starts at this pose, see setState() of the guard.
  bool setState(const Pose& X_base_flange, StampNs stamp, const std::string& beyond_limit);
  /// What the bridge lacks to follow commands, in one line; empty: nothing.
  std::string missing() const;

  /// Commands of a node, as in the guard; refused without a stamp or from before the last start.
  GuardVerdict move(const std::string& node, StampNs stamp, const Pose& X);
  GuardVerdict drive(const std::string& node, StampNs stamp, const ExciterCommand& exciter);
  GuardVerdict renew(const std::string& node, StampNs stamp, std::uint32_t session);

  ArmGuard& guard() { return arm_; }
  BlockPoses& poses() { return poses_; }
  const NodeTime& time() const { return time_; }
  std::uint32_t bootId() const { return boot_id_; }
  /// The last block of sensor_b, cell time [s].
  struct Block {
    double end = 0.0, length = 0.0;
  };
  const Block& block() const { return block_; }

 private:
  GuardVerdict checkStamp(const Sender& sender) const;

  const ArmGuard initial_;
  const CellPlace place_;
  const Payload payload_;
  NodeTime time_;
  ArmGuard arm_;
  BlockPoses poses_;
  std::uint32_t boot_id_;
  std::array<bool, 2> received_;  // samples of either sensor, or there is none
  std::array<Vector6, 2> zeros_{Vector6::Zero(), Vector6::Zero()};
  Eigen::Matrix3d R_zero_ = Eigen::Matrix3d::Identity();  // of the carrier at sensor_b's zero
  std::vector<double> values_;                            // of a block, weight removed
  Block block_;
};

}  // namespace assembly_cell
